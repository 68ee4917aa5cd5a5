"""Payloads of other programs: the message in any encoding, and the notice of one that cannot be read."""

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
