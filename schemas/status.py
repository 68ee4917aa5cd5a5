"""Status of a participant and of its connection to the bus: sent only when asked for."""

from msgspec import Struct

from engage_hri.schemas.units import Seconds, Stamp


class AskStatus(Struct, frozen=True, kw_only=True, tag="ask_status"):
    """rpc: anyone asks any participant. Answered with `Status`; a query without payload means this, too."""


class Reachable(Struct, frozen=True, array_like=True):
    """A participant, and the endpoints at which others may connect to its process."""

    participant: str
    endpoints: tuple[str, ...]


class ClockOffset(Struct, frozen=True, kw_only=True):
    """The clock of another machine, as measured by round trips: the own clock is at `its instant + offset`.

    error: greatest error of the offset. trip: the quickest of the last round trips.
    """

    clock: str
    offset: Seconds
    error: Seconds
    trip: Seconds


class BusHealth(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Counts since the process opened the bus. The last four are of the participant, the others of its process."""

    peers: tuple[str, ...] = ()
    """Names of all participants on the bus, this one included."""
    reachable: tuple[Reachable, ...] = ()
    """Where others may connect to the processes of participants. Clients are not among them."""
    clocks: tuple[ClockOffset, ...] = ()
    """Clocks of other machines."""
    passed: int = 0
    """Messages, tokens and replies that have come in."""
    dropped: int = 0
    """Messages dropped before the loop got to them: of streams, and in a flood of others."""
    waiting: int = 0
    """Messages that wait for the loop now."""
    depth: int = 0
    """Greatest number of messages that ever waited."""
    lag: Seconds = 0.0
    """Longest time that a message waited for the loop."""
    refused: int = 0
    """Payloads that could not be read."""
    overflowed: int = 0
    """Messages dropped from this participant's full queues."""
    gaps: int = 0
    """Times that one of its subscriptions missed messages and asked for them."""
    lost: int = 0
    """Missed messages that could not be had any more."""
    failures: int = 0
    """Bugs of Engage that came up here: each was published as a fault, and stands in the log."""


class ProcessFacts(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A process: its machine, what it runs on, and how it came to the bus."""

    host: str = ""
    """Name of its machine."""
    python: str = ""
    """Version of Python."""
    loop: str = ""
    """Package that its event loop is from: asyncio or uvloop."""
    wall: float = 0.0
    """Its machine's wall clock when it was asked, in seconds since 1970."""
    zenoh: str = ""
    """Version of Zenoh; empty on a bus in memory."""
    mode: str = ""
    """peer or client."""
    connect: tuple[str, ...] = ()
    """Endpoints that it connects to."""
    holder: str = ""
    """Common name of its certificate; empty: its links are open."""
    until: int | None = None
    """End of that certificate, in seconds since 1970."""


class Status(Struct, frozen=True, kw_only=True, tag="status", omit_defaults=True):
    """Present state of one participant."""

    participant: str
    run: str
    """Id of its life, as in `PeerAlive`."""
    version: str
    """Version of Engage."""
    at: Stamp
    joined: Stamp
    """Instant at which it came onto the bus."""
    stands: Stamp | None = None
    """Instant from which it serves; absent: it does not serve yet."""
    bus: BusHealth = BusHealth()
    process: ProcessFacts = ProcessFacts()
