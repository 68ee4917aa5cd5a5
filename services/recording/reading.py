"""Reader of recordings, whole ones and those whose writer was killed. Pure: bytes in, messages out.

What is given stood in a chunk, and the chunk agrees with its checksum. The index behind the data only tells of
channels that no such chunk tells of, and only where it agrees with its own checksum. Whatever is not as a recorder
writes it is left out, and told in `damaged`. Where a file is cut off the recording ends, and `lost_bytes` says how
much was not read. Needs the extra `record`.
"""

import re
import struct
import zlib
from array import array
from collections import Counter, OrderedDict
from collections.abc import Iterator
from io import BytesIO
from math import isfinite
from typing import Any

import msgspec
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Header,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
)
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
from engage_hri.services.recording.form import StoredForm, payload
from engage_hri.services.recording.losses import CHUNK, LOST, MORE, OWN, ChunkMark, MissingMessages
from engage_hri.services.recording.writing import PROFILE, REPAIRED, Contents

_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_FOOTER = struct.Struct("<BQQQI")
_BAD = (
    McapError, struct.error, ValueError, OverflowError, UnicodeDecodeError, RuntimeError, EOFError, MemoryError,
    zstandard.ZstdError, msgspec.MsgspecError, RecursionError,
)  # fmt: skip
"""Errors of the libraries over bytes that nobody wrote; lz4 has a `RuntimeError`."""
_CHUNK = re.compile(rb"\x06.{4}\0{4}.{16}.{4}\0{4}.{4}(?:\x04\0{3}zstd|\x03\0{3}lz4|\0{4})", re.DOTALL)
"""Beginning of a chunk of less than 4 GiB."""
_BEGINNING = re.compile(rb".{8}\x01.{8}....engage", re.DOTALL)
"""Beginning of a recording of ours: a mark of eight bytes, and the record that names what wrote it."""
_DATA_END = _HEAD.size + 4
"""Bytes of the record at the end of the data."""
LARGEST_CHUNK = 64 * 1024 * 1024
"""Bytes of a chunk's content. Ours have one MiB, and one message more."""
CHUNKS_KEPT = 16
"""Number of chunks that are kept decompressed."""
BILLION = 1_000_000_000
LONGEST_SILENCE = 3600 * BILLION
"""Nanoseconds that a recorder may have waited for a robot, by a time that has no checksum."""
LATEST = 2**63 - 1
"""Latest time in a file, in nanoseconds since 1970: in the year 2262."""


class Damaged(Struct, frozen=True):
    """Something in a file that is not as a recorder wrote it. offset: byte where it begins. reason: in words."""

    offset: int
    reason: str


class Recording:
    """A recording. Its messages are numbered from 0, in the order in which they came to the recorder.

    facts: what the recorder wrote of itself at the beginning (docs/recordings.md). notes: what it wrote later, by
    name. is_whole: its end is there, and agrees with its checksum. has_all_data: the data ends where it says so, and
    only the index behind it may be damaged. lost_bytes: bytes at the end that were not read. damaged: everything
    else that is not as a recorder wrote it.
    """

    def __init__(self, data: bytes, name: str = "recording") -> None:
        """data: the file; it may be a memory map. Raises InputRefused: it is none of ours, or nothing is in it."""
        self.name = name
        self.facts: dict[str, str] = {}
        self.notes: dict[str, dict[str, str]] = {}
        self.is_whole = self.has_all_data = False
        self.lost_bytes = 0
        self.damaged: list[Damaged] = []
        self._data = data
        self._channels: dict[int, Channel] = {}
        self._spare: dict[int, Channel] = {}
        """Channels as the index tells of them."""
        self._readable: dict[int, bool] = {}
        """Whether messages of a channel can be read, by its id."""
        self._left_out: dict[str, tuple[int, int]] = {}
        """Place of the first chunk with such messages, and their number, by what is wrong with them."""
        self._mark = ChunkMark(number=-1, of="")
        """The last one that was read."""
        self._contents = Contents()
        self._chunks: list[tuple[int, int]] = []
        """Begin and end of each chunk's content in the file."""
        self._indexed: ChunkIndex | None = None
        """The chunk to which the indexes belong that come next."""
        self._open: OrderedDict[int, bytes] = OrderedDict()
        self._times = array("q")
        self._of_channel = array("H")
        self._of_chunk = array("I")
        self._places = array("I")
        self.end = self._read()
        """Bytes of the file up to where it may go on."""
        for reason, (offset, number) in self._left_out.items():
            self._damage(offset, f"{number} messages are left out: {reason}")
        if not self.facts:
            known = "nothing in it can be read" if not self._channels else "it is a recording of another program"
            reason = "what it says of its beginning is damaged" if self.damaged else known
            raise InputRefused(Fault(reason=reason, where=name, advice="`engage record` makes recordings"))
        self._check_beginning()
        try:
            is_readable = isfinite(self.began) and 0 <= self.wall <= LATEST
        except ValueError:
            is_readable = False
        if not is_readable:
            raise InputRefused(Fault(reason="what it says of its beginning is damaged", where=name))

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
    def repaired(self) -> str:
        """Findings of repairs, in words; empty: there was none that has found something."""
        return self.notes.get(REPAIRED, {}).get("found", "")

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
        form = StoredForm(channel.message_encoding, message.data, told.get("typed") == "true")
        return Sample(
            key=told.get("key", ""), payload=payload(form, encoding),
            encoding=encoding, source=told.get("sender", ""), at=self.began + self.time(number),
            past=told.get("past") == "true", life=told.get("life", ""), number=message.sequence, clock=clock,
            sent=self.began + (message.publish_time - self.wall) / BILLION if clock else 0.0,
        )  # fmt: skip

    def received(self, number: int) -> Received | None:
        """Return a message, decoded; None if nobody can read it."""
        return received(self.sample(number))

    def own(self, topic: str) -> list[tuple[Seconds, Any]]:
        """Return what the recorder itself has said under this topic, as its type in `OWN`, with the times."""
        channels = {id for id, channel in self._channels.items() if channel.topic == topic}
        numbers = (number for number, channel in enumerate(self._of_channel) if channel in channels)
        return [(self.time(each), msgspec.json.decode(self._message(each).data, type=OWN[topic])) for each in numbers]

    @property
    def losses(self) -> MissingMessages:
        """Messages that are known to be missing."""
        told = self.own(LOST)
        return told[-1][1] if told else MissingMessages()

    def indexes(self, chunk: int) -> list[MessageIndex]:
        """Make the indexes of a chunk anew, one for each of its channels. chunk: its number."""
        found: dict[int, MessageIndex] = {}
        content = self._content(chunk)
        for opcode, place, _ in _records(content):
            if opcode == Opcode.MESSAGE:
                channel, _, log_time, _ = _MESSAGE.unpack_from(content, place + _HEAD.size)
                index = found.setdefault(channel, MessageIndex(channel_id=channel, records=[]))
                index.records.append((log_time, place))
        return list(found.values())

    def checksum(self, until: int) -> int:
        """CRC-32 of the first bytes of the file."""
        with memoryview(self._data) as view, view[:until] as part:
            return zlib.crc32(part)

    def _message(self, number: int) -> Message:
        chunk, place = self._of_chunk[number], self._places[number]
        body = _body(self._content(chunk), place)
        message: Message = Message.read(ReadDataStream(BytesIO(body)), len(body))
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
            if not _BEGINNING.match(data):
                reason = "this is no MCAP file" if size else "this file is empty, and no MCAP file"
                raise InputRefused(Fault(reason=reason, where=self.name))
            self._damage(0, "the mark of its format is damaged")
        until = self._read_index()
        self.is_whole = self.has_all_data = until is not None
        until = size if until is None else until
        at = good = len(MCAP0_MAGIC)
        while at + _HEAD.size <= until:
            opcode, length = _HEAD.unpack_from(data, at)
            end = at + _HEAD.size + length
            is_end = opcode == Opcode.DATA_END and end == at + _DATA_END
            if is_end and not self.is_whole:
                self.has_all_data = self._next_chunk(at, size) is None
                break
            try:
                if end > until or is_end:
                    raise ValueError("the data does not end here" if is_end else "no record is here")
                self._take(opcode, data[at + _HEAD.size : end], at, end)
                at = good = end
            except _BAD as error:
                found = self._next_chunk(at, until)
                if found is None and not self.is_whole:
                    break
                words = str(error) if type(error) is ValueError else f"{type(error).__name__}: {error}"
                self._damage(at, f"what is here is left out: {words}")
                at = until if found is None else found
        if not self.is_whole:
            self.lost_bytes = size - good
        self._check_data(at)
        return good

    def _read_index(self) -> int | None:
        """Read the index behind the data. Returns where the data ends; None: it is not as it was written."""
        data, size = self._data, len(self._data)
        footer = size - len(MCAP0_MAGIC) - _FOOTER.size
        if footer < 0 or bytes(data[footer + _FOOTER.size :]) != MCAP0_MAGIC:
            return None
        opcode, length, begin, _, checksum = _FOOTER.unpack_from(data, footer)
        index = bytes(data[begin:footer])
        if (opcode, length) != (Opcode.FOOTER, _FOOTER.size - _HEAD.size) or begin < len(MCAP0_MAGIC) + _DATA_END:
            return None
        if zlib.crc32(data[footer : footer + _FOOTER.size - 4], zlib.crc32(index)) != checksum:
            return None
        try:
            for opcode, _, body in _records(index):
                if opcode == Opcode.CHANNEL:
                    channel = Channel.read(ReadDataStream(BytesIO(body)))
                    self._spare[channel.id] = channel
        except _BAD:
            return None
        return int(begin) - _DATA_END

    def _check_data(self, at: int) -> None:
        """Compare all data with its checksum, which is told at this place. Old recordings have none: 0."""
        try:
            opcode, length = _HEAD.unpack_from(self._data, at)
            told = DataEnd.read(ReadDataStream(BytesIO(self._data[at + _HEAD.size : at + _DATA_END])))
            is_right = told.data_section_crc in (0, self.checksum(at))
        except _BAD:
            opcode, length, is_right = 0, 0, False
        is_end = (opcode, length) == (Opcode.DATA_END, _DATA_END - _HEAD.size)
        if self.is_whole and not is_end:
            self._damage(at, "the record at the end of the data is damaged")
        elif is_end and not is_right and not self.damaged:  # what is damaged differs from the checksum, of course
            self._damage(
                at,
                "the data differs from its checksum: something is missing, or was changed where no chunk tells of it",
            )

    def _check_beginning(self) -> None:
        """Compare the time of the beginning with what has a checksum: a replay waits from then for the first message.

        Each mark has it. Where there are no marks it is not much earlier than the first message.
        """
        wall, times = self._mark.of, self._times
        if not wall and times:
            first, last = min(times), max(times)
            began = self.facts.get("wall", "")
            is_near = began.isdecimal() and 0 <= first - int(began) <= max(last - first, LONGEST_SILENCE)
            wall = began if is_near else str(first)
        if times and wall != self.facts.get("wall", ""):
            self.facts = {**self.facts, "wall": wall}
            self._damage(0, "the time of its beginning is damaged")

    @property
    def another(self) -> int | None:
        """Place behind this recording at which another one begins, of which nothing is read; None: there is none."""
        found = self._data.find(MCAP0_MAGIC + bytes([Opcode.HEADER]), max(self.end, 1))
        return None if found < 0 else found

    def _damage(self, at: int, reason: str) -> None:
        self._indexed = None
        self.damaged.append(Damaged(at, reason))

    def _next_chunk(self, at: int, until: int) -> int | None:
        """Find the next chunk behind a damaged record that can be read whole, before another file begins."""
        until = min(until, self._data.find(MCAP0_MAGIC, at) % (len(self._data) + 1))
        place = at + 1
        while (found := _CHUNK.search(self._data, place, until)) is not None:
            begin = found.start()
            end = begin + _HEAD.size + _HEAD.unpack_from(self._data, begin)[1]
            try:
                if end <= until:
                    _plain(_chunk(self._data[begin + _HEAD.size : end]))
                    return begin
            except _BAD:
                pass
            place = begin + 1
        return None

    def _take(self, opcode: int, body: bytes, at: int, end: int) -> None:
        """Take a record of the data. Raises one of `_BAD`."""
        stream = ReadDataStream(BytesIO(body))
        if opcode == Opcode.CHUNK:
            self._take_chunk(_chunk(body), at, end)
        elif opcode == Opcode.MESSAGE_INDEX:
            if int.from_bytes(body[2:6], "little") != len(body) - 6:
                raise ValueError("no record is here")
            if self._indexed is not None:
                self._indexed.message_index_offsets[MessageIndex.read(stream).channel_id] = at
                self._indexed.message_index_length += end - at
        elif opcode == Opcode.METADATA:
            told = Metadata.read(stream)
            self._contents.metadata.append(MetadataIndex(offset=at, length=end - at, name=told.name))
            if told.name != PROFILE:
                self.notes[told.name] = told.metadata
            elif not self.facts:
                self.facts = told.metadata
        elif opcode == Opcode.ATTACHMENT:  # of another program
            if int.from_bytes(body[-4:], "little") not in (0, zlib.crc32(body[:-4])):
                raise ValueError("an attachment differs from its checksum")
        elif opcode == Opcode.HEADER:
            Header.read(stream)
        else:
            raise ValueError("no record is here")

    def _take_chunk(self, chunk: Chunk, at: int, end: int) -> None:
        """Take a chunk, or nothing of it. Raises one of `_BAD`."""
        content = _plain(chunk)
        found: list[tuple[int, int, int]] = []
        channels: dict[int, Channel] = {}
        schemas: list[Schema] = []
        marks: list[ChunkMark] = []
        for opcode, place, body in _records(content):
            if opcode == Opcode.CHANNEL:
                channel = Channel.read(ReadDataStream(BytesIO(body)))
                if self._channels.get(channel.id, channel) != channel:
                    raise ValueError(f"it tells of channel {channel.id} otherwise than a chunk before it")
                channels[channel.id] = channel
            elif opcode == Opcode.SCHEMA:
                schemas.append(Schema.read(ReadDataStream(BytesIO(body))))
            elif opcode == Opcode.MESSAGE:
                id, _, log_time, _ = _MESSAGE.unpack_from(body)
                if log_time > LATEST:
                    raise ValueError("a time in it is none")
                known = channels.get(id) or self._channels.get(id) or self._spare.get(id)
                if known is not None and known.topic == CHUNK:
                    marks.append(msgspec.json.decode(body[_MESSAGE.size :], type=ChunkMark))
                found.append((log_time, id, place))
        self._follow(marks, at)
        new = [told for id, told in channels.items() if id not in self._channels]
        self._contents.channels += new
        self._channels |= channels
        known_schemas = {each.id for each in self._contents.schemas}
        self._contents.schemas += [each for each in schemas if each.id not in known_schemas]
        self._indexed = ChunkIndex(
            chunk_length=end - at, chunk_start_offset=at, compression=chunk.compression,
            compressed_size=len(chunk.data), message_end_time=max((each[0] for each in found), default=0),
            message_start_time=min((each[0] for each in found), default=0), message_index_length=0,
            message_index_offsets={}, uncompressed_size=len(content),
        )  # fmt: skip
        self._contents.chunks.append(self._indexed)
        self._contents.count(self._indexed, Counter(id for _, id, _ in found), len(new))
        number = len(self._chunks)
        self._chunks.append((at + _HEAD.size, end))
        for log_time, id, place in found:
            if self._is_message(id, content, place, at):
                self._times.append(log_time)
                self._of_channel.append(id)
                self._of_chunk.append(number)
                self._places.append(place)

    def _follow(self, marks: list[ChunkMark], at: int) -> None:
        """Check that a chunk is the next one of this recording. Raises ValueError: it is not."""
        last = self._mark
        for mark in marks:
            if last.number >= 0 and mark.of != last.of:
                raise ValueError("a chunk of another recording")
            if mark.number <= last.number:
                raise ValueError("a chunk that was there before, or belongs before another one")
            last = mark
        if marks and marks[0].number > self._mark.number + 1 and not self.damaged:
            self._damage(at, f"the chunks from number {self._mark.number + 1} to {marks[0].number - 1} are not here")
        for mark in marks:
            self.facts = mark.facts or self.facts
            self._mark = mark

    def _is_message(self, id: int, content: bytes, place: int, at: int) -> bool:
        """Tell whether a message of a chunk is one to give; those that nobody can read are counted."""
        channel = self._channels.setdefault(id, self._spare[id]) if id in self._spare else self._channels.get(id)
        if channel is None:
            return self._leave_out("only a damaged part told of their channels", at)
        if channel.topic == CHUNK:
            return False
        key = channel.metadata.get("key", "")
        try:
            if channel.topic == MORE:
                key = msgspec.msgpack.decode(_body(content, place)[_MESSAGE.size :], type=Sample).key
            elif channel.topic in OWN:
                msgspec.json.decode(_body(content, place)[_MESSAGE.size :], type=OWN[channel.topic])
                return True
        except _BAD:
            return self._leave_out("nobody can read these words of the recorder", at)
        if id not in self._readable or channel.topic == MORE:
            self._readable[id] = _is_in_table(key)
        return self._readable[id] or self._leave_out("their keys are none of Engage", at)

    def _leave_out(self, reason: str, at: int) -> bool:
        first, number = self._left_out.get(reason, (at, 0))
        self._left_out[reason] = first, number + 1
        return False


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


def _is_in_table(key: str) -> bool:
    """Tell whether a key has the form of those in the table of keys."""
    try:
        kind = keys.key_class(key)
    except ValueError:
        return False
    chunks = key.split("/")
    # Presence has four chunks in recordings from before the part of a participant stood in its key.
    return all(map(keys.is_chunk, chunks)) and (len(chunks) in (4, 5) if kind == "alive" else len(chunks) > 4)


def _records(content: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Kind, place and body of each record of a chunk or of the index. Raises ValueError: one is cut off."""
    place = 0
    while place < len(content):
        opcode, length = _HEAD.unpack_from(content, place)
        if place + _HEAD.size + length > len(content):
            raise ValueError("a record in it is cut off")
        yield opcode, place, _body(content, place)
        place += _HEAD.size + length


def _body(content: bytes, place: int) -> bytes:
    """Body of the record at a place."""
    return content[place + _HEAD.size : place + _HEAD.size + _HEAD.unpack_from(content, place)[1]]


def _chunk(body: bytes) -> Chunk:
    chunk: Chunk = Chunk.read(ReadDataStream(BytesIO(body)))
    if len(chunk.data) != len(body) - (8 + 8 + 8 + 4 + 4 + len(chunk.compression) + 8):
        raise ValueError("a chunk is cut off")
    size = chunk.uncompressed_size
    if chunk.compression == "zstd" and zstandard.frame_content_size(chunk.data) not in (size, -1):
        raise ValueError("the two sizes of a chunk differ")  # and memory for the greater one may not be there
    if size > LARGEST_CHUNK:
        raise ValueError(f"a chunk says that it has {size} bytes")
    return chunk


def _plain(chunk: Chunk) -> bytes:
    """Content of a chunk, compared with its checksum. Raises one of `_BAD`."""
    stream, length = get_chunk_data_stream(chunk)
    content = stream.read(length)
    if length != chunk.uncompressed_size or zlib.crc32(content) != chunk.uncompressed_crc:
        raise ValueError("a chunk differs from its checksum")
    return content
