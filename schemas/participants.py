"""Participants of the bus, as they are seen and as they tell of themselves: presence, status, settings, and ledger.

Presence is made by each bus from liveliness, and never travels. The status is sent only when asked for. Settings are
told once in each life of a service, for recordings that are opened years later.

A ledger is what a service took, in the order in which it did, so that a recording can be played to it once more. What
a recorder hears, it hears in an order of its own: each process is heard in order, but two of them need not come to
two listeners in the same one. Streams may reach one and not the other, and what a driver tells its service is on no
bus. So each service tells itself what it took, and a fingerprint of what that led to.
"""

import json
import re
from collections.abc import Mapping
from typing import Annotated, Any

from msgspec import Meta, Struct

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds, Stamp

_CLAIM = re.compile(r"(?:.*[-.])?seat-[0-9a-f]{8}-.+")
"""Name of a participant that is only shown to claim something; with keys, that of its holder stands before it."""


def is_claim(participant: str) -> bool:
    """True if a participant only claims something, which is a seat. It answers and does nothing."""
    return _CLAIM.fullmatch(participant) is not None


class PeerAlive(Struct, frozen=True, kw_only=True, tag="peer_alive"):
    """A participant has come onto the bus.

    run: id of this life of the participant; after a restart it is another one. Empty: unknown.
    """

    participant: str
    run: str = ""


class PeerGone(Struct, frozen=True, kw_only=True, tag="peer_gone"):
    """A participant has left the bus."""

    participant: str


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


DEEPEST = 50
"""Tables and lists inside each other that are read."""


class SettingsFile(Struct, frozen=True, kw_only=True):
    """A file that settings name, as it was when its service began. name: as the settings have it."""

    name: str
    text: str


class ServiceSettings(Struct, frozen=True, kw_only=True, tag="service_settings", omit_defaults=True):
    """state: each service -> recorders: the configuration of this life, told as it begins to serve.

    run: id of its life, as in `PeerAlive`. version: of Engage. settings: a JSON object as text, with sections and
    keys as in a file of configuration, those at their defaults too, and of a driver all that it has; what is secret
    is `(hidden)`. A driver's number that is not finite is `Infinity`, `-Infinity` or `NaN` there. files: those that
    the settings name.
    """

    participant: str
    run: str
    version: str
    at: Stamp
    settings: str
    files: tuple[SettingsFile, ...] = ()


def text_of(sections: Mapping[str, Any]) -> str:
    """Sections as `ServiceSettings.settings` has them."""
    return json.dumps(sections, ensure_ascii=False)


def sections(text: str) -> dict[str, Any]:
    """Read `ServiceSettings.settings`. Raises InputRefused: it is no JSON object, or cannot be shown."""
    try:
        found = json.loads(text)
        if not isinstance(found, dict):
            raise InputRefused(Fault(reason="settings are a JSON object"))
        if not _is_within(found, DEEPEST):
            raise InputRefused(Fault(reason=f"settings with more than {DEEPEST} tables and lists inside each other"))
        text_of(found).encode()
    except UnicodeEncodeError as error:
        raise InputRefused(Fault(reason="half a character in the settings")) from error
    except (ValueError, RecursionError) as error:
        raise InputRefused(Fault(reason=f"settings are not JSON: {error}")) from error
    return found


def _is_within(value: object, levels: int) -> bool:
    """True if so many tables and lists, or fewer, stand inside each other."""
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else None
    return inner is None or (levels > 0 and all(_is_within(one, levels - 1) for one in inner))


class ReadClock(Struct, frozen=True, array_like=True):
    """A clock of another machine as a step read it: the own one is at `its instant + offset`.

    offset: None: nothing is known of the clock; then all its instants read as now. error: None: without bound.
    """

    clock: str
    offset: Seconds | None
    error: Seconds | None


class Step(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A step of a service: it took an input, or did what was due.

    now: on the clock of the service. life, number: of the message that it took, on any key of the classes `evt` and
    `state`; it is not repeated here. key, source, content: of any other input, whole: a message, where a request has
    the name that the service knows it by as its id; or, without a key, what came by no bus, as `intake.py` of the
    service says. at: local time of arrival, if it is not `now`. clocks: those that were read. led_to: fingerprint of
    all that followed; empty: nothing. is_same_turn: no task of the service ran between the step before and this one.
    """

    now: Seconds
    life: str = ""
    number: Annotated[int, Meta(ge=0)] = 0
    key: str = ""
    source: str = ""
    content: Any = None
    at: Seconds | None = None
    past: bool = False
    clocks: tuple[ReadClock, ...] = ()
    led_to: str = ""
    is_same_turn: bool = False


class Taken(Struct, frozen=True, kw_only=True, tag="taken", omit_defaults=True):
    """evt: a service -> recorders: steps, in order; only while somebody listens. They come before what they led to.

    session: the life of the service, as in the ids of its events. first: number of the first step in that life, from
    1; steps before were not told. Its configuration is in its `ServiceSettings`.
    """

    service: str
    session: str
    at: Stamp
    first: Annotated[int, Meta(ge=1)]
    steps: tuple[Step, ...]
