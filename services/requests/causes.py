"""Causes for which somebody is not seen any more, as far as who misses it can know. Pure."""

from math import inf

from engage_hri.schemas.faults import ROUTER, Cause, Fault
from engage_hri.schemas.units import Seconds

SLACK: Seconds = 0.5
"""Time between the loss of a link and the news who is not seen for that: they come from different threads."""
NEVER: Seconds = -inf
STANDSTILL: Seconds = 1.0
"""Lateness from which on this process, or its machine, counts as having stood still: others have missed it."""


class Sight:
    """View that one participant has of the others. name: its own.

    unlinked_at: when it last had no router. asleep_at: when it last stood still.
    """

    __slots__ = ("asleep_at", "name", "unlinked_at")

    def __init__(self, name: str, unlinked_at: Seconds = NEVER) -> None:
        self.name = name
        self.unlinked_at = unlinked_at
        self.asleep_at = NEVER

    def look(self, now: Seconds, due: Seconds | None, unlinked_at: Seconds) -> None:
        """Take in the time. due: when this was to happen."""
        self.unlinked_at = unlinked_at
        if due is not None and now - due >= STANDSTILL:
            self.asleep_at = now

    def misses(self, whose: str, where: str, since: Seconds, now: Seconds, advice: str = "") -> Fault:
        """Fault of something that ends because somebody is not seen. since: time since which it is not."""
        return self._missed(f"{whose} has not been seen", "gone", whose, where, since, now, advice)

    def unrenewed(self, whose: str, where: str, since: Seconds, now: Seconds) -> Fault:
        """Fault of something that ends because who has asked for it has not renewed it. since: when it did."""
        return self._missed(f"{whose} has not renewed it", "unrenewed", whose, where, since, now, "")

    def restarted(self, whose: str, where: str, advice: str = "") -> Fault:
        """Fault of something that ends because somebody has begun another life."""
        return self._fault(f"{whose} was restarted", where, "restarted", whose, advice)

    def _missed(
        self, what: str, cause: Cause, whose: str, where: str, since: Seconds, now: Seconds, advice: str
    ) -> Fault:
        what += f" for {now - since:.1f} s"
        if self.asleep_at >= since - SLACK:
            reason = f"{what}, for {self.name} itself, or its machine, stood still"
            return self._fault(reason, where, "frozen", self.name, advice)
        if self.unlinked_at >= since - SLACK:
            return self._fault(f"{what}, for {self.name} has had no router", where, "unlinked", ROUTER, advice)
        reason = f"{what}: it, its machine or the network has ended or stands still"
        return self._fault(reason, where, cause, whose, advice)

    def _fault(self, reason: str, where: str, cause: Cause, whose: str, advice: str) -> Fault:
        return Fault(reason=reason, where=where, cause=cause, whose=whose, advice=advice, service=self.name)
