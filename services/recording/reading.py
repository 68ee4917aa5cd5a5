"""Reader of recordings, whole ones and those whose writer was killed. Pure: bytes in, messages out.

A file is read from its beginning, record by record. Where one is cut off, or holds what no recorder writes, the
recording ends: everything before is there, and `lost_bytes` says how much was not. Needs the extra `record`.
"""

import struct
from array import array
from bisect import bisect_left, bisect_right
from collections import Counter, OrderedDict
from io import BytesIO
from math import isfinite
from typing import Any

import msgspec
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, Message, MessageIndex, Metadata, MetadataIndex, Schema
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message as BusMessage
from engage_hri.schemas.messages import decode
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.payloads import read_payload
from engage_hri.services.bus.samples import Received, Sample
from engage_hri.services.recording.form import Form, payload
from engage_hri.services.recording.losses import LOST, MORE, Losses
from engage_hri.services.recording.writing import PROFILE, Contents

_HEAD = struct.Struct("<BQ")
_BAD = (McapError, struct.error, ValueError, OverflowError, UnicodeDecodeError, zstandard.ZstdError)
_OURS = (Opcode.HEADER, Opcode.CHUNK, Opcode.METADATA)
"""Records that may stand before the end of the data, besides indexes."""
_DATA_END, _INDEX = 4, 2 + 4
"""Lengths of the end of the data, and of an index of no messages."""
_ZSTD = b"\x04\0\0\0zstd"
"""Name of the compression in the head of each of our chunks, and its place behind the chunk's beginning."""
_ZSTD_AT = _HEAD.size + 8 + 8 + 8 + 4
LARGEST_CHUNK = 64 * 1024 * 1024
"""Bytes of a chunk's content. Ours have one MiB, and one message more."""
CHUNKS_KEPT = 16
"""Number of chunks that are kept decompressed."""
BILLION = 1_000_000_000


class Damaged(Struct, frozen=True):
    """A chunk in the middle that cannot be read, as after a fault of the disk. offset: where it begins."""

    offset: int
    reason: str


class Recording:
    """A recording. Its messages are numbered from 0, in the order in which they came to the recorder.

    facts: what the recorder wrote of itself at the beginning (docs/recordings.md). notes: what it wrote later, by
    name. is_whole: its recorder ended in order. lost_bytes: bytes at the end that are no whole record.
    """

    def __init__(self, data: bytes, name: str = "recording") -> None:
        """data: the file; it may be a memory map. Raises InputRefused: it is none of ours, or nothing is in it."""
        self.name = name
        self.facts: dict[str, str] = {}
        self.notes: dict[str, dict[str, str]] = {}
        self.is_whole = False
        self.lost_bytes = 0
        self.damaged: list[Damaged] = []
        self._data = data
        self._channels: dict[int, Channel] = {}
        self._contents = Contents([], [], [], [], Counter())
        self._chunks: list[tuple[int, int]] = []
        """Begin and end of each chunk's content in the file."""
        self._indexed: ChunkIndex | None = None
        """The chunk to which the indexes belong that come next."""
        self._is_over = False
        """The end of the data has been read: what comes repeats it."""
        self._open: OrderedDict[int, bytes] = OrderedDict()
        self._times = array("q")
        self._of_channel = array("H")
        self._of_chunk = array("I")
        self._places = array("I")
        self.end = self._read()
        """Bytes of the file up to where it may go on."""
        if not self.facts:
            reason = "nothing in it can be read" if not self._channels else "it is a recording of another program"
            raise InputRefused(Fault(reason=reason, where=name, advice="`engage record` makes recordings"))
        try:
            is_readable = isfinite(self.began) and self.wall >= 0
        except ValueError:
            is_readable = False
        if not is_readable:
            raise InputRefused(Fault(reason="what it says of its beginning is damaged", where=name))
        self._leave_out_unknown()

    # -- what it says of itself ---------------------------------------------------------------------------------

    @property
    def robot(self) -> str:
        return self.facts.get("robot", "robot")

    @property
    def clock(self) -> str:
        """Clock of the recorder, on which `Sample.at` is."""
        return self.facts.get("clock", "")

    @property
    def began(self) -> Seconds:
        """Beginning of the recording, on that clock."""
        return float(self.facts.get("began", 0.0))

    @property
    def wall(self) -> int:
        """Beginning of the recording, nanoseconds since 1970."""
        return int(self.facts.get("wall", 0))

    @property
    def duration(self) -> Seconds:
        """Time of the last message."""
        return self.time(len(self) - 1) if len(self) else 0.0

    @property
    def contents(self) -> Contents:
        """Everything that the end of the file tells of, or would have to."""
        return self._contents

    # -- messages -----------------------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self._times)

    def time(self, number: int) -> Seconds:
        """Time at which a message came, from the beginning of the recording."""
        return (self._times[number] - self.wall) / BILLION

    def key(self, number: int) -> str:
        """Key of a message, relative to the robot; empty for the recorder's own."""
        channel = self._channels[self._of_channel[number]]
        return self.sample(number).key if channel.topic == MORE else str(channel.metadata.get("key", ""))

    def life(self, number: int) -> str:
        """Life that a message came from."""
        return str(self._channels[self._of_channel[number]].metadata.get("life", ""))

    def number(self, number: int) -> int:
        """Number of a message in its life, modulo 2 ** 32; 0: it has none."""
        return self._message(number).sequence

    def sample(self, number: int) -> Sample:
        """Return a message as it came, to the byte. at: on the clock of the recorder."""
        channel, message = self._channels[self._of_channel[number]], self._message(number)
        if channel.topic == MORE:
            return msgspec.msgpack.decode(message.data, type=Sample)
        told = channel.metadata
        encoding, clock = told.get("encoding", ""), told.get("clock", "")
        form = Form(channel.message_encoding, message.data, told.get("typed") == "true")
        return Sample(
            key=told.get("key", ""), payload=payload(form, encoding),
            encoding=encoding, source=told.get("sender", ""), at=self.began + self.time(number),
            past=told.get("past") == "true", life=told.get("life", ""), number=message.sequence, clock=clock,
            sent=self.began + (message.publish_time - self.wall) / BILLION if clock else 0.0,
        )  # fmt: skip

    def received(self, number: int) -> Received | None:
        """Return a message, decoded; None if nobody can read it."""
        return received(self.sample(number))

    def own(self, topic: str) -> list[tuple[Seconds, dict[str, Any]]]:
        """Return what the recorder itself has said under this topic, with the times."""
        channels = {id for id, channel in self._channels.items() if channel.topic == topic}
        numbers = (number for number, channel in enumerate(self._of_channel) if channel in channels)
        return [(self.time(number), msgspec.json.decode(self._message(number).data)) for number in numbers]

    @property
    def losses(self) -> Losses:
        """Messages that are known to be missing."""
        told = self.own(LOST)
        return msgspec.convert(told[-1][1], Losses) if told else Losses()

    def indexes(self, chunk: int) -> list[MessageIndex]:
        """Make the indexes of a chunk anew, one for each of its channels. chunk: its number."""
        found: dict[int, MessageIndex] = {}
        for number in range(bisect_left(self._of_chunk, chunk), bisect_right(self._of_chunk, chunk)):
            channel = self._of_channel[number]
            index = found.setdefault(channel, MessageIndex(channel_id=channel, records=[]))
            index.records.append((self._times[number], self._places[number]))
        return list(found.values())

    def _message(self, number: int) -> Message:
        chunk, place = self._of_chunk[number], self._places[number]
        content = self._content(chunk)
        _, length = _HEAD.unpack_from(content, place)
        begin = place + _HEAD.size
        message: Message = Message.read(ReadDataStream(BytesIO(content[begin : begin + length])), length)
        return message

    def _content(self, chunk: int) -> bytes:
        if chunk in self._open:
            self._open.move_to_end(chunk)
        else:
            begin, end = self._chunks[chunk]
            self._open[chunk] = _plain(_chunk(self._data[begin:end]))
            if len(self._open) > CHUNKS_KEPT:
                self._open.popitem(last=False)
        return self._open[chunk]

    # -- reading ------------------------------------------------------------------------------------------------

    def _read(self) -> int:
        """Read all records. Returns where the last of those in the middle ends."""
        data, size = self._data, len(self._data)
        if bytes(data[: len(MCAP0_MAGIC)]) != MCAP0_MAGIC:
            raise InputRefused(Fault(reason="this is no MCAP file", where=self.name))
        at = good = len(MCAP0_MAGIC)
        while at + _HEAD.size <= size:
            opcode, length = _HEAD.unpack_from(data, at)
            begin, end = at + _HEAD.size, at + _HEAD.size + length
            if end > size or not self._may_be(opcode, length, end):
                if (found := self._next_chunk(at)) is None:
                    break
                self._damage(at, "no record is here")
                at = found
                continue
            if opcode == Opcode.FOOTER:
                self.is_whole = True
                return good
            self._is_over |= opcode == Opcode.DATA_END
            try:
                self._take(opcode, data[begin:end], at, begin, end)
            except _BAD as error:
                found = self._next_chunk(at)
                if found is None and opcode != Opcode.CHUNK:
                    break
                self._damage(at, f"{type(error).__name__}: {error}")
                at = end if found is None else found
                continue
            at = end
            if opcode in (Opcode.HEADER, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.METADATA):
                good = at
        self.lost_bytes = size - good
        return good

    def _may_be(self, opcode: int, length: int, end: int) -> bool:
        """Tell whether a record of this kind and length can stand here. Where a length is damaged none can."""
        match opcode:
            case Opcode.FOOTER:
                return bytes(self._data[end:]) == MCAP0_MAGIC
            case Opcode.DATA_END:
                return length == _DATA_END
            case Opcode.MESSAGE_INDEX:
                told = int.from_bytes(self._data[end - length + 2 : end - length + _INDEX], "little")
                return not self._is_over and told == length - _INDEX
        return 0 < opcode < Opcode.DATA_END if self._is_over else opcode in _OURS

    def _damage(self, at: int, reason: str) -> None:
        self._indexed = None
        self.damaged.append(Damaged(at, reason))

    def _next_chunk(self, at: int) -> int | None:
        """Find the next chunk behind a damaged record that can be read whole."""
        data, place = self._data, at + 1 + _ZSTD_AT
        while (place := data.find(_ZSTD, place)) >= 0:
            begin = place - _ZSTD_AT
            opcode, length = _HEAD.unpack_from(data, begin)
            if opcode == Opcode.CHUNK and length <= len(data) - begin - _HEAD.size:
                try:
                    _plain(_chunk(data[begin + _HEAD.size : begin + _HEAD.size + length]))
                except _BAD:
                    pass
                else:
                    return begin
            place += 1
        return None

    def _leave_out_unknown(self) -> None:
        """Leave out messages whose channel nobody tells of any more: that stood in a chunk that is damaged."""
        known = [number for number, channel in enumerate(self._of_channel) if channel in self._channels]
        lost = len(self._of_channel) - len(known)
        if lost:
            where = self.damaged[0].offset if self.damaged else 0
            self.damaged.append(Damaged(where, f"{lost} later messages are of channels that only it told of"))
            for name in ("_times", "_of_channel", "_of_chunk", "_places"):
                values = getattr(self, name)
                setattr(self, name, array(values.typecode, [values[number] for number in known]))
        self._contents.counts = Counter(self._of_channel)

    def _take(self, opcode: int, body: bytes, at: int, begin: int, end: int) -> None:
        stream = ReadDataStream(BytesIO(body))
        if opcode == Opcode.CHUNK:
            self._take_chunk(_chunk(body), at, begin, end)
        elif opcode == Opcode.MESSAGE_INDEX and self._indexed is not None:
            self._indexed.message_index_offsets[MessageIndex.read(stream).channel_id] = at
            self._indexed.message_index_length += end - at
        elif opcode == Opcode.CHANNEL:  # told again at the end, also those of a chunk that is damaged
            self._tell_of(Channel.read(stream))
        elif opcode == Opcode.METADATA:
            told = Metadata.read(stream)
            self._contents.metadata.append(MetadataIndex(offset=at, length=end - at, name=told.name))
            if told.name == PROFILE and not self.facts:
                self.facts = told.metadata
            else:
                self.notes[told.name] = told.metadata

    def _take_chunk(self, chunk: Chunk, at: int, begin: int, end: int) -> None:
        content = _plain(chunk)
        number, place = len(self._chunks), 0
        found: list[tuple[int, int, int]] = []
        channels: list[Channel] = []
        while place < len(content):
            opcode, length = _HEAD.unpack_from(content, place)
            inner = place + _HEAD.size
            if opcode == Opcode.MESSAGE:
                channel, _, log_time = struct.unpack_from("<HIQ", content, inner)
                found.append((log_time, channel, place))
            elif opcode == Opcode.CHANNEL:
                channels.append(Channel.read(ReadDataStream(BytesIO(content[inner : inner + length]))))
            elif opcode == Opcode.SCHEMA:
                schema = Schema.read(ReadDataStream(BytesIO(content[inner : inner + length])))
                if schema.id not in {each.id for each in self._contents.schemas}:
                    self._contents.schemas.append(schema)
            place = inner + length
        for channel in channels:
            self._tell_of(channel)
        self._chunks.append((begin, end))
        self._indexed = ChunkIndex(
            chunk_length=end - at, chunk_start_offset=at, compression=chunk.compression,
            compressed_size=len(chunk.data), message_end_time=chunk.message_end_time,
            message_start_time=chunk.message_start_time, message_index_length=0, message_index_offsets={},
            uncompressed_size=chunk.uncompressed_size,
        )  # fmt: skip
        self._contents.chunks.append(self._indexed)
        for log_time, channel, place in found:
            self._times.append(log_time)
            self._of_channel.append(channel)
            self._of_chunk.append(number)
            self._places.append(place)

    def _tell_of(self, channel: Channel) -> None:
        if channel.id not in self._channels:
            self._contents.channels.append(channel)
        self._channels[channel.id] = channel


def received(sample: Sample) -> Received | None:
    """Decode a sample; None if nobody can read it."""
    try:
        if keys.is_presence(sample.key):  # made by the bus of the recorder, and never sent
            message: BusMessage = decode(sample.payload, sample.encoding)
        else:
            message = read_payload(sample.payload, sample.encoding, sample.key, sample.source)
    except InputRefused:
        return None
    return Received(sample.key, message, sample.source, sample.at, sample.past, sample.life, sample.number)


def _chunk(body: bytes) -> Chunk:
    chunk: Chunk = Chunk.read(ReadDataStream(BytesIO(body)))
    if len(chunk.data) != len(body) - (8 + 8 + 8 + 4 + 4 + len(chunk.compression) + 8):
        raise ValueError("it is cut off")
    size = chunk.uncompressed_size
    if chunk.compression == "zstd" and zstandard.frame_content_size(chunk.data) not in (size, -1):
        raise ValueError("its two sizes differ")  # and memory for the greater one may not be there
    if size > LARGEST_CHUNK:
        raise ValueError(f"it says that it has {size} bytes")
    return chunk


def _plain(chunk: Chunk) -> bytes:
    """Content of a chunk, compared with its checksum. Raises one of `_BAD`."""
    stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    return stream.read(length)
