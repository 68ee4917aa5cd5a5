"""How a participant and its connection to the bus are doing: asked for, never sent by itself."""

from msgspec import Struct

from engage_hri.schemas.units import Seconds, Stamp


class AskStatus(Struct, frozen=True, kw_only=True, tag="ask_status"):
    """rpc: anyone asks any participant. Answered with `Status`; a query without payload means this, too."""


class BusHealth(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Counts since the process opened the bus. The last four are the participant's own, all others its process'."""

    peers: tuple[str, ...] = ()
    """Names of the participants that are there, this one included."""
    passed: int = 0
    """Messages, tokens and replies that have come in."""
    dropped: int = 0
    """Stream messages, and in a flood others, that were dropped before the loop got to them."""
    waiting: int = 0
    """How many wait for the loop now."""
    depth: int = 0
    """The most that ever waited."""
    lag: Seconds = 0.0
    """The longest that anything waited for the loop."""
    refused: int = 0
    """Payloads that were none."""
    overflowed: int = 0
    """Messages dropped from this participant's full queues."""
    gaps: int = 0
    """How often one of its subscriptions missed something, and asked for it."""
    lost: int = 0
    """Messages that were gone for good by then."""
    failures: int = 0
    """How often something went wrong here that no message should be able to cause: each a fault, and in the log."""


class Status(Struct, frozen=True, kw_only=True, tag="status", omit_defaults=True):
    """Of one participant, now."""

    participant: str
    run: str
    """Which life of it this is, as in `PeerAlive`."""
    version: str
    """Of Engage."""
    at: Stamp
    joined: Stamp
    """When it came onto the bus."""
    stands: Stamp | None = None
    """Since when it serves; absent: not yet."""
    bus: BusHealth = BusHealth()
