"""Certificate of a running process: its end is told ahead, for a link ends with it, and there is no other."""

import asyncio
import time
from collections.abc import Callable

from engage_hri.schemas.units import A_DAY, Seconds, span

AHEAD: tuple[Seconds, ...] = (30 * A_DAY, 7 * A_DAY, A_DAY, 0.0)
"""Times before its end at which it is told."""
LOOK: Seconds = 3600.0
"""Time after which the wall clock is read again: it may be set, and machines sleep."""
REMEDY = "`engage keys renew` where the authority is; give this process its folder anew, and start it again"


def told(left: Seconds) -> int:
    """Count the times of `AHEAD` that have been reached. left: time to the end."""
    return sum(left <= ahead for ahead in AHEAD)


def words(name: str, left: Seconds) -> str:
    """Write the line that tells of an end. left: time to it."""
    if left <= 0:
        return f"the certificate of {name} has expired: its links end, and it gets no new ones; {REMEDY}"
    return f"the certificate of {name} expires in {span(left)}, and its links end then; {REMEDY}"


class Expiry:
    """Alarm of a certificate: a line when 30 days, 7 days or a day are left, and at its end.

    wall: reads the wall clock, in seconds since 1970.
    """

    def __init__(
        self, name: str, until: float, tell: Callable[[str], None], wall: Callable[[], float] = time.time
    ) -> None:
        """name: common name of its holder. until: its end, in seconds since 1970."""
        self._name = name
        self._until = until
        self._tell = tell
        self._wall = wall
        self._told = 0
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._look()

    def close(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def _look(self) -> None:
        left = self._until - self._wall()
        if (reached := told(left)) > self._told:
            self._told = reached
            self._tell(words(self._name, left))
        ahead = [left - each for each in AHEAD if left > each]
        self._timer = self._loop.call_later(min(LOOK, *ahead), self._look) if ahead else None
