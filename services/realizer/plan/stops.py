"""Places and bounds of a block that was held, as long as they take because of that: for another plan of it.

A clock that stood, and a behavior that stood on its way, take as much longer. What an author gives as a time, and
all that follows from it, is later by that much. A constraint that a hold has made impossible to keep costs nobody's
performance: it is late for the hold.
"""

from collections.abc import Mapping, Sequence
from math import inf

from msgspec.structs import replace

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place
from engage_hri.services.realizer.net.stops import Stops
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.points import ORIGIN, Member, Point


def prolonged(
    net: PetriNet, members: Sequence[Sequence[Member]], chains: Mapping[str, Chain], stops: Stops
) -> PetriNet:
    """The net with all in it as long as it takes, since it has been stopped. members: of each transition."""
    if not stops.holds:
        return net
    made = _Stopped(stops, net, members, chains)
    places = tuple([_longer(each, made.of_place(each)) for each in net.places])
    return replace(net, places=places, bounds=tuple([_later(each, made.of_bound(each)) for each in net.bounds]))


def as_run(net: PetriNet) -> PetriNet:
    """The net with all in it as long as if nothing had been stopped: when it runs, the holds are among the facts."""
    if not (any(each.stopped for each in net.places) or any(each.stopped for each in net.bounds)):
        return net
    places = tuple([replace(_longer(each, -each.stopped), stopped=each.stopped) for each in net.places])
    bounds = tuple([replace(_later(each, -each.stopped), stopped=each.stopped) for each in net.bounds])
    return replace(net, places=places, bounds=bounds)


def _longer(place: Place, by: Seconds) -> Place:
    return replace(place, lag=place.lag + by, shortest=place.shortest + by, stopped=by) if by else place


def _later(bound: Bound, by: Seconds) -> Bound:
    return replace(bound, lag=bound.lag - by, stopped=by) if by else bound


class _Stopped:
    """Measure of what was stopped in one net."""

    def __init__(
        self, stops: Stops, net: PetriNet, members: Sequence[Sequence[Member]], chains: Mapping[str, Chain]
    ) -> None:
        self._stops = stops
        self._points = [each.points for each in net.transitions]
        self._chains = chains
        self._members = [[member.behavior for member in each] for each in members]

    def of_place(self, place: Place) -> Seconds:
        """Seconds for which what is in a place has stood."""
        if place.kind == "phase":
            return self._of_phase(place.behavior, place.source, place.target)
        since = self._fired(place.source)
        if place.kind == "idle" or place.lag <= 0.0 or since is None or not self._members[place.target]:
            return 0.0
        return self._stops.of_clock(self._members[place.target], since, place.lag)

    def of_bound(self, bound: Bound) -> Seconds:
        """Seconds by which a point may come later: for which its clock, or its behavior, has stood.

        Or by which it is expected too late for the holds, whatever it is that they have stopped.
        """
        early, late = bound.target, bound.source
        if bound.kind == "phase":
            return self._of_phase(bound.behavior, early, late)
        if bound.lag > 0.0 or not self._members[late]:
            return 0.0
        since = self._fired(early)
        clock = 0.0 if since is None else self._stops.of_clock(self._members[late], since, -bound.lag)
        first, last, times = self._last(early), self._last(late), self._stops.times
        if first is None or last is None:
            return clock
        missed = times[last] - times[first] + bound.lag
        return max(clock, self._stops.cost(last, first, -bound.lag, missed) if missed > 0.0 else 0.0)

    def _of_phase(self, behavior: str, source: int, target: int) -> Seconds:
        """Seconds for which a behavior has stood on its way; if it begins with the block, also before that."""
        stops, points = self._stops, self._chains[behavior].points
        first, last = self._points[source], self._points[target]
        here = max(number for number, each in enumerate(points) if each in first)
        there = max(number for number, each in enumerate(points) if each in last)
        stood = sum(stops.phases.get(each, 0.0) for each in points[here + 1 : there + 1])
        if points[0] in first and not source:
            stood += stops.of(behavior, 0.0, stops.reached.get(points[0], inf))
        return stood

    def _fired(self, transition: int) -> Seconds | None:
        """Time at which all that is in a transition was reached; None: not all is."""
        if not transition:
            return 0.0
        points, reached = self._points[transition], self._stops.reached
        return max(reached[each] for each in points) if points and all(each in reached for each in points) else None

    def _last(self, transition: int) -> Point | None:
        """The latest of the points of a transition, reached or expected; None: nobody knows."""
        points, times = self._points[transition] if transition else (ORIGIN,), self._stops.times
        return max(points, key=times.__getitem__) if points and all(each in times for each in points) else None
