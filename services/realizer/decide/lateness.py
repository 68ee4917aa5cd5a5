"""Lateness: how long the next report may take, and what holds account for.

A behavior that reports nothing in time is told late, then given up: else a block with one dead arm never ends.

While something is held, and until all that was under way then has come to its next point, a body may be anywhere
between two words or on its way to a hold point: what is late by no more than was held is late for that. Then it is
known what the hold has cost: the times that are expected now are compared with those that were expected before, and
what is expected to be late by so much more is late for the hold (`HeldUp`). Without this a hold would be told as a
fault of whoever was held.
"""

from collections.abc import Mapping

from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import Sight, Silences
from engage_hri.services.realizer.config import LATE, RealizerConfig
from engage_hri.services.realizer.foresee.expectations import Outlook
from engage_hri.services.realizer.net.facts import STANDING
from engage_hri.services.realizer.points import EPSILON, Point

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


class HeldUp:
    """For how much of a lateness the holds account."""

    def __init__(self) -> None:
        self._costs: list[tuple[Outlook, Outlook]] = []
        """For each time in which something was held, what was expected before it, and after."""
        self._before: Outlook | None = None
        """What was expected before the hold that has its effect now; None: none has."""
        self._began: Seconds = 0.0
        self._lasted: Seconds = 0.0
        """Seconds for which it has lasted, up to `_since` if it still lasts."""
        self._since: Seconds | None = None
        self._settled_at: Seconds = 0.0
        """Time before which not all of its effect is known, once it is over."""
        self._under_way: dict[str, int] = {}
        """Behaviors that were under way when it was over, with the number of their next points."""

    @property
    def has_effect(self) -> bool:
        """True if something is held, or was and not all that follows from it is known."""
        return self._before is not None

    def hold(self, outlook: Outlook, now: Seconds) -> None:
        """Note that something is held from now on. outlook: what was expected until now."""
        if self._before is None:
            self._before, self._began, self._lasted = outlook, now, 0.0
        if self._since is None:
            self._since = now

    def let_go(self, now: Seconds, under_way: Mapping[str, int]) -> None:
        """Note that nothing is held any more. under_way: behaviors on their way to a point, with its number."""
        if self._since is not None:
            self._lasted, self._since = self._lasted + now - self._since, None
            self._settled_at, self._under_way = now + STANDING, dict(under_way)

    def is_settled(self, now: Seconds, under_way: Mapping[str, int]) -> bool:
        """True if the hold is over and its effect is known, but not noted yet (see `settle`)."""
        if self._before is None or self._since is not None or now < self._settled_at:
            return False
        return not any(under_way.get(behavior) == number for behavior, number in self._under_way.items())

    def settle(self, outlook: Outlook) -> None:
        """Note what the hold has cost: all that it was the cause of is in `outlook`."""
        if self._before is not None:
            self._costs.append((self._before, outlook))
            self._before = None

    # -- what it accounts for ------------------------------------------------------------------------------------

    def between(self, point: Point, other: Point, allowed: Seconds, late: Seconds, at: Seconds) -> Seconds:
        """Seconds for which holds account, of those by which `point` is later than `allowed` after another point.

        late: these. at: when the later of the two points came.
        """
        apart = [(one.apart(point, other), after.apart(point, other)) for one, after in self._costs]
        known = sum(_more(one - allowed, after - allowed) for one, after in apart)
        if self._before is None or at <= self._began:
            return known
        # The effect of this one is not known yet. What was expected to be late before it is not late for it.
        lasted = self._lasted + (0.0 if self._since is None else max(0.0, at - self._since))
        already = max(0.0, self._before.apart(point, other) - allowed - known)
        return known + min(lasted + STANDING, max(0.0, late - known - already))


def _more(before: Seconds, after: Seconds) -> Seconds:
    """Seconds by which a lateness has grown."""
    return max(0.0, after - max(0.0, before))
