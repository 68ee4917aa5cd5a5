"""Messages as they come to a reader: decoded (`Received`), as they travel (`Sample`), and those nobody can read.

Other programs send what they like, as often as they like. What cannot be read is refused: its server gets a notice,
for somebody may wait for an answer (`unreadable`). And it is told, but not each time: a flood of it would else be
answered with a flood of faults (`Often`). Pure: time is an argument.
"""

from collections import Counter
from typing import TypeVar

import msgspec
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.access import LARGEST_XML_SENT, check_size
from engage_hri.schemas.blocks import Block, PerformBlock
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.documents.xml_source import id_of
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.fragments import PerformFragment
from engage_hri.schemas.messages import Message, decode
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.requests import Unreadable
from engage_hri.schemas.units import Seconds


class Received(Struct, frozen=True):
    """A message as it arrived. source: the participant that published it. at: local time of arrival.

    life: of the process or connection that it came from, where that is known. past: the message is from before the
    subscription, given to a late subscriber as the class of its key says. number: of the message among the ordered
    ones of its life; 0 on a stream, and of a program without envelopes.
    """

    key: str
    message: Message
    source: str
    at: Seconds
    past: bool = False
    life: str = ""
    number: int = 0


class Sample(Struct, frozen=True):
    """A message as it travels, undecoded. source, at, life, past, number: as of `Received`.

    sent: when it was sent, on the clock `clock` of its sender; empty, and 0, of a program without envelopes.
    """

    key: str
    payload: bytes
    encoding: str
    source: str
    at: Seconds
    past: bool = False
    life: str = ""
    number: int = 0
    clock: str = ""
    sent: Seconds = 0.0


def sender_of(item: Received | Sample) -> str:
    """Name of its sender, as far as it is known: its process, and the requester in its key."""
    return f"{item.life} {keys.requester_of(item.key)}"


LOCAL = (PeerAlive, PeerGone, Unreadable)
"""Messages that no payload may hold: with them a program could end the requests of others."""


def read_payload(payload: bytes, encoding: str, key: str, source: str) -> Message:
    """Decode the message that another program sent, in any encoding. Raises InputRefused.

    XML holds a block or a fragment; it becomes a request with the same id. It may have `LARGEST_XML_SENT` bytes.
    """
    if encoding.partition(";")[0] not in ("application/xml", "text/xml"):
        check_size(key, payload, encoding)
        message = decode(payload, encoding)
        if isinstance(message, LOCAL):
            reason = f"{type(message).__name__} is what each bus makes for its own subscribers; it is never sent"
            raise InputRefused(Fault(reason=reason))
        return message
    if len(payload) > LARGEST_XML_SENT:
        reason = f"{len(payload)} bytes of XML; at most {LARGEST_XML_SENT} are read on the bus"
        advice = "split it into several, or send it as JSON or MessagePack, as `engage play` and the client do"
        raise InputRefused(Fault(reason=reason, where=key, advice=advice), id_of(payload))
    thing = decode_xml(payload, key)
    requester = keys.requester_of(key) or source
    if isinstance(thing, Block):
        return PerformBlock(id=thing.id, requester=requester, block=thing)
    return PerformFragment(id=thing.id, requester=requester, fragment=thing)


_Part = TypeVar("_Part", bound=Struct)


class _Head(Struct):
    """The fields of a request that its answer needs."""

    id: str = ""
    life: str = ""
    type: str = ""


class _Named(Struct, frozen=True):
    id: str = ""


class _Content(Struct):
    """The block or fragment of a request, as far as its id."""

    block: _Named = _Named()
    fragment: _Named = _Named()


def unreadable(error: EngageError, key: str, payload: bytes = b"", encoding: str = "") -> Unreadable | None:
    """Notice of a bad payload for the server of `key`, which owes an answer; None on keys that have no server."""
    if keys.key_class(key) != "cmd":
        return None
    head = _read(payload, encoding, _Head)
    content = _read(payload, encoding, _Content)
    known = getattr(error, "block", None)
    block = known or content.block.id or content.fragment.id
    return Unreadable(id=known or head.id, block=block, life=head.life, kind=head.type, fault=error.fault)


def _read(payload: bytes, encoding: str, kind: type[_Part]) -> _Part:
    """Read some fields of a payload; those of none that can be read."""
    codec = msgspec.json if encoding.startswith("application/json") else msgspec.msgpack
    try:
        read: _Part = codec.decode(payload, type=kind)
        return read
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return kind()


CALM: Seconds = 2.0
"""Time without a refusal of a kind after which the next one counts as the first."""
KINDS = 16
"""Kinds of refusals of one sender that are counted apart; all further ones of it are one kind."""
MOST = 256
"""Kinds of all senders together that are counted apart; all further ones are one kind."""


def is_told(times: int) -> bool:
    """True for the first, the tenth, the hundredth ... time: what comes again and again is told so often."""
    return str(times).rstrip("0") == "1"


class Often:
    """Counts refusals of each sender and kind, and says which to tell: the first, the tenth, the hundredth ...

    A flood of messages that nobody can read is so not answered with a flood of faults.
    """

    def __init__(self, calm: Seconds = CALM) -> None:
        """calm: time without a refusal of a kind after which the next one counts as the first."""
        self._calm = calm
        self._counts: dict[tuple[str, str], tuple[int, Seconds]] = {}
        """Number and time of the last refusal, the one longest ago first."""
        self._kinds: Counter[str] = Counter()

    def __len__(self) -> int:
        return len(self._counts)

    def tell(self, sender: str, kind: str, now: Seconds) -> int:
        """Count a refusal. Returns how many there have been if that is to be told, else 0."""
        self._forget(now)
        if (sender, kind) not in self._counts and self._kinds[sender] >= KINDS:
            kind = ""
        if (sender, kind) not in self._counts and len(self._counts) >= MOST:
            sender = kind = ""
        known = self._counts.pop((sender, kind), None)
        self._kinds[sender] += known is None
        times = 1 if known is None else known[0] + 1
        self._counts[sender, kind] = times, now
        return times if is_told(times) else 0

    def _forget(self, now: Seconds) -> None:
        while self._counts:
            (sender, kind), (_, last) = next(iter(self._counts.items()))
            if now - last < self._calm:
                break
            del self._counts[sender, kind]
            self._kinds[sender] -= 1
            if not self._kinds[sender]:
                del self._kinds[sender]
