"""Knowledge that a participant has of itself when it misses somebody: did it stand still, had it no router? Pure."""

from collections.abc import Callable
from math import inf

from engage_hri.schemas.faults import ROUTER, Cause, Fault
from engage_hri.schemas.units import Seconds

SLACK: Seconds = 0.5
"""Time between the loss of a link and the news who is not seen for that: they come from different threads."""
NEVER: Seconds = -inf
LATE: Seconds = 0.05
"""Lateness from which on this process did not look, and the time for what came meanwhile to be heard."""
STANDSTILL: Seconds = 1.0
"""Lateness from which on this process, or its machine, counts as having stood still: others have missed it."""
UNSEEN = "it, its machine or the network has ended, stands still or is late"


class Sight:
    """View that one participant has of the others. name: its own.

    unlinked_at: tells when it last had no router. woke_at: when it last looked late. asleep_at: when it last stood
    still. slept: seconds for which it has stood still in all.
    """

    __slots__ = ("asleep_at", "name", "slept", "unlinked_at", "woke_at")

    def __init__(self, name: str, unlinked_at: Callable[[], Seconds] = lambda: NEVER) -> None:
        self.name = name
        self.unlinked_at = unlinked_at
        self.woke_at = self.asleep_at = NEVER
        self.slept: Seconds = 0.0

    def look(self, now: Seconds, due: Seconds) -> bool:
        """Take in the time. due: when this was to happen. True: this comes so late that others are heard first."""
        late = now - max(due, self.woke_at)
        if late >= STANDSTILL:
            self.asleep_at = now
            self.slept += late
        if is_late := late > LATE:
            self.woke_at = now
        return is_late

    def misses(self, whose: str, where: str, since: Seconds, now: Seconds, advice: str = "") -> Fault:
        """Fault of something that ends because somebody is not seen. since: time since which it is not."""
        what = f"{whose} has not been seen for {now - since:.1f} s"
        return self.fault(what, UNSEEN, "gone", whose, where, since, advice)

    def unrenewed(self, whose: str, where: str, since: Seconds, now: Seconds) -> Fault:
        """Fault of something that ends because who has asked for it has not renewed it. since: when it did."""
        what = f"{whose} has not renewed it for {now - since:.1f} s"
        return self.fault(what, UNSEEN, "unrenewed", whose, where, since)

    def restarted(self, whose: str, where: str, advice: str = "") -> Fault:
        """Fault of something that ends because somebody has begun another life."""
        reason = f"{whose} was restarted"
        return Fault(reason=reason, where=where, cause="restarted", whose=whose, advice=advice, service=self.name)

    def fault(
        self, what: str, why: str, cause: Cause, whose: str, where: str, since: Seconds, advice: str = ""
    ) -> Fault:
        """Fault of something that has not come by now; one's own, or the router's, if that was so since `since`.

        what: what has not come, in words. why, cause, whose, advice: as it is if neither is so.
        """
        if self.asleep_at >= since - SLACK:
            why, cause, whose = f"{self.name} itself, or its machine, stood still", "frozen", self.name
        elif self.unlinked_at() >= since - SLACK:
            why, cause, whose = f"{self.name} has had no router", "unlinked", ROUTER
        reason = f"{what}: {why}" if why else what
        return Fault(reason=reason, where=where, cause=cause, whose=whose, advice=advice, service=self.name)
