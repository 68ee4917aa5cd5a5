"""Reader of recordings, whole ones and those whose writer was killed. Pure: bytes in, messages out.

What is given stood in a chunk, and the chunk agrees with its checksum. A chunk that does not, or that is not the next
one of this recording, is left out, and told in `damaged`. Where the end of the data is not found the recording ends,
and `lost_bytes` says how much was not read. The index at the end of a file is for other programs: it is compared with
its checksum, and nothing is taken from it. Needs the extra `record`.
"""

import re
import struct
import zlib
from array import array
from bisect import bisect_right
from collections.abc import Callable, Iterator
from functools import lru_cache
from io import BytesIO
from math import isfinite
from typing import Any, NamedTuple

import msgspec
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, Metadata
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import HeadOwner
from engage_hri.schemas.messages import Message as BusMessage
from engage_hri.schemas.messages import decode
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.samples import Received, Sample, read_payload
from engage_hri.services.recording.form import (
    CHUNK,
    CLOCK,
    LOST,
    MORE,
    OWN,
    ChunkMark,
    MissingMessages,
    StoredForm,
    payload,
)
from engage_hri.services.recording.writing import PROFILE, Line

_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_FOOTER = struct.Struct("<BQQQI")
_BAD = (
    McapError, struct.error, ValueError, OverflowError, RuntimeError, EOFError, MemoryError, zstandard.ZstdError,
    msgspec.MsgspecError, RecursionError,
)  # fmt: skip
"""Errors of the libraries over bytes that nobody wrote; lz4 has a `RuntimeError`."""
_CHUNK = re.compile(rb"\x06.{36}\x04\0{3}zstd", re.DOTALL)
"""Beginning of a chunk as a recorder writes it."""
_CHUNK_HEAD = _HEAD.size + 8 + 8 + 8 + 4 + 4 + 8
"""Bytes of a chunk beside the name of its compression and its content."""
_PASSED_OVER = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT)
"""Records that hold nothing for us."""
LARGEST_CHUNK = 64 * 1024 * 1024
"""Bytes of a chunk's content. Ours have one MiB, and one message more."""
CHUNKS_KEPT = 16
"""Number of chunks that are kept decompressed."""
BILLION = 1_000_000_000
REPAIRED = "engage-repaired"
"""Name of the note in a copy that was made of a damaged recording: what that lacked, in words."""


class Damaged(Struct, frozen=True):
    """Something in a file that is not as a recorder wrote it. offset: byte where it begins. reason: in words."""

    offset: int
    reason: str


class Stored(NamedTuple):
    """A message as it stands in a file. Times in nanoseconds since 1970. sequence: its number, 0: it has none."""

    line: Line
    data: bytes
    log_time: int
    publish_time: int
    sequence: int


class Recording:
    """A recording. Its messages are numbered from 0, in the order in which they came to the recorder.

    facts: what the recorder wrote of itself at the beginning (docs/recordings.md). notes: what it wrote later, by
    name. has_all_data: the data ends where it says so. is_whole: and the index behind it is as it was written.
    lost_bytes: bytes at the end that were not read. damaged: everything else that is not as a recorder wrote it.
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
        self._lines: dict[int, Line] = {}
        """Lines by the ids of their channels."""
        self._told: set[bytes] = set()
        """Records of all channels."""
        self._mark = ChunkMark(number=-1, of="")
        """The last one that was read."""
        self._chunks: list[tuple[int, int]] = []
        """Begin and end of each chunk's record in the file."""
        self._content = lru_cache(CHUNKS_KEPT)(self._unpacked)
        self._times = array("Q")
        self._of_channel = array("H")
        self._of_chunk = array("I")
        self._places = array("I")
        if bytes(data[: len(MCAP0_MAGIC)]) != MCAP0_MAGIC:
            reason = "this is no MCAP file" if len(data) else "this file is empty, and no MCAP file"
            raise InputRefused(Fault(reason=reason, where=name))
        self._read()
        if not self.facts and not self.damaged:
            reason = "it is a recording of another program" if self._chunks else "nothing in it can be read"
            raise InputRefused(Fault(reason=reason, where=name, advice="`engage record` makes recordings"))
        if self._mark.of and self.facts.get("wall") != self._mark.of:
            self.facts = {**self.facts, "wall": self._mark.of}
            self._damage(0, "the time of its beginning is damaged")
        try:
            is_readable = isfinite(self.began) and self.wall >= 0
        except (KeyError, ValueError):
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
        return float(self.facts["began"])

    @property
    def wall(self) -> int:
        """Beginning of the recording, nanoseconds since 1970."""
        return int(self.facts["wall"])

    @property
    def duration(self) -> Seconds:
        """Time of the last message."""
        return self.time(len(self) - 1) if len(self) else 0.0

    @property
    def repaired(self) -> str:
        """Words about what the recording lacked of which this is a copy; empty: it is none."""
        return self.notes.get(REPAIRED, {}).get("found", "")

    @property
    def lacks(self) -> list[str]:
        """Words about what this recording lacks, and the one of which it is a copy; empty: nothing."""
        found = [self.repaired] if self.repaired else []
        if not self.has_all_data:
            found.append(f"what came after {self.duration:.2f} s is missing")
        return found + [f"damaged at byte {each.offset}: {each.reason}" for each in self.damaged]

    # -- messages -----------------------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self._times)

    def time(self, number: int) -> Seconds:
        """Time at which a message came, from the beginning of the recording."""
        return (self._times[number] - self.wall) / BILLION

    def key(self, number: int) -> str:
        """Key of a message, relative to the robot; empty for the recorder's own."""
        line = self._lines[self._of_channel[number]]
        return self.sample(number).key if line.topic == MORE else line.key

    def life(self, number: int) -> str:
        """Life that a message came from."""
        return self._lines[self._of_channel[number]].life

    def number(self, number: int) -> int:
        """Number of a message in its life, modulo 2 ** 32; 0: it has none."""
        return self.stored(number).sequence

    def stored(self, number: int) -> Stored:
        """Return a message as it stands in the file."""
        content, place = self._content(self._of_chunk[number]), self._places[number]
        _, length = _HEAD.unpack_from(content, place)
        id, sequence, log_time, publish_time = _MESSAGE.unpack_from(content, place + _HEAD.size)
        data = content[place + _HEAD.size + _MESSAGE.size : place + _HEAD.size + length]
        return Stored(self._lines[id], data, log_time, publish_time, sequence)

    def sample(self, number: int) -> Sample:
        """Return a message as it came, to the byte. at: on the clock of the recorder."""
        line, data, _, publish_time, sequence = self.stored(number)
        if line.topic == MORE:
            one: Sample = msgspec.msgpack.decode(data, type=Sample)
            return replace(one, key=_known(one.key))
        return Sample(
            key=line.key, payload=payload(StoredForm(line.form, data, line.typed), line.encoding),
            encoding=line.encoding, source=line.sender, at=self.began + self.time(number), past=line.past,
            life=line.life, number=sequence, clock=line.clock,
            sent=self.began + (publish_time - self.wall) / BILLION if line.clock else 0.0,
        )  # fmt: skip

    def received(self, number: int) -> Received | None:
        """Return a message, decoded; None if nobody can read it."""
        return received(self.sample(number))

    def own(self, topic: str) -> list[tuple[Seconds, Any]]:
        """Return what the recorder itself has said under this topic, as its type in `OWN`, with the times."""
        channels = {id for id, line in self._lines.items() if line.topic == topic}
        numbers = (number for number, channel in enumerate(self._of_channel) if channel in channels)
        return [(self.time(each), msgspec.json.decode(self.stored(each).data, type=OWN[topic])) for each in numbers]

    @property
    def losses(self) -> MissingMessages:
        """Messages that are known to be missing."""
        told = self.own(LOST)
        return told[-1][1] if told else MissingMessages()

    # -- reading ------------------------------------------------------------------------------------------------

    def _read(self) -> None:
        """Read all records up to the end of the data.

        A damaged record may lie about its length: reading goes on at the next chunk that can be seen.
        """
        data, at = self._data, len(MCAP0_MAGIC)
        while not self.has_all_data:
            opcode, end = 0, len(data) + 1
            try:
                opcode, length = _HEAD.unpack_from(data, at)
                end = at + _HEAD.size + length
                if end > len(data):
                    raise ValueError("it is cut off")
                self._take(opcode, at, end)
                at = end
            except _BAD as error:
                found = _CHUNK.search(data, at + 1)
                is_passable = opcode == Opcode.CHUNK and end <= len(data)
                if found is None and not is_passable:
                    self.lost_bytes = len(data) - at
                    return
                words = str(error) if type(error) is ValueError else f"{type(error).__name__}: {error}"
                self._damage(at, f"what is here is left out: {words}")
                at = end if found is None else found.start()
        self.is_whole = self._has_index(at)

    def _damage(self, at: int, reason: str) -> None:
        self.damaged.append(Damaged(at, reason))

    def _take(self, opcode: int, at: int, end: int) -> None:
        """Take a record of the data. Raises one of `_BAD`."""
        if opcode == Opcode.CHUNK:
            self._take_chunk(at, end)
        elif opcode == Opcode.METADATA:
            told = Metadata.read(_stream(self._data[at + _HEAD.size : end]))
            if told.name != PROFILE:
                self.notes[told.name] = told.metadata
            elif not self.facts:
                self.facts = told.metadata
        elif opcode == Opcode.DATA_END:
            checksum = DataEnd.read(_stream(self._data[at + _HEAD.size : end])).data_section_crc
            with memoryview(self._data) as view, view[:at] as part:
                is_right = checksum in (0, zlib.crc32(part))
            if not is_right and not self.damaged:  # what is damaged differs from the checksum, of course
                self._damage(at, "the data differs from its checksum: what no chunk tells of is missing, or changed")
            self.has_all_data = True
        elif opcode not in _PASSED_OVER:
            raise ValueError("no record is here")

    def _has_index(self, at: int) -> bool:
        """Tell whether an index that begins here ends the file, and agrees with its checksum."""
        data, footer = self._data, len(self._data) - len(MCAP0_MAGIC) - _FOOTER.size
        if footer < at:
            return False
        opcode, _, begin, _, checksum = _FOOTER.unpack_from(data, footer)
        is_end = (opcode, begin) == (Opcode.FOOTER, at) and bytes(data[-len(MCAP0_MAGIC) :]) == MCAP0_MAGIC
        return is_end and zlib.crc32(data[at : footer + _FOOTER.size - 4]) == checksum

    def _take_chunk(self, at: int, end: int) -> None:
        """Take a chunk, or nothing of it. Raises one of `_BAD`."""
        self._chunks.append((at, end))
        number = len(self._chunks) - 1
        content = self._unpacked(number)
        found: list[tuple[int, int, int]] = []
        lines: dict[int, Line] = {}
        new: set[bytes] = set()
        marks: list[ChunkMark] = []
        for opcode, place, until in _records(content):
            if opcode == Opcode.CHANNEL:
                if (told := content[place:until]) in self._told:  # in a chunk before
                    continue
                channel = Channel.read(_stream(told))
                if channel.id in self._lines:
                    raise ValueError(f"it tells of channel {channel.id} otherwise than a chunk before it")
                new.add(told)
                lines[channel.id] = Line.of(channel)
            elif opcode == Opcode.MESSAGE:
                id, _, log_time, _ = _MESSAGE.unpack_from(content, place)
                line = lines.get(id) or self._lines.get(id)
                if line is None:
                    raise ValueError("it does not tell of its channels")
                if line.topic == CHUNK:
                    marks.append(msgspec.json.decode(content[place + _MESSAGE.size : until], type=ChunkMark))
                else:
                    found.append((log_time, id, place - _HEAD.size))
        self._follow(marks, at)
        for id, line in lines.items():
            self._lines[id] = replace(line, key=_known(line.key))
            if self._lines[id] != line:
                self._damage(at, f"messages with a key that is none of Engage are passed over: {line.key!r}")
        self._told |= new
        for log_time, id, place in found:
            self._times.append(log_time)
            self._of_channel.append(id)
            self._of_chunk.append(number)
            self._places.append(place)

    def _follow(self, marks: list[ChunkMark], at: int) -> None:
        """Check that a chunk is the next one of this recording. Raises ValueError: it is not.

        marks: one; a file that another program has put together anew has chunks with none, or several.
        """
        last = self._mark
        for mark in marks:
            if last.number >= 0 and mark.of != last.of:
                raise ValueError("a chunk of another recording")
            if mark.number <= last.number:
                raise ValueError("a chunk that was there before, or belongs before another one")
            last = mark
        if marks and marks[0].number > self._mark.number + 1 and not self.damaged:
            self._damage(at, f"the chunks from number {self._mark.number + 1} to {marks[0].number - 1} are not here")
        self._mark = last
        self.facts = next((mark.facts for mark in marks if mark.facts), self.facts)

    def _unpacked(self, number: int) -> bytes:
        """Content of a chunk, compared with its checksum. Raises one of `_BAD`."""
        begin, end = self._chunks[number]
        chunk = Chunk.read(_stream(self._data[begin + _HEAD.size : end]))
        size = chunk.uncompressed_size
        if end - begin != _CHUNK_HEAD + len(chunk.compression) + len(chunk.data):
            raise ValueError("a chunk has another length than it says")
        if chunk.compression == "zstd" and zstandard.frame_content_size(chunk.data) not in (size, -1):
            raise ValueError("the two sizes of a chunk differ")  # and memory for the greater one may not be there
        if size > LARGEST_CHUNK:
            raise ValueError(f"a chunk says that it has {size} bytes")
        stream, length = get_chunk_data_stream(chunk)
        content: bytes = stream.read(length)
        if length != size or zlib.crc32(content) != chunk.uncompressed_crc:
            raise ValueError("a chunk differs from its checksum")
        return content


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


def _known(key: str) -> str:
    """The key, if it has the form of those in the table of keys; else empty, as of what nobody reads."""
    try:
        chunks, is_presence = key.split("/"), keys.key_class(key) == "alive"
    except ValueError:
        return ""
    is_long_enough = len(chunks) == 5 if is_presence else len(chunks) > 4
    return key if is_long_enough and all(map(keys.is_chunk, chunks)) else ""


def _records(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Kind, and begin and end of the body, of each record of a chunk. Raises ValueError: one is cut off."""
    place = 0
    while place < len(content):
        opcode, length = _HEAD.unpack_from(content, place)
        begin, place = place + _HEAD.size, place + _HEAD.size + length
        if place > len(content):
            raise ValueError("a record in it is cut off")
        yield opcode, begin, place


def _stream(body: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(body))


# -- instants of messages, as times in a recording ----------------------------------------------------------------


class RecordingTimes:
    """Times in a recording. An instant of a clock that its recorder never knew has none."""

    def __init__(self, recording: Recording) -> None:
        self._clock = recording.clock
        self._began = recording.began
        self._offsets: dict[str, tuple[list[Seconds], list[Seconds]]] = {}
        """Offsets of each other clock to the recorder's, and from when on each was known."""
        for at, told in recording.own(CLOCK):
            for clock, known in told.items():
                since, offsets = self._offsets.setdefault(clock, ([], []))
                since.append(at)
                offsets.append(known.offset)

    def at(self, stamp: Stamp, told_at: Seconds) -> Seconds | None:
        """Time of an instant, from the beginning of the recording. told_at: time at which its message came."""
        if stamp.clock == self._clock:
            return stamp.seconds - self._began
        if stamp.clock not in self._offsets:
            return None
        since, offsets = self._offsets[stamp.clock]
        # What was told before the clock was measured is taken by its first measurement.
        return stamp.seconds + offsets[max(0, bisect_right(since, told_at) - 1)] - self._began

    def told(self, message: object, came: Seconds) -> Seconds:
        """Time that a message tells of; that at which it came, if it has none, or of a clock that was not known."""
        stamp = getattr(message, "since" if isinstance(message, HeadOwner) else "at", None)
        at = self.at(stamp, came) if isinstance(stamp, Stamp) else None
        return came if at is None else at


def messages(recording: Recording) -> Iterator[tuple[Received, Seconds]]:
    """All messages that can be read, with the times that they tell of, or else at which they came."""
    times = RecordingTimes(recording)
    for number in range(len(recording)):
        if not recording.key(number) or (received := recording.received(number)) is None:
            continue
        yield received, times.told(received.message, recording.time(number))


def moved(value: Any, instant: Callable[[Stamp], Stamp]) -> Any:
    """A message with other instants, everything else as it was."""
    match value:
        case Stamp():
            return instant(value)
        case Struct():
            fields = {name: getattr(value, name) for name in value.__struct_fields__}
            changed = {name: new for name, old in fields.items() if (new := moved(old, instant)) is not old}
            return msgspec.structs.replace(value, **changed) if changed else value
        case tuple():
            items = tuple(moved(item, instant) for item in value)
            same = all(new is old for new, old in zip(items, value, strict=True))
            return value if same else items
    return value
