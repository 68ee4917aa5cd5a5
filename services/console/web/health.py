"""Health of each participant of the bus: whether it is there, what it says of itself, what is wrong. Pure."""

from engage_hri.schemas import keys
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.participants import PeerAlive, PeerGone, ServiceSettings, Status, is_claim, sections
from engage_hri.schemas.units import Seconds
from engage_hri.services.console.web.sections import Health

STOOD: Seconds = 0.25
"""Time that messages waited for a process from which on it is told."""
NOTABLE: tuple[str, ...] = (*keys.SERVICES, "simulation", "collaboration")
"""Participants that answer for their status."""


class HealthBoard:
    """The four services of a robot, there or not, and everybody else who is there. Mere claims are left out."""

    def __init__(self) -> None:
        self._here: dict[str, bool] = dict.fromkeys(keys.SERVICES, False)
        self._status: dict[str, Status] = {}
        self._silent: frozenset[str] = frozenset()

    def feed(self, message: PeerAlive | PeerGone | Status) -> None:
        """Take what is told of a participant."""
        match message:
            case PeerAlive(participant=name):
                if not is_claim(name):
                    self._here[name] = True
            case PeerGone(participant=name):
                self._status.pop(name, None)
                if name in keys.SERVICES:
                    self._here[name] = False
                else:
                    self._here.pop(name, None)
            case Status(participant=name):
                self._status[name] = message

    def has(self, name: str) -> bool:
        """Tell whether a participant is on the bus."""
        return self._here.get(name, False)

    def silence(self, names: frozenset[str]) -> bool:
        """Take the names of those who did not answer. Returns whether they are others than before."""
        before, self._silent = self._silent, names
        return before != names

    def shown(self) -> tuple[Health, ...]:
        """The services first, then all others by name."""
        return tuple(self._health(name) for name in sorted(self._here, key=lambda name: (_place(name), name)))

    def _health(self, name: str) -> Health:
        status, here = self._status.get(name), self._here[name]
        warnings = []
        if not here:
            warnings.append("not on the bus")
        elif name in self._silent:
            warnings.append("does not answer")
        if status is not None and here:
            warnings += _warnings(status)
        return Health(
            name=name, service=name in keys.SERVICES, here=here,
            serves=here and (status is None or status.stands is not None),
            warnings=tuple(warnings), facts=tuple(_facts(status)) if status is not None and here else (),
        )  # fmt: skip


def recognizes(told: ServiceSettings) -> bool:
    """Tell whether these settings of hearing name who understands words. What nobody can read names nobody."""
    try:
        return bool(sections(told.settings)["hearing"]["recognizer"])
    except (InputRefused, LookupError, TypeError):
        return False


def _place(name: str) -> int:
    return NOTABLE.index(name) if name in NOTABLE else len(NOTABLE)


def _warnings(status: Status) -> list[str]:
    bus = status.bus
    counted = (
        (bus.failures, "bug", "bugs"), (bus.refused, "unreadable message", "unreadable messages"),
        (bus.overflowed, "message dropped from a full queue", "messages dropped from full queues"),
        (bus.lost, "message lost", "messages lost"),
    )  # fmt: skip
    found = [f"{number} {one if number == 1 else many}" for number, one, many in counted if number]
    if status.stands is None:
        found.append("does not serve yet")
    return found


def _facts(status: Status) -> list[str]:
    up = status.at.seconds - status.joined.seconds
    facts = [f"up {up:.0f} s", f"{status.bus.passed} messages received"]
    if status.bus.lag >= STOOD:
        facts.append(f"once stood still for {status.bus.lag:.2f} s")
    if status.process.host:
        facts.append(f"on {status.process.host}")
    if status.process.loop:
        facts.append(f"Python {status.process.python}, {status.process.loop}")
    return facts
