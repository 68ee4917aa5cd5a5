"""Points of each behavior, the seconds between them, and the parts that the behavior moves.

For another plan of a block that was held, each place and bound takes as long as it does because of that. A clock
that stood, and a behavior that stood on its way, take as much longer. What an author gives as a time, and all that
follows from it, is later by that much. Without this a constraint that a hold has made impossible to keep would cost
a behavior its performance; it is late for the hold instead.
"""

from collections.abc import Mapping, Sequence
from math import inf

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.behaviors import BlockBehavior, Event, Gesture, Hand, Head, Pointing
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.facts import Stops
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place
from engage_hri.services.realizer.plan.relations import Relations
from engage_hri.services.realizer.points import ON_TARGET, ORIGIN, Member, Point, Segment, family, frozen, segments

ARMS: Mapping[Hand, tuple[str, ...]] = {
    "LEFT_HAND": ("left_arm",), "RIGHT_HAND": ("right_arm",), "BOTH_HANDS": ("left_arm", "right_arm"),
}  # fmt: skip
"""Parts of the body that are meant by each hand."""


class Chain(Struct, frozen=True):
    """A behavior with the seconds between its points.

    longest: of each segment; None: without limit. parts: those that it takes from a behavior that has them.
    """

    behavior: BlockBehavior
    type: str
    points: tuple[Point, ...]
    segments: tuple[Segment, ...]
    longest: tuple[Seconds | None, ...]
    parts: tuple[str, ...] = ()


RESERVE = 0.5
"""Share of its way to the stroke by which a movement sets out before it must: it may be slow, and words fast."""


def with_planned_hand(chain: Chain) -> BlockBehavior:
    """The behavior of a chain, with the hand that it is planned for: the body would choose anew as it begins."""
    behavior = chain.behavior
    if isinstance(behavior, Gesture | Pointing) and behavior.mode is None:
        arms = tuple(part for part in ARMS["BOTH_HANDS"] if part in chain.parts)
        hand = next((hand for hand, parts in ARMS.items() if tuple(parts) == arms), None)
        return behavior if hand is None else replace(behavior, mode=hand)
    return behavior


def chain(behavior: BlockBehavior, estimate: Estimate | None) -> Chain:
    """`behavior` as the body estimates it; nominal where it does not."""
    longest = {(phase.since, phase.to): phase.longest for phase in estimate.phases} if estimate else {}
    parts = segments(behavior, estimate)
    if isinstance(behavior, Head) and estimate is not None:
        parts = _stroke_by_stroke(parts, estimate)
    return Chain(
        behavior,
        type_name(behavior),
        tuple([Point(behavior.id, sync) for sync in ("start", *(part.to for part in parts))]),
        parts,
        tuple([longest.get((part.since, part.to)) for part in parts]) if longest else (None,) * len(parts),
        _parts(behavior, estimate),
    )


def _stroke_by_stroke(parts: tuple[Segment, ...], estimate: Estimate) -> tuple[Segment, ...]:
    """The phases with each repetition of a movement, if the body says that it will tell of them: `stroke:2` etc."""
    syncs = [phase.since for phase in estimate.phases]
    if "stroke" not in syncs or "stroke_end" not in syncs:
        return parts
    first, last = syncs.index("stroke"), syncs.index("stroke_end")
    strokes = [
        Segment(phase.since, phase.to, min(phase.shortest, phase.natural), phase.natural, phase.to == "stroke_end")
        for phase in estimate.phases[first:last]
    ]
    number = next(number for number, part in enumerate(parts) if part.since == "stroke")
    return (*parts[:number], *strokes, *parts[number + 1 :])


def _parts(behavior: BlockBehavior, estimate: Estimate | None) -> tuple[str, ...]:
    type = type_name(behavior)
    if not TYPES[type].takes_over:
        return ()
    if isinstance(behavior, Pointing | Gesture) and behavior.mode is not None:
        return ARMS[behavior.mode]
    parts = estimate.parts if estimate and estimate.parts else (family(type),)
    # A nod is on top of whatever else the head does.
    return tuple([f"nod of {part}" for part in parts]) if type == "head" else parts


def natural_ends(chains: Mapping[str, Chain], relations: Relations) -> frozenset[str]:
    """Behaviors that last until something takes their place or all ends: the block does not say when they end."""
    constrained = relations.constrained | relations.untied
    return frozen(
        id
        for id, each in chains.items()
        if each.type in ON_TARGET
        and not any(Point(id, sync) in constrained for sync in ("stroke_end", "relax", "end"))
    )


def unawaited_events(chains: Mapping[str, Chain], relations: Relations) -> frozenset[str]:
    """Events with a decision that nothing in the block waits for."""
    events = {id for id, each in chains.items() if isinstance(each.behavior, Event)}
    awaited = {point.behavior for point in relations.constrained if point.sync == "end"} if events else ()
    return frozenset(events.difference(awaited))


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
