"""Facts about a robot's bus and this machine, as `engage doctor` gathers them. Pure data."""

from typing import Literal

from msgspec import Struct

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
