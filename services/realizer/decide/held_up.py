"""Lateness that holds account for, and what comes late by itself.

While something is held, and until all that was under way then has come to its next point, a body may be anywhere
between two words or on its way to a hold point: what is late by no more than was held is late for that. Then it is
known what the hold has cost: the times that are expected now are compared with those that were expected before, and
what is expected to be late by so much more is late for the hold.
"""

from collections.abc import Mapping

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.foresee.outlook import Outlook
from engage_hri.services.realizer.net.facts import STANDING
from engage_hri.services.realizer.points import Point


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
