"""Form of a recording: of the messages in it, and of what the recorder writes of its own. Pure.

A message is kept as JSON where that gives back the very bytes that came, else as those bytes.

Viewers of MCAP files understand JSON. MessagePack turns into JSON and back without a change, as long as its writer
uses the shortest forms, and no number in it is infinite. This is tried for each message. Ours has a longer form for
structs of many fields: those come back through their type.
"""

from typing import Any, NamedTuple

import msgspec
from msgspec import Struct

from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.messages import decode, encode
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.samples import Sample

JSON, MSGPACK, XML, BYTES = "json", "msgpack", "xml", ""
"""Encodings of the messages of a channel, by the names that MCAP has for them."""
_BAD = (msgspec.MsgspecError, InputRefused, UnicodeError, RecursionError, OverflowError, TypeError)


class StoredForm(NamedTuple):
    """A payload as it is kept. encoding: one of those above. is_typed: it comes back through the message's type."""

    encoding: str
    data: bytes
    is_typed: bool = False


def kept(sample: Sample) -> StoredForm:
    """Choose the form in which a message is kept."""
    payload = sample.payload
    match sample.encoding.partition(";")[0]:
        case "application/msgpack":
            try:
                text = msgspec.json.encode(msgspec.msgpack.decode(payload))
            except _BAD:
                return StoredForm(BYTES, payload)
            for is_typed in (False, True):
                try:
                    if _packed(text, is_typed=is_typed) == payload:
                        return StoredForm(JSON, text, is_typed)
                except _BAD:
                    pass
            return StoredForm(MSGPACK, payload)
        case "application/json":
            return StoredForm(JSON if _is_json(payload) else BYTES, payload)
        case "application/xml" | "text/xml":
            return StoredForm(XML, payload)
    return StoredForm(BYTES, payload)


def payload(form: StoredForm, encoding: str) -> bytes:
    """Give back the bytes that came. encoding: that of the sample.

    What no recorder wrote, and cannot be turned back, is given as it stands: no reader takes it for a message.
    """
    is_packed = form.encoding == JSON and encoding.partition(";")[0] == "application/msgpack"
    try:
        return _packed(form.data, is_typed=form.is_typed) if is_packed else form.data
    except _BAD:
        return form.data


def _packed(text: bytes, *, is_typed: bool) -> bytes:
    return encode(decode(text, "application/json")) if is_typed else msgspec.msgpack.encode(msgspec.json.decode(text))


def _is_json(data: bytes) -> bool:
    try:
        msgspec.json.decode(data, type=Any)
    except _BAD:
        return False
    return True


CHUNK, CLOCK, LOST, MORE = "recording/chunk", "recording/clock", "recording/lost", "recording/more"
"""Topics of the recorder's own: the mark at the beginning of each chunk, offsets of clocks, messages that were lost,
and all for which no channel is left."""


class ChunkMark(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Mark at the beginning of a chunk, under the chunk's checksum: so none is told twice, moved, or of another file.

    number: of the chunk in its recording, from 0. of: `wall` of the recording. facts: those of the recording, in
    chunk 0.
    """

    number: int
    of: str
    facts: dict[str, str] = {}


class Offset(Struct, frozen=True, kw_only=True):
    """Offset of another clock to the recorder's, and its error."""

    offset: Seconds
    error: Seconds


class MissingMessages(Struct, frozen=True, kw_only=True):
    """Messages that are missing in a recording, up to now.

    dropped: streams, and in a flood others, before they were taken. overflowed: by a full queue. lost: by a cut, and
    nobody had them any more. disk: found no room on the disk. still: seconds for which the recorder stood still, as a
    computer that sleeps: streams of that time, such as motion, are missing, and nobody can count them.
    """

    dropped: int = 0
    overflowed: int = 0
    lost: int = 0
    disk: int = 0
    still: Seconds = 0.0

    @property
    def total(self) -> int:
        return self.dropped + self.overflowed + self.lost + self.disk


OWN: dict[str, Any] = {CHUNK: ChunkMark, CLOCK: dict[str, Offset], LOST: MissingMessages}
"""Type of what is JSON under each topic."""
