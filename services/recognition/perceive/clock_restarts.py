"""Clocks of reporters that jump back: a camera that was restarted, or whose machine has been set. Pure.

All that such a reporter tells is older by its stamps than what it told before. Taken at its word it would be late
news for as long as the jump was wide: a person would be half heard for ten minutes. A single late message looks the
same; so a jump is believed once some messages in a row are behind, or one that is too old to be late.
"""

from msgspec import Struct

from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.recognition.events.history import Latest
from engage_hri.services.reports.action_reports import OLDEST

BACK: Seconds = 2.0
"""Time by which a stamp has to be behind the latest of its reporter: late messages are so as well. Ours."""
IN_A_ROW = 3
"""Number of such messages after which the clock is taken for restarted. Ours."""
REPORTERS_KEPT = 256


class _Clock(Struct):
    """A clock as one reporter tells it. latest: of its stamps. ahead: time by which it has been set back."""

    latest: Seconds
    ahead: Seconds = 0.0
    behind: int = 0
    """Number of messages in a row that were behind the latest."""


class ClockRestarts:
    """Clocks of all reporters."""

    def __init__(self) -> None:
        self._clocks: Latest[tuple[str, str], _Clock] = Latest(REPORTERS_KEPT)

    def hear(self, reporter: str, stamp: Stamp, local: Seconds, now: Seconds) -> None:
        """Take the stamp of a message that has just come, and tells of what has just happened.

        local: its time by the clocks as the bus knows them. now: when the message came, in seconds on the same clock.
        """
        key = (reporter, stamp.clock)
        clock = self._clocks.get(key)
        if clock is None:
            self._clocks[key] = clock = _Clock(stamp.seconds)
        back = clock.latest - stamp.seconds
        clock.behind = clock.behind + 1 if back > BACK else 0
        if back > OLDEST or clock.behind == IN_A_ROW:
            clock.ahead, clock.latest, clock.behind = now - local, stamp.seconds, 0
        elif local + clock.ahead > now + BACK:
            clock.ahead = 0.0  # it has been set right again
        clock.latest = max(clock.latest, stamp.seconds)

    def ahead(self, reporter: str, clock: str) -> Seconds:
        """Time by which what a reporter tells by this clock has happened later than its stamps say."""
        known = self._clocks.get((reporter, clock))
        return 0.0 if known is None else known.ahead
