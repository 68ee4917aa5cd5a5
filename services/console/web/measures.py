"""Courses of what is measured: engagement and MTBCE of each person, delays of connection events. Pure."""

from collections import deque
from collections.abc import Collection, Mapping

from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.recognition import ConnectionEvent, Statistics
from engage_hri.schemas.units import Seconds
from engage_hri.services.console.web.lanes import Zero
from engage_hri.services.console.web.sections import Level, PersonMeasures

KEPT = 600
"""Values of a course that are kept."""
APART: Seconds = 0.5
"""Time of which a course keeps two values at most; the newest is always there."""
UNKNOWN: tuple[Level, tuple[str, ...]] = ("unknown", ("recognition has left the bus",))
"""Level of everybody, with the reason, while there is no recognition."""
Course = deque[tuple[Seconds, float]]


class Measures:
    """Courses of all that is measured, by person; an empty name stands for all people."""

    def __init__(self) -> None:
        self._people: dict[str, _Person] = {}
        self._delays: deque[tuple[Seconds, float, str]] = deque(maxlen=KEPT)
        self._life = ""
        """Life of recognition; empty: unknown."""
        self._left: dict[str, tuple[Level, tuple[str, ...]]] = {}
        """Levels and reasons that recognition told last, while it is not there."""

    @property
    def people(self) -> Collection[str]:
        """All who are measured."""
        return self._people.keys()

    def feed(self, message: Statistics | ConnectionEvent, at: Seconds) -> bool:
        """Take a message; at: its local instant. Returns whether it told of anything that is shown."""
        match message:
            case Statistics(actor=actor, session=session, engagement=engagement):
                person = self._people.setdefault(actor, _Person())
                person.level, person.reasons = message.level, message.reasons
                _add(person.engagement, at, engagement)
                _add(person.mtbce, at, session.mtbce)
                return True
            case ConnectionEvent(state="succeeded", delay=float() as delay, kind=kind):
                self._delays.append((at, delay, kind))
                return True
        return False

    def forget(self, person: str) -> None:
        """Drop somebody who has been gone for long."""
        self._people.pop(person, None)
        self._left.pop(person, None)

    def presence(self, message: PeerAlive | PeerGone) -> bool:
        """Take news of who is on the bus: without recognition nobody's engagement is known. Another life of it tells
        everything anew; the same one goes on with what it had told. Returns whether anything has changed.
        """
        match message:
            case PeerGone(participant="recognition"):
                before = {actor: (each.level, each.reasons) for actor, each in self._people.items()}
                self._left = before or self._left
                self._set(dict.fromkeys(self._people, UNKNOWN))
            case PeerAlive(participant="recognition", run=run):
                if run == self._life:
                    self._set(self._left)
                self._life, self._left = run, {}
            case _:
                return False
        return True

    def _set(self, told: Mapping[str, tuple[Level, tuple[str, ...]]]) -> None:
        for actor, (level, reasons) in told.items():
            self._people[actor].level, self._people[actor].reasons = level, reasons

    def shown(self, actor: str, zero: Zero) -> PersonMeasures:
        """The courses of a person, with their instants in seconds of the picture."""
        person = self._people[actor]
        return PersonMeasures(
            actor=actor,
            level=person.level,
            reasons=person.reasons,
            engagement=tuple((zero(at), value) for at, value in person.engagement),
            mtbce=tuple((zero(at), value) for at, value in person.mtbce),
        )

    def delays(self, zero: Zero) -> list[tuple[float, float, str]]:
        """Each delay, with the instant and the kind of its event."""
        return [(zero(at), delay, kind) for at, delay, kind in self._delays]


class _Person:
    def __init__(self) -> None:
        self.level: Level = "unknown"
        self.reasons: tuple[str, ...] = ()
        self.engagement: Course = deque(maxlen=KEPT)
        self.mtbce: Course = deque(maxlen=KEPT)


def _add(course: Course, at: Seconds, value: float | None) -> None:
    if value is None:
        return
    if len(course) > 1 and at - course[-2][0] < APART:
        course.pop()  # too near to the one before it: the newest counts
    course.append((at, value))
