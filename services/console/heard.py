"""Messages as people are to see them: actions as all their reporters together tell them, and the world. Pure.

Actions of the bus are not passed on as they came: some are over without anybody who says so, since their reporter was
killed, and of some only a state tells (`services/reports/action_reports.py`). A world ends when its publisher was
killed.
"""

from collections.abc import Callable, Iterator

from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.schemas.world import World
from engage_hri.services.bus.samples import Received
from engage_hri.services.reports.action_reports import REPORT_GRACE, ActionReports, events
from engage_hri.services.reports.in_force import WorldReport
from engage_hri.services.reports.ongoing_actions import ActionEvent
from engage_hri.services.reports.same_people import PeopleNames


class Heard:
    """Messages with the instants that they tell of. robot: its actor id. clock: that of these instants.

    local: instant of a stamp; None: it is of a clock that is not known. told: instant that a message tells of.
    """

    def __init__(
        self,
        robot: str,
        clock: str,
        local: Callable[[Stamp, Seconds], Seconds | None],
        told: Callable[[Message, Seconds], Seconds],
    ) -> None:
        """Both conversions get the time at which the message came, too."""
        self._clock = clock
        self._local = local
        self._told = told
        self._now: Seconds = float("-inf")
        self._reports = ActionReports(robot, REPORT_GRACE, clock, self._instant)
        self._world = WorldReport(REPORT_GRACE)
        self._names = PeopleNames()

    @property
    def deadline(self) -> Seconds | None:
        """Time at which `advance` has something to tell."""
        due = (self._reports.deadline, self._world.deadline)
        return min((each for each in due if each is not None), default=None)

    def advance(self, now: Seconds) -> Iterator[tuple[Message, Seconds]]:
        """Let time pass: what was said by somebody who was killed is over at some time."""
        self._now = max(self._now, now)
        yield from events(self._reports.advance(self._now), self._clock)
        if (world := self._world.advance(self._now)) is not None:
            yield world, self._now

    def take(self, received: Received, now: Seconds) -> Iterator[tuple[Message, Seconds]]:
        """Take a message. Returns what is to be shown for it, each with its instant."""
        self._now = max(self._now, now)
        one = received
        told = self._reports.take(one.message, one.key, one.source, one.life, self._now, past=one.past)
        self._names.take(one.message)
        if not isinstance(one.message, ActionEvent):
            yield self._names.named(one.message), self._told(one.message, one.at)
        yield from events(told, self._clock)
        world = self._world.take(one.message, one.source, one.life, self._now)
        if world is not None and not isinstance(one.message, World):
            yield world, self._now

    def _instant(self, stamp: Stamp) -> Seconds:
        at = self._local(stamp, self._now)
        return self._now if at is None else min(at, self._now)
