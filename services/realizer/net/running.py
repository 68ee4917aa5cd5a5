"""Net of a block while it runs: where its tokens are, and which transitions have fired, and when.

Reports of a body move the tokens. A behavior's own token goes from phase to phase as the behavior passes its sync
points, by itself: a word or a stroke cannot wait for the others of its instant. A transition fires once all its
behaviors have passed it and every other place before it holds a ripe token. So its time is that of the last of them,
and the time between the first and the last is its skew. The last transition, the end of the block, fires once all
others have that lead to it.

A token in a place with a delay is ripe so many seconds after its transition fired, as measured. A token in a phase is
ripe when the behavior holds at the end of the phase. A `handover` place is not waited for: a behavior that was early
has gone home by itself, and a token that comes too late is taken at once.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from math import inf
from typing import NamedTuple

from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import Deadlines
from engage_hri.services.realizer.net.petri_net import Marking, PetriNet
from engage_hri.services.realizer.points import EPSILON, Member, Point

EMPTY, TOKEN, RIPE = 0, 1, 2
"""Contents of a place."""


class Observer:
    """A part of the realizer that is told what happens in a running net, as it happens."""

    def on_began(self, behavior: str, at: Seconds) -> None:
        """Take the news that a behavior was told to begin: it is on its way to all its points."""

    def on_arrived(self, point: Point, at: Seconds) -> None:
        """Take the news that a behavior holds at `point`."""

    def on_reached(self, point: Point, at: Seconds) -> None:
        """Take the news that a behavior has passed `point`, or that a point of another block has been reached."""

    def on_opened(self, transition: int) -> None:
        """Take the news that nothing but behaviors on their way, and clocks, is missing at `transition`."""

    def on_fired(self, transition: int, at: Seconds) -> None:
        """Take the news that `transition` has fired."""


class _Audience(NamedTuple):
    """Functions to call when something happens. Most observers hear of two or three events: others cost no time."""

    began: list[Callable[[str, Seconds], None]]
    arrived: list[Callable[[Point, Seconds], None]]
    reached: list[Callable[[Point, Seconds], None]]
    opened: list[Callable[[int], None]]
    fired: list[Callable[[int, Seconds], None]]


class Clocks:
    """The time at which the token in each place will be ripe, for tokens that are not."""

    def __init__(self) -> None:
        self._due: Deadlines[int] = Deadlines(int)
        self._left: dict[int, Seconds] = {}

    @property
    def stopped(self) -> Mapping[int, Seconds]:
        """Places whose clocks are stopped, with the seconds that are left."""
        return self._left

    @property
    def next(self) -> Seconds | None:
        """Time at which the next token is ripe; None: no clock runs."""
        return self._due.earliest

    def set(self, place: int, at: Seconds, now: Seconds, *, is_stopped: bool) -> None:
        """Let the token in `place` be ripe at `at`; later by as long as the clock is stopped, from `now` on."""
        if is_stopped:
            self._left[place] = at - now
        else:
            self._due.set(place, at)

    def ripe(self, now: Seconds) -> tuple[int, Seconds] | None:
        """Remove the first token that is ripe by `now`; returns its place, and since when. None: there is none."""
        at = self._due.earliest
        if at is None or at > now or (place := self._due.due(now)) is None:
            return None
        return place, at

    def stop(self, is_held: Callable[[int], bool], now: Seconds) -> dict[int, Seconds]:
        """Stop the clocks of the places that are held now, and let all others run.

        Returns the places whose clocks go on, each with the time at which its token is ripe now.
        """
        for place in [each for each in self._due if is_held(each)]:
            at = self._due[place]
            assert at is not None
            self._due.clear(place)
            self._left[place] = at - now
        going_on = {place: now + left for place, left in self._left.items() if not is_held(place)}
        for place, at in going_on.items():
            del self._left[place]
            self.set(place, at, now, is_stopped=False)
        return going_on


class Instant:
    """One transition while the net runs: what is there, and what it lacks before it can fire.

    members: parts of behaviors in it. absent: number of those that have not passed it. lacking: places before it
    without a token, and behaviors that have yet to begin: without any it is open, and all that it waits for is on its
    way. missing: behaviors that have not passed it, and places before it without a ripe token: without any it fires.
    latest: time at which the last behavior passed it. since: at which the last came of all that has come. ripe: at
    which the tokens that lie before it are ripe, or were. is_before_end: the end of the block waits for it.
    """

    __slots__ = ("absent", "is_before_end", "lacking", "latest", "members", "missing", "ripe", "since")

    def __init__(self, members: Sequence[Member]) -> None:
        self.members = members
        self.absent = self.missing = len(members)
        self.lacking = 0
        self.latest = self.since = self.ripe = -inf
        self.is_before_end = False


class RunningNet:
    """A marking that runs, from the initial one to the initial one.

    members: for each transition, the behaviors' parts in it. at: the transition of each point. observers: told of
    everything, in this order. instants: all transitions. fired: the time at which each fired, in that order. passed:
    the time at which the last of its behaviors passed it, which may be before it fires. end: the transition that ends
    the block.
    """

    def __init__(
        self,
        net: PetriNet,
        members: Sequence[Sequence[Member]],
        at: Mapping[Point, int],
        observers: Sequence[Observer] = (),
    ) -> None:
        self.net = net
        self.instants = [Instant(each) for each in members]
        self.fired: dict[int, Seconds] = {}
        self.passed: dict[int, Seconds] = {}
        self.at = at
        self._told = _Audience([], [], [], [], [])
        self.observe(observers)
        self._tokens = bytearray(RIPE * count for count in net.initial)
        self._before: dict[int, int] = {}
        """Places whose token was put or taken since `changes` was asked last, with what was there then."""
        self._clocks = Clocks()
        self.prolonged: dict[int, Seconds] = {}
        """Places whose clocks were stopped for a while, and for how long."""
        self._held: Collection[str] | None = ()
        """Behaviors whose clocks are stopped; None: all clocks are."""
        self._firing: list[tuple[int, Seconds]] = []
        """Transitions that fire now, the first is at it."""
        parts = {(each.behavior, number): each for number, group in enumerate(members) for each in group}
        self.part_of: Mapping[Point, Member] = {
            point: parts[point.behavior, number] for point, number in at.items() if (point.behavior, number) in parts
        }
        """For each point, the part that its behavior has in the point's instant."""
        self._into: dict[Point, int] = {}
        self._out_of: dict[Point, int] = {}
        """The phases of each behavior, by the points at their ends: of several at one instant, that of its part."""
        self._after: dict[Point, tuple[int, ...]] = {}
        """Places that a behavior puts a token into as it passes a transition, apart from its phases."""
        self._put_at: dict[int, Seconds] = {}
        """For each place with a clock, when its token was put."""
        for number, place in enumerate(net.places):
            if place.kind == "phase":
                self._into[parts[place.behavior, place.target].point] = number
                self._out_of[parts[place.behavior, place.source].point] = number
                continue
            if place.after:
                point = parts[place.after, place.source].point
                self._after[point] = (*self._after.get(point, ()), number)
            if place.kind not in ("handover", "idle"):
                self.instants[place.target].lacking += 1
                self.instants[place.target].missing += 1
        stations: dict[str, list[int]] = {}
        for transition, group in enumerate(members):
            for member in group:
                if member.kind != "start" and ":" not in member.behavior:
                    stations.setdefault(member.behavior, []).append(transition)
                    self.instants[transition].lacking += 1
        self._stations = {behavior: tuple(each) for behavior, each in stations.items()}
        """For each behavior, the transitions that it comes to later than with its start."""
        self.end = len(net.transitions) - 1
        last = self.instants[self.end]
        last.lacking = last.missing = self._mark_before_end()

    def observe(self, observers: Iterable[Observer]) -> None:
        """Tell these, too, what happens from now on."""
        for each in observers:
            for event, told in self._told._asdict().items():
                name = f"on_{event}"
                if getattr(type(each), name) is not getattr(Observer, name):
                    told.append(getattr(each, name))

    def _mark_before_end(self) -> int:
        """Mark the transitions that the end of the block waits for; returns how many these are.

        Not among them are ends of events that may outlast it, and who takes a part by plan: a behavior that was early
        has gone home by itself.
        """
        todo, count = [self.end], 0
        while todo:
            for place in (self.net.places[each] for each in self.net.inputs[todo.pop()]):
                source = self.instants[place.source]
                if place.kind not in ("idle", "handover") and not source.is_before_end:
                    source.is_before_end = True
                    count += 1
                    todo.append(place.source)
        return count

    # -- questions -----------------------------------------------------------------------------------------------

    @property
    def marking(self) -> Marking:
        """Tokens in each place of the net, ripe or not."""
        return bytes(each != EMPTY for each in self._tokens)

    def changes(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Places that have a token now and had none, and that had one and have none, since this was asked last."""
        before, self._before = self._before, {}
        put = [place for place, content in before.items() if not content and self._tokens[place]]
        taken = [place for place, content in before.items() if content and not self._tokens[place]]
        return tuple(sorted(put)), tuple(sorted(taken))

    @property
    def is_over(self) -> bool:
        """True if the end of the block has fired."""
        return self.end in self.fired

    def is_open(self, transition: int) -> bool:
        """True if nothing but behaviors on their way, and clocks, is missing at a transition that has not fired.

        The start of the block is open for the behaviors that begin with it, though it has fired.
        """
        return not self.instants[transition].lacking and (not transition or transition not in self.fired)

    def ripe_at(self, transition: int) -> Seconds:
        """Time at which the tokens that other transitions have put before `transition` are ripe.

        -inf: there are none. inf: a clock is stopped.
        """
        stopped = self._clocks.stopped
        if stopped and any(place in stopped for place in self.net.inputs[transition]):
            return inf
        return self.instants[transition].ripe

    @property
    def next_ripe(self) -> Seconds | None:
        """Time at which to call `tick` even if nothing is reported until then; None: there is no need."""
        return self._clocks.next

    # -- what moves tokens ---------------------------------------------------------------------------------------

    def start(self, at: Seconds) -> None:
        """Fire the start of the block."""
        self.passed[0] = at
        self._fire(0, at)

    def begin(self, behavior: str, at: Seconds) -> None:
        """Note that a behavior was told to begin."""
        for tell in self._told.began:
            tell(behavior, at)
        for transition in self._stations.get(behavior, ()):
            self._lack_less(transition)

    def arrive(self, point: Point, at: Seconds) -> None:
        """Note that a behavior holds at `point`, which ends a phase."""
        if point not in self.at:
            return
        if (place := self._into.get(self.part_of[point].point)) is not None and self._tokens[place]:
            self._set(place, RIPE)
        for tell in self._told.arrived:
            tell(point, at)

    def reach(self, point: Point, at: Seconds) -> None:
        """Move the token of a behavior that has passed `point`, and fire what has everything then."""
        if (transition := self.at.get(point)) is None:
            return
        for tell in self._told.reached:
            tell(point, at)
        if self.part_of[point].point == point:
            if (place := self._into.get(point)) is not None:
                self._set(place, EMPTY)
            if (place := self._out_of.get(point)) is not None:
                self._set(place, TOKEN)
            for each in self._after.get(point, ()):
                self._put(each, at)
            instant = self.instants[transition]
            instant.latest = max(instant.latest, at)
            instant.absent -= 1
            if not instant.absent:
                self.passed[transition] = instant.latest
            self._miss_less(transition, at)

    def tick(self, now: Seconds) -> None:
        """Let the tokens ripen that are due by `now`."""
        while (ripe := self._clocks.ripe(now + EPSILON)) is not None:
            self._ripen(*ripe)

    def hold(self, behaviors: Collection[str] | None, now: Seconds) -> None:
        """Stop the clocks before the transitions of these behaviors (None: all), and let all others go on."""
        self._held = behaviors
        for number, at in self._clocks.stop(self._is_held, now).items():
            place = self.net.places[number]
            self.instants[place.target].ripe = max(self.instants[place.target].ripe, at)
            self.prolonged[number] = at - self._put_at[number] - place.lag

    def stop_and_go(self, behaviors: Collection[str] | None, at: Seconds) -> None:
        """`tick`, and `hold`: what was held at a time in the past."""
        self.tick(at)
        self.hold(behaviors, at)

    def _is_held(self, place: int) -> bool:
        held = self._held
        return held is None or any(
            each.behavior in held for each in self.instants[self.net.places[place].target].members
        )

    def _set(self, place: int, content: int) -> None:
        self._before.setdefault(place, self._tokens[place])
        self._tokens[place] = content

    def _lack_less(self, transition: int) -> None:
        self.instants[transition].lacking -= 1
        if not self.instants[transition].lacking:
            for tell in self._told.opened:
                tell(transition)

    def _miss_less(self, transition: int, at: Seconds) -> None:
        """Note that something has come to `transition`; fire it, and all that follows, if that was the last."""
        instant = self.instants[transition]
        instant.since = max(instant.since, at)
        instant.missing -= 1
        if not instant.missing and transition not in self.fired:
            self._fire(transition, instant.since)

    def _fire(self, transition: int, at: Seconds) -> None:
        self._firing.append((transition, at))
        if len(self._firing) == 1:  # Otherwise the call that is going on fires it: chains are longer than stacks.
            for here, then in self._firing:
                self._fire_one(here, then)
            self._firing.clear()

    def _fire_one(self, transition: int, at: Seconds) -> None:
        self.fired[transition] = at
        for number in self.net.inputs[transition]:
            place = self.net.places[number]
            if place.kind != "phase" and (place.source not in self.fired or place.kind != "idle"):
                self._set(number, EMPTY)
        for tell in self._told.fired:
            tell(transition, at)
        for number in self.net.outputs[transition]:
            place = self.net.places[number]
            if place.kind != "phase" and not place.after:
                self._put(number, at)
        if self.instants[transition].is_before_end:
            self._miss_less(self.end, at)

    def _put(self, number: int, at: Seconds) -> None:
        """Put a token into a place, at the time of the transition before it, or of a behavior that passes that."""
        place = self.net.places[number]
        target = place.target
        if target in self.fired and place.kind != "idle":
            return  # Only where the target does not wait for it.
        if place.kind == "idle" and self._tokens[number]:
            return  # An event that is decided before all of its first instant are there.
        assert not self._tokens[number], f"{place.kind} place {number} would hold two tokens"
        self._set(number, TOKEN if place.lag > 0.0 else RIPE)
        if place.kind in ("handover", "idle") or target == self.end:
            return
        if place.source or place.lag > 0.0 or place.after:
            self.instants[target].ripe = max(self.instants[target].ripe, at + place.lag)
        if place.lag > 0.0:
            self._put_at[number] = at
            self._clocks.set(number, at + place.lag, at, is_stopped=self._is_held(number))
        self._lack_less(target)
        if place.lag <= 0.0:
            # A point of another block may be older than this block: its instant is in the past.
            self._miss_less(target, at if place.source or place.after else -inf)

    def _ripen(self, number: int, at: Seconds) -> None:
        self._set(number, RIPE)
        self._miss_less(self.net.places[number].target, at)

    def let_go(self) -> None:
        """Take the tokens away that wait for what the block does not wait for. For a block that is over.

        These are before the ends of events that outlast it, which recognition follows, and before starts of other
        blocks' behaviors that were to take a part.
        """
        for number, place in enumerate(self.net.places):
            if self._tokens[number] and place.kind != "idle" and place.target not in self.fired:
                self._set(number, EMPTY)
        left = [each for each, place in enumerate(self.net.places) if place.kind == "idle" and not self._tokens[each]]
        outlasting = {self.net.places[each].behavior for each in left}
        for number in left:
            self._set(number, RIPE)
        for point, number in self._into.items():
            if point.behavior in outlasting:
                self._set(number, EMPTY)

    def clear(self) -> None:
        """Take all tokens away: the block has failed or was interrupted."""
        for place, content in enumerate(self._tokens):
            if content:
                self._set(place, EMPTY)
