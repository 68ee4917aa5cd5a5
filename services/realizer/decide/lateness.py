"""Time limits while a block runs: for the next report of a behavior under way, and for the decision of an event."""

from collections.abc import Mapping

from msgspec import Struct

from engage_hri.schemas.behavior_types import canonical_sync
from engage_hri.schemas.behaviors import Event, Speech
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.references import type_name
from engage_hri.schemas.syncref import SyncRef
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.sight import Sight
from engage_hri.services.realizer.config import LATE, RealizerConfig
from engage_hri.services.realizer.points import EPSILON, Point
from engage_hri.services.requests.deadlines import Silences

LATE_FACTOR = 1.0
"""Share of its natural time by which a phase may take longer besides: a long one misses by more. Ours."""
STALL_FACTOR = 5.0
"""The same for a phase whose behavior counts as failed (`realizer.stall`): motors that take four times as long pass.
Ours."""


class Late(Struct, frozen=True):
    """`behavior` is taking much longer to `sync` than it should."""

    behavior: str
    sync: str
    overdue: Seconds

    @property
    def point(self) -> Point:
        return Point(self.behavior, self.sync)


class Stalled(Struct, frozen=True):
    """`behavior` has been late for `sync` so long that it must be given up."""

    behavior: str
    sync: str
    overdue: Seconds


class LatenessWatch:
    """The next report of each behavior under way, and when it becomes too late."""

    def __init__(self, config: RealizerConfig, sight: Sight) -> None:
        self._stall = config.stall
        self._awaited: dict[str, tuple[str, Seconds, Seconds]] = {}
        """Next report of each behavior, when it is expected, and how long the phase before it lasts."""
        self._warned: set[str] = set()
        self._alarms = Silences[tuple[str, bool]](sight, lambda name: name)
        """Times from which a behavior is late, and those from which it is stalled, too."""

    def expect(self, behavior: str, sync: str, expected: Seconds, natural: Seconds, now: Seconds) -> None:
        """Expect `sync` as the next report, about at `expected`. natural: the duration of the phase before it."""
        awaited = (sync, expected, natural)
        if awaited != self._awaited.get(behavior):
            self._awaited[behavior] = awaited
            late = expected + LATE + LATE_FACTOR * natural
            stalled = expected + self._stall + STALL_FACTOR * natural
            if behavior not in self._warned:
                self._alarms.set((behavior, False), max(now, late))
            self._alarms.set((behavior, True), max(now, stalled))

    def forget(self, behavior: str) -> None:
        """Stop expecting a report: the behavior has ended, or holds until it may go on."""
        self._awaited.pop(behavior, None)
        self._alarms.clear((behavior, False))
        self._alarms.clear((behavior, True))

    def acquit(self, behavior: str) -> None:
        """Forget that the behavior was late: it had not been asked."""
        self.forget(behavior)
        self._warned.discard(behavior)

    @property
    def deadline(self) -> Seconds | None:
        """Time of the next call of `overdue` that may find something; None if no report is expected."""
        return self._alarms.earliest

    def overdue(self, now: Seconds) -> list[Late | Stalled]:
        """Behaviors that are late (told once for each), and behaviors that have been late for too long."""
        found: list[Late | Stalled] = []
        for behavior, is_stalled in [*iter(lambda: self._alarms.due(now + EPSILON), None)]:
            sync, expected, _ = self._awaited[behavior]
            if is_stalled:
                found.append(Stalled(behavior, sync, now - expected))
                self.forget(behavior)
            else:
                self._warned.add(behavior)
                found.append(Late(behavior, sync, now - expected))
        return found


UNTOLD: Seconds = 2.5
"""Limit of an event where neither the block nor recognition names one, because recognition is not there. Nobody can
say then what the person does: the robot leaves the time in which most people follow a point or begin to answer."""
GRACE: Seconds = 0.5
"""Time after its limit at which an event ends as failed if recognition is not there to decide it."""


def event_deadline(event: Event, block: Block, reached: Mapping[Point, Seconds]) -> Seconds:
    """Time at which an event has failed, if recognition is not there to decide it.

    The limit counts from the start or from the last of the anchors that are reached by now.
    """
    anchors = (reached.get(_point(text, block)) for text in event.anchors)
    since = max(time for time in (reached[Point(event.id, "start")], *anchors) if time is not None)
    return since + (event.limit or UNTOLD) + GRACE


def _point(text: str, block: Block) -> Point:
    ref = SyncRef.parse(text)
    behavior = next((each for each in block.behaviors if each.id == ref.behavior), None)
    if isinstance(behavior, Speech):
        ref = SyncRef.parse(text, [mark.id for mark in behavior.marks])
    sync = canonical_sync(ref.sync, type_name(behavior) if behavior else "", block.dialect)
    return Point(ref.behavior, sync)
