"""Writer of MCAP files in chunks that stand for themselves: messages in, bytes out. Pure; needs the extra `record`.

A chunk is sealed whenever its writer wants, and complete on the disk it can be read, whatever becomes of the rest.
`mcap.writer` seals one only when it is full, which may take minutes; so the records are put together here, each by
the library's own code.
"""

import json
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from hashlib import blake2b
from typing import Protocol

import msgspec
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC
from msgspec import Struct, field

from engage_hri.schemas.export import bundle
from engage_hri.services.recording.form import JSON
from engage_hri.services.recording.losses import CHUNK, ChunkMark

PROFILE = "engage"
REPAIRED = "engage-repaired"
"""Name of the note of a repair: what it has found, in words."""
MOST_CHANNELS = 60_000
"""Number of channels: MCAP has room for 65 535."""
LEVEL = 3
"""Effort of the compression, 1 to 22: at 3 some 100 MB/s."""
SCHEMA = 1
"""Id of the schema of all messages of the bus."""


class Line(Struct, frozen=True):
    """Messages that share a channel: of one key, sender, life, clock, encoding, and either past or not.

    sender: participant. is_past: from before the recording. form: encoding of its messages in the file. is_typed: as
    of `Form`.
    """

    topic: str
    form: str
    key: str = ""
    sender: str = ""
    life: str = ""
    clock: str = ""
    encoding: str = ""
    is_past: bool = False
    is_typed: bool = False

    def metadata(self) -> dict[str, str]:
        named = {
            "key": self.key, "sender": self.sender, "life": self.life, "clock": self.clock,
            "encoding": self.encoding, "past": "true" if self.is_past else "",
            "typed": "true" if self.is_typed else "",
        }  # fmt: skip
        return {name: value for name, value in named.items() if value}


_MARKS = Line(topic=CHUNK, form=JSON)


class Sealed(Struct):
    """A chunk that is not in the file yet. index: its offsets count from its own beginning. channels: told in it.

    messages: number of those of the bus.
    """

    data: bytes
    index: ChunkIndex
    counts: Counter[int]
    messages: int
    channels: list[Channel]


class Records(Protocol):
    """Records that wait for the end of the file: a list, or a file of its own, for they grow with the recording."""

    def append(self, record: bytes, /) -> None: ...

    def __iter__(self) -> Iterator[bytes]:
        """All of them in their order, in pieces of any size."""


class Writer:
    """The records of one file. waiting: messages that are in no chunk yet.

    Its memory is bounded, if its user forgets lines: of each channel it keeps two numbers and a digest of 16 bytes.
    """

    def __init__(self, channels: Records | None = None, chunks: Records | None = None) -> None:
        """channels, chunks: where to put their records for the end of the file; in memory by default."""
        self.waiting = 0
        self._of_bus = 0
        self._facts: Mapping[str, str] = {}
        self._number = 0
        """Number of the chunk that is being filled."""
        self._chunk = RecordBuilder()
        self._compressor = zstandard.ZstdCompressor(level=LEVEL)
        self._indices: dict[int, MessageIndex] = {}
        self._first = self._last = 0
        self._channels: dict[Line, int] = {}
        """Ids of the lines that were heard of late."""
        self._channel_ids: dict[bytes, int] = {}
        """Ids of all lines, by digest: whoever comes back gets the same channel."""
        self._untold: set[int] = set()
        """Channels that are in no chunk on its way to the file, since theirs was dropped."""
        self._new: list[Channel] = []
        self._has_schema = False
        self._totals = Totals()
        self._told: Records = [] if channels is None else channels
        self._chunks: Records = [] if chunks is None else chunks

    @property
    def size(self) -> int:
        """Bytes of the chunk so far, before compression."""
        return self._chunk.count

    def begin(self, metadata: Mapping[str, str]) -> bytes:
        """Beginning of a file. The first chunk tells the facts again, where they have a checksum."""
        self._facts = metadata
        head = written(Header(profile=PROFILE, library="engage"))
        offset = len(MCAP0_MAGIC) + len(head)
        return MCAP0_MAGIC + head + self.told(PROFILE, metadata, offset)

    def told(self, name: str, metadata: Mapping[str, str], offset: int) -> bytes:
        """Facts about the recording, to be written at this offset."""
        data = written(Metadata(name=name, metadata=dict(metadata)))
        self._totals.metadata.append(MetadataIndex(offset=offset, length=len(data), name=name))
        return data

    def add(self, line: Line, data: bytes, log_time: int, publish_time: int, sequence: int = 0) -> None:
        """Add a message to the chunk. Times in nanoseconds since 1970."""
        if not self.waiting:
            facts = {} if self._number else dict(self._facts)
            mark = msgspec.json.encode(ChunkMark(number=self._number, of=self._facts.get("wall", ""), facts=facts))
            self._first = self._last = log_time
            self._add(_MARKS, mark, log_time, log_time, 0)
        self._add(line, data, log_time, publish_time, sequence)

    def _add(self, line: Line, data: bytes, log_time: int, publish_time: int, sequence: int) -> None:
        channel = self._channel(line)
        index = self._indices.get(channel)
        if index is None:
            index = self._indices[channel] = MessageIndex(channel_id=channel, records=[])
        index.records.append((log_time, self._chunk.count))
        self._first, self._last = min(self._first, log_time), max(self._last, log_time)
        self.waiting += 1
        self._of_bus += bool(line.key)
        number = sequence & 0xFFFFFFFF
        message = Message(
            channel_id=channel, sequence=number, log_time=log_time, publish_time=publish_time, data=data
        )  # fmt: skip
        message.write(self._chunk)

    def knows(self, line: Line) -> bool:
        """True if a message of this line needs no further channel, or there is room for one."""
        return len(self._channel_ids) < MOST_CHANNELS or line in self._channels or _digest(line) in self._channel_ids

    def forget(self, line: Line) -> None:
        """Forget a line that was not heard of for long, but not its channel."""
        self._channels.pop(line, None)

    def _channel(self, line: Line) -> int:
        id = self._channels.get(line)
        if id is None:
            new = len(self._channel_ids) + 1
            id = self._channels[line] = self._channel_ids.setdefault(_digest(line), new)
            if id == new:
                self._untold.add(id)
        if (is_new := id in self._untold) or line is _MARKS:  # each chunk can be read without those before it
            self._untold.discard(id)
            schema = SCHEMA if line.key and line.form == JSON else 0
            channel = Channel(
                id=id, topic=line.topic, message_encoding=line.form, schema_id=schema, metadata=line.metadata()
            )
            if schema and not self._has_schema:
                self._has_schema = True
                _schema().write(self._chunk)
            channel.write(self._chunk)
            self._new += [channel] if is_new else []
        return id

    def seal(self) -> Sealed | None:
        """End the chunk and begin another. None: it has no messages."""
        if not self.waiting:
            return None
        plain = _emptied(self._chunk)
        compressed = self._compressor.compress(plain)
        data = written(
            Chunk(
                compression="zstd", data=compressed, message_start_time=self._first, message_end_time=self._last,
                uncompressed_crc=zlib.crc32(plain), uncompressed_size=len(plain),
            )
        )  # fmt: skip
        length, offsets = len(data), {}
        for channel, index in self._indices.items():
            offsets[channel] = len(data)
            data += written(index)
        sealed = Sealed(
            data,
            ChunkIndex(
                chunk_length=length, chunk_start_offset=0, compression="zstd", compressed_size=len(compressed),
                message_end_time=self._last, message_start_time=self._first, message_index_length=len(data) - length,
                message_index_offsets=offsets, uncompressed_size=len(plain),
            ),
            Counter({channel: len(index.records) for channel, index in self._indices.items()}),
            self._of_bus,
            self._new,
        )  # fmt: skip
        self._indices, self.waiting, self._of_bus, self._new = {}, 0, 0, []
        self._number += 1
        return sealed

    def placed(self, sealed: Sealed, offset: int) -> None:
        """Note that a chunk is in the file, at this offset."""
        offsets = {channel: offset + at for channel, at in sealed.index.message_index_offsets.items()}
        index = replace(sealed.index, chunk_start_offset=offset, message_index_offsets=offsets)
        self._chunks.append(written(index))
        for channel in sealed.channels:
            self._told.append(written(channel))
            if channel.schema_id:
                self._totals.schemas = [_schema()]
        self._totals.count(index, sealed.counts, len(sealed.channels))

    def dropped(self, sealed: Sealed) -> None:
        """Note that the last chunk will never be in the file: what it told of its channels has to be told again."""
        self._number -= 1
        self._untold |= {channel.id for channel in sealed.channels}
        if any(channel.schema_id for channel in sealed.channels):
            self._has_schema = False

    def finish(self, offset: int, checksum: int) -> Iterator[bytes]:
        """End of the file, to be written at this offset, behind the last chunk. checksum: of all before."""
        return end(self._totals, self._told, self._chunks, offset, checksum)


class Totals(Struct):
    """Contents of the end of a file, but for its channels and chunks, which are only counted."""

    schemas: list[Schema] = []
    metadata: list[MetadataIndex] = []
    statistics: Statistics = field(
        default_factory=lambda: Statistics(
            attachment_count=0, channel_count=0, channel_message_counts={}, chunk_count=0, message_count=0,
            message_start_time=0, message_end_time=0, metadata_count=0, schema_count=0,
        )
    )  # fmt: skip

    def count(self, chunk: ChunkIndex, counts: Counter[int], channels: int) -> None:
        """Count a chunk. counts: its messages by channel. channels: number of those that no chunk before told of."""
        known, begin = self.statistics, chunk.message_start_time
        known.message_start_time = min(known.message_start_time, begin) if known.chunk_count else begin
        known.message_end_time = max(known.message_end_time, chunk.message_end_time)
        known.chunk_count += 1
        known.channel_count += channels
        known.message_count += counts.total()
        for channel, number in counts.items():
            known.channel_message_counts[channel] = known.channel_message_counts.get(channel, 0) + number


class Contents(Totals):
    """Everything in a file that its end has to tell of."""

    channels: list[Channel] = []
    chunks: list[ChunkIndex] = []


def end(
    totals: Totals, channels: Iterable[bytes], chunks: Iterable[bytes], offset: int, checksum: int
) -> Iterator[bytes]:
    """End of a file, to be written at this offset, piece by piece: where everything is, for readers that seek.

    channels, chunks: their records. checksum: CRC-32 of all bytes before.
    """
    yield (data := written(DataEnd(data_section_crc=checksum)))
    start = at = offset + len(data)
    known = totals.statistics
    known.metadata_count, known.schema_count = len(totals.metadata), len(totals.schemas)
    groups: list[tuple[Opcode, Iterable[bytes]]] = [
        (Opcode.SCHEMA, map(written, totals.schemas)),
        (Opcode.CHANNEL, channels),
        (Opcode.STATISTICS, [written(known)]),
        (Opcode.CHUNK_INDEX, chunks),
        (Opcode.METADATA_INDEX, map(written, totals.metadata)),
    ]
    crc, told = 0, b""
    for opcode, pieces in groups:
        begin = at
        for piece in pieces:
            crc, at = zlib.crc32(piece, crc), at + len(piece)
            yield piece
        if at > begin:
            told += written(SummaryOffset(opcode, begin, at - begin))
    footer = written(Footer(summary_start=start, summary_offset_start=at, summary_crc=0))
    crc = zlib.crc32(told + footer[:-4], crc)
    yield told + written(Footer(summary_start=start, summary_offset_start=at, summary_crc=crc)) + MCAP0_MAGIC


def _digest(line: Line) -> bytes:
    return blake2b(msgspec.msgpack.encode(line), digest_size=16).digest()


@cache
def _schema() -> Schema:
    """The JSON Schema of any message. Viewers want to hear that it is an object."""
    whole = {**bundle(), "type": "object", "properties": {"type": {"type": "string"}}}
    data = json.dumps(whole, separators=(",", ":")).encode()
    return Schema(id=SCHEMA, name="engage.Message", encoding="jsonschema", data=data)


def written(record: McapRecord) -> bytes:
    """Bytes of a record."""
    builder = RecordBuilder()
    record.write(builder)
    return _emptied(builder)


def _emptied(builder: RecordBuilder) -> bytes:
    content: bytes = builder.end()  # type: ignore[no-untyped-call]
    return content
