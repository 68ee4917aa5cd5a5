"""Greatest errors of delays: a delay lies between instants that two machines told, each on its own clock.

The instants of the robot and of each person are kept apart, with the greatest error of each second. A delay can be as
wrong as its two ends together, of which one is the robot's and one the person's.
"""

from collections import OrderedDict
from collections.abc import Sequence
from math import isfinite

import msgspec

from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent, EventOutcome
from engage_hri.schemas.units import Seconds

KEPT: Seconds = 120.0
"""Time for which errors are remembered: longer than between the beginning of an event and its decision."""
PEOPLE_KEPT = 256


class ClockErrors:
    """Errors of the instants that are told of the robot and of people. robot: its actor id."""

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
