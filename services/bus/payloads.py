"""Payloads of other programs: the message in any encoding, and the notice of one that cannot be read."""

import msgspec
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, PerformBlock
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.fragments import PerformFragment
from engage_hri.schemas.messages import Message, decode
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.schemas.requests import Unreadable

LOCAL = (PeerAlive, PeerGone, Unreadable)
"""Messages that no payload may hold: with them a program could end the requests of others."""


def read_payload(payload: bytes, encoding: str, key: str, source: str) -> Message:
    """Decode the message that another program sent, in any encoding. Raises InputRefused.

    XML holds a block or a fragment; it becomes a request with the same id.
    """
    if encoding.partition(";")[0] not in ("application/xml", "text/xml"):
        message = decode(payload, encoding)
        if isinstance(message, LOCAL):
            reason = f"{type(message).__name__} is what each bus makes for its own subscribers; it is never sent"
            raise InputRefused(Fault(reason=reason))
        return message
    thing = decode_xml(payload, key)
    requester = keys.requester_of(key) or source
    if isinstance(thing, Block):
        return PerformBlock(id=thing.id, requester=requester, block=thing)
    return PerformFragment(id=thing.id, requester=requester, fragment=thing)


class _Head(Struct):
    """The fields of a request that its answer needs."""

    id: str = ""
    life: str = ""
    type: str = ""


def unreadable(error: EngageError, key: str, payload: bytes = b"", encoding: str = "") -> Unreadable | None:
    """Notice of a bad payload for the server of `key`, which owes an answer; None on keys that have no server."""
    if keys.key_class(key) != "cmd":
        return None
    codec = msgspec.json if encoding.startswith("application/json") else msgspec.msgpack
    try:
        head = codec.decode(payload, type=_Head)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        head = _Head()
    id = getattr(error, "block", None) or head.id
    return Unreadable(id=id, life=head.life, kind=head.type, fault=error.fault)
