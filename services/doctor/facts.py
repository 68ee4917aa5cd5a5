"""Facts about a robot's bus and this machine, as `engage doctor` gathers them, and who sees whom by them. Pure."""

from collections.abc import Iterator
from typing import Literal

from msgspec import Struct

from engage_hri.schemas import access, keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.keys import Part
from engage_hri.schemas.participants import ClockOffset, ProcessFacts, Status
from engage_hri.schemas.units import Seconds


class EndpointFacts(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """An endpoint at which the bus should be found, and whether somebody opens there.

    problem: why nobody does; empty: somebody does. is_local: only processes of this machine can reach it. is_closed:
    it is encrypted. until: end of the certificate that is shown there, in seconds since 1970.
    """

    endpoint: str
    problem: str = ""
    is_local: bool = True
    is_closed: bool = False
    until: int | None = None


class Certificate(Struct, frozen=True, kw_only=True):
    """A certificate in the folder of keys. until: its end, in seconds since 1970."""

    name: str
    until: int


class ParticipantFacts(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A participant on the bus.

    part: as it shows itself. seen: it is seen from here. lives: number of processes that have its name. answers:
    whether it should answer questions for its status. status: its answer; None: none came in time. later: a second
    answer, a second later. trip: the quickest round trip from here to its process. wall: by how much its machine's
    wall clock is ahead of the one here.
    """

    name: str
    part: Part = "robot"
    seen: bool = True
    lives: int = 1
    answers: bool = True
    status: Status | None = None
    later: Status | None = None
    trip: Seconds | None = None
    wall: Seconds = 0.0


class BodyFacts(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The robot's body. types: the types of behaviors that it performs. problem: why nothing is known of it."""

    name: str = ""
    types: tuple[str, ...] = ()
    problem: str = ""


class WorldFacts(Struct, frozen=True, kw_only=True):
    """The world as perception tells it. age: time since then."""

    source: str
    people: int
    objects: int
    age: Seconds


class SystemFacts(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Facts, as they were seen from this process.

    at: wall clock, in seconds since 1970. version: of Engage. own: this process. found: robots on the bus other than
    this one. protocols: versions of the protocol that are spoken there. clocks: those of other machines. bus: whether
    the bus could be opened. sight: `unknown` if these keys do not let us look.
    """

    robot: str
    at: float
    version: str
    protocol: str
    own: ProcessFacts
    services: tuple[str, ...]
    """Services that make up a robot."""
    doors: tuple[EndpointFacts, ...] = ()
    bus: bool = True
    problem: Fault | None = None
    """Reason why keys or bus cannot be used."""
    found: tuple[str, ...] = ()
    protocols: tuple[str, ...] = ()
    certificates: tuple[Certificate, ...] = ()
    known: tuple[ParticipantFacts, ...] = ()
    clocks: tuple[ClockOffset, ...] = ()
    body: BodyFacts | None = None
    sight: WorldFacts | Literal["unknown"] | None = None


HERE = "here"
"""Name of the row of this process."""
Sees = Literal["itself", "yes", "no", "needless", "unknown"]
"""needless: it does not see it, and has no need to."""


class Cell(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Tells whether `viewer` sees `other`. trip: the quickest round trip between their processes or machines."""

    viewer: str
    other: str
    sees: Sees
    trip: Seconds | None = None


def matrix(facts: SystemFacts) -> tuple[Cell, ...]:
    """Cells of the matrix, row by row: first this process, then all that answer for themselves."""
    return tuple(_cells(facts))


def _cells(facts: SystemFacts) -> Iterator[Cell]:
    for other in facts.known:
        yield Cell(viewer=HERE, other=other.name, sees="yes" if other.seen else "no", trip=other.trip)
    for viewer in facts.known:
        if not viewer.answers:
            continue
        for other in facts.known:
            sees: Sees
            trip = None
            if viewer.name == other.name:
                sees = "itself"
            elif viewer.status is None:
                sees = "unknown"
            else:
                hidden: Sees = "no" if _needs(viewer.name, other.part) else "needless"
                sees = "yes" if other.name in viewer.status.bus.peers else hidden
                if sees == "yes" and (clock := clock_of(viewer.status, other.status)) is not None:
                    trip = clock.trip
            yield Cell(viewer=viewer.name, other=other.name, sees=sees, trip=trip)


def _needs(viewer: str, part: keys.Part) -> bool:
    """True if one has to see participants of this part: everybody sees the robot, and services see their clients."""
    heard = access.rows(access.role_of(viewer), "subscribes")
    return part == "robot" or keys.alive("*", part) in heard


def clock_of(viewer: Status, other: Status | None) -> ClockOffset | None:
    """Measurement that one has of the other's clock; None: it has the same clock, or has not measured it."""
    if other is None:
        return None
    return next((each for each in viewer.bus.clocks if each.clock == other.at.clock), None)
