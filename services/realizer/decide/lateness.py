"""Time limits while a block runs: for the next report of a behavior under way, and for the decision of an event."""

from collections.abc import Callable, Iterator, Mapping

from msgspec import Struct

from engage_hri.schemas.behavior_types import canonical_sync
from engage_hri.schemas.behaviors import Event, Speech
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.references import type_name
from engage_hri.schemas.syncref import SyncRef
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.plan.planner import Plan
from engage_hri.services.realizer.points import EPSILON, Point
from engage_hri.services.requests.deadlines import Deadlines


class Late(Struct, frozen=True):
    """`behavior` is taking much longer to `sync` than it should."""

    behavior: str
    sync: str
    overdue: Seconds


class Stalled(Struct, frozen=True):
    """`behavior` has been late for `sync` so long that it must be given up."""

    behavior: str
    sync: str
    overdue: Seconds


class _Awaited(Struct, frozen=True):
    """The next report of a behavior: when it is expected, late, and so late that the behavior is stalled."""

    sync: str
    expected: Seconds
    late: Seconds
    stalled: Seconds


class LatenessWatch:
    """The next report of each behavior under way, and when it becomes too late."""

    def __init__(self, config: RealizerConfig) -> None:
        self._config = config
        self._awaited: dict[str, _Awaited] = {}
        self._warned: set[str] = set()
        self._alarms: Deadlines[str] = Deadlines(str)

    def expect(self, behavior: str, sync: str, expected: Seconds, natural: Seconds) -> None:
        """Expect `sync` as the next report, about at `expected`. natural: the duration of the phase before it."""
        limits = self._config
        late = expected + limits.late + limits.late_factor * natural
        stalled = expected + limits.stall + limits.stall_factor * natural
        awaited = _Awaited(sync, expected, late, stalled)
        if awaited != self._awaited.get(behavior):
            self._awaited[behavior] = awaited
            self._alarms.set(behavior, stalled if behavior in self._warned else late)

    def forget(self, behavior: str) -> None:
        """Stop expecting a report: the behavior has ended, or holds until it may go on."""
        self._awaited.pop(behavior, None)
        self._alarms.clear(behavior)

    @property
    def deadline(self) -> Seconds | None:
        """Time of the next call of `overdue` that may find something; None if no report is expected."""
        return self._alarms.earliest

    def overdue(self, now: Seconds) -> list[Late | Stalled]:
        """Behaviors that are late (told once for each), and behaviors that have been late for too long."""
        found: list[Late | Stalled] = []
        for behavior in [*iter(lambda: self._alarms.due(now + EPSILON), None)]:
            awaited = self._awaited[behavior]
            if now >= awaited.stalled - EPSILON:
                found.append(Stalled(behavior, awaited.sync, now - awaited.expected))
                self.forget(behavior)
                continue
            self._alarms.set(behavior, awaited.stalled)
            if behavior not in self._warned:
                self._warned.add(behavior)
                found.append(Late(behavior, awaited.sync, now - awaited.expected))
        return found


class Bounds:
    """Bounds that say how late an instant may be after others."""

    def __init__(self, plan: Plan) -> None:
        self._not_after: list[list[tuple[int, Seconds]]] = [[] for _ in plan.net.transitions]
        """For each transition, those that it may be later than by no more than so many seconds."""
        self._fixed: dict[int, Seconds] = {}
        """For each transition with a fixed time, the seconds from the block's start."""
        for place in plan.net.places:
            if not place.source and place.kind in ("order", "delay", "series"):
                self._fixed[place.target] = max(place.lag, self._fixed.get(place.target, 0.0))
            if place.kind in ("order", "delay"):
                # Points that are predicted, or of another block, may come before those that they wait for.
                self._not_after[place.source].append((place.target, -place.lag))
        for bound in plan.net.bounds:
            if bound.kind != "phase":
                self._not_after[bound.source].append((bound.target, -bound.lag))

    def fixed(self, transition: int) -> Seconds:
        """Seconds from the block's start before which the block does not want the transition."""
        return self._fixed.get(transition, 0.0)

    def lateness(
        self,
        transition: int,
        at: Seconds,
        passed: Mapping[int, Seconds],
        held_up: Callable[[int, int, Seconds], Seconds],
    ) -> Seconds:
        """Seconds by which a transition at `at` is later than it may be.

        passed: the times of the transitions that all their behaviors have passed. held_up: the seconds for which
        holds account where the first of two transitions is later than so many seconds after the other.
        """
        known = [(each, seconds) for each, seconds in self._not_after[transition] if each in passed]
        late = [(each, seconds) for each, seconds in known if at - passed[each] > seconds]
        left = (at - passed[each] - seconds - held_up(transition, each, seconds) for each, seconds in late)
        return max((0.0, *left))


def too_early(plan: Plan, reached: Mapping[Point, Seconds], foreign: Point) -> Iterator[tuple[Point, Seconds]]:
    """Points that came before a point of another block allowed it, now that this is reached, and by how much.

    They were met by prediction, which was wrong, or were fixed by other times.
    """
    at = reached[foreign]
    if (here := plan.at.get(foreign)) is None:
        return
    ties = [(here, 0.0)]
    ties += [
        (place.target, place.lag)
        for place in plan.net.places
        if place.source == here and place.kind in ("delay", "order") and place.target < len(plan.members)
    ]
    for transition, lag in ties:
        for member in plan.members[transition]:
            came = reached.get(member.point)
            if came is not None and member.behavior in plan.chains:
                yield member.point, at + lag - came


def event_deadline(
    event: Event, block: Block, reached: Mapping[Point, Seconds], config: RealizerConfig, *, is_received: bool
) -> Seconds:
    """Time at which to give an event up as failed: its limit after its start, or after the last of its anchors.

    Anchors that are not reached by now do not count. is_received: recognition has the request; then it is given far
    more time, since deciding is its business.
    """
    limit = config.limit_of(event.kind) if event.limit is None else event.limit
    anchors = (reached.get(_point(text, block)) for text in event.anchors)
    since = max(time for time in (reached[Point(event.id, "start")], *anchors) if time is not None)
    return since + limit + (config.event_patience if is_received else config.event_grace)


def _point(text: str, block: Block) -> Point:
    ref = SyncRef.parse(text)
    behavior = next((each for each in block.behaviors if each.id == ref.behavior), None)
    if isinstance(behavior, Speech):
        ref = SyncRef.parse(text, [mark.id for mark in behavior.marks])
    sync = canonical_sync(ref.sync, type_name(behavior) if behavior else "", block.dialect)
    return Point(ref.behavior, sync)
