"""Clocks of reporters: how wrong the delays are that two of them tell, and which of them jump back. Pure.

A delay lies between instants that two machines told, each on its own clock (`ClockErrors`). A camera that was
restarted, or whose machine has been set, tells from then on what is older by its stamps than what it told before
(`ClockRestarts`).
"""

from collections import OrderedDict
from collections.abc import Sequence
from math import isfinite

import msgspec
from msgspec import Struct

from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent, EventOutcome
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.recognition.events.history import Latest
from engage_hri.services.reports.action_reports import OLDEST

LATE: Seconds = 2.5
"""Time by which a message may come later than the fastest of its reporter. Ours."""
IN_A_ROW = 3
"""Least number of messages, all too old, after which the clock is taken for restarted. Ours."""
WHILE: Seconds = 0.5
"""Least time from the first to the last of them. Ours."""
CATCHING_UP = 0.5
"""Share of that time by which their age has fallen if they have only waited: they come faster than they were told.
Ours."""
REPORTERS_KEPT = 256


class _Row(Struct):
    """Messages in a row that came too old, and about equally so.

    since: when the first came. age: of the first. least: of all. lasts: for how long they have to come.
    """

    since: Seconds
    age: Seconds
    least: Seconds
    lasts: Seconds
    number: int = 0


class _Clock(Struct):
    """A clock as one reporter tells it. latest: of its stamps. ahead: time by which it has been set back.

    way: least age at which a message has come.
    """

    latest: Seconds
    way: Seconds
    ahead: Seconds = 0.0
    row: _Row | None = None

    def is_restarted(self, stamp: Seconds, age: Seconds, now: Seconds) -> bool:
        """True if the clock has jumped back by now. age: of a message that has just come with this stamp."""
        if age <= self.way + LATE:
            self.row, self.way = None, max(0.0, min(self.way, age))
            return False
        if self.row is None or abs(age - self.row.age) > LATE:
            is_behind = stamp < self.latest - LATE
            self.row = _Row(now, age, age, WHILE if is_behind else max(WHILE, age - self.way))
        row, lasts = self.row, now - self.row.since
        row.number += 1
        row.least = min(row.least, age)
        stays = lasts >= row.lasts and row.age - age <= CATCHING_UP * lasts
        return stamp < self.latest - OLDEST or (row.number >= IN_A_ROW and stays)


class ClockRestarts:
    """Clocks of all reporters, and by how much each has been set back.

    Taken at its word, a clock that was would have all its news late for as long as the jump was wide: a person would
    be half heard for ten minutes. What tells a jump from late messages is the age at which messages come: after a
    jump each is as old as the jump was wide, and it stays so. Late messages are late by `LATE` at most, or overtaken
    by one in time. Those that have waited for a link come faster than they were told, so that each is less old than
    the one before. So a jump is believed once some messages in a row are too old, and all equally so for a while; and
    at once if one is a minute behind the latest. Their order shows a jump as well, but only if they are many: if not,
    the while is as long as the jump was wide.
    """

    def __init__(self) -> None:
        self._clocks: Latest[tuple[str, str], _Clock] = Latest(REPORTERS_KEPT)

    def hear(self, reporter: str, stamp: Stamp, local: Seconds, now: Seconds) -> None:
        """Take the stamp of a message that has just come, and tells of what has just happened.

        local: its time by the clocks as the bus knows them. now: when the message came, in seconds on the same clock.
        """
        key, age = (reporter, stamp.clock), now - local
        clock = self._clocks.get(key)
        if clock is None:
            self._clocks[key] = clock = _Clock(stamp.seconds, max(0.0, age))
        if age - clock.ahead < -LATE:
            clock.ahead = 0.0  # it has been set right again
        if clock.is_restarted(stamp.seconds, age - clock.ahead, now) and clock.row is not None:
            clock.ahead += clock.row.least - clock.way
            clock.latest, clock.row = stamp.seconds, None
        clock.latest = max(clock.latest, stamp.seconds)

    def ahead(self, reporter: str, clock: str) -> Seconds:
        """Time by which what a reporter tells by this clock has happened later than its stamps say."""
        known = self._clocks.get((reporter, clock))
        return 0.0 if known is None else known.ahead


KEPT: Seconds = 120.0
"""Time for which errors are remembered: longer than between the beginning of an event and its decision."""
PEOPLE_KEPT = 256


class ClockErrors:
    """Greatest errors of the instants that are told of the robot and of people, by second. robot: its actor id.

    A delay can be as wrong as its two ends together, of which one is the robot's and one the person's.
    """

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._errors: OrderedDict[str, dict[int, Seconds]] = OrderedDict()
        """Greatest error, by actor and second."""
        self._delays: dict[str, Seconds | None] = {}
        """Errors of the delays of open events, by id."""

    def heard(self, actor: str, at: Seconds, error: Seconds) -> None:
        """Take the error of an instant of somebody. at: that instant."""
        errors = self._errors.setdefault(actor, {})
        self._errors.move_to_end(actor)
        second = int(at)
        errors[second] = max(errors.get(second, 0.0), error)
        if len(errors) > KEPT:
            newest = max(errors)
            self._errors[actor] = {each: known for each, known in errors.items() if each > newest - KEPT}
        if len(self._errors) > PEOPLE_KEPT:
            del self._errors[next(each for each in self._errors if each != self._robot)]

    def marked(self, event: ConnectionEvent) -> ConnectionEvent:
        """Add the greatest error to an event that has a delay. A delay keeps its error until its event ends."""
        if event.delay is None:
            return event
        if event.id not in self._delays:
            since = int(event.started.seconds)
            worst = self._worst(event.initiator, since) + self._worst(event.responder, since)
            self._delays[event.id] = worst if isfinite(worst) else None
        error = self._delays[event.id]
        if event.state in ENDINGS:
            del self._delays[event.id]
        return msgspec.structs.replace(event, delay_error=error)

    def marked_as(self, outcome: EventOutcome, changes: Sequence[object]) -> EventOutcome:
        """Add the error of its event to an outcome. changes: the last changes, with that of its event."""
        events = (each for each in reversed(changes) if isinstance(each, ConnectionEvent))
        event = next((each for each in events if each.id == outcome.event), None)
        if outcome.delay is None or event is None:
            return outcome
        return msgspec.structs.replace(outcome, delay_error=event.delay_error)

    def _worst(self, actor: str, since: int) -> Seconds:
        return max((error for second, error in self._errors.get(actor, {}).items() if second >= since), default=0.0)
