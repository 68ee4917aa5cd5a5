"""Writer of MCAP files in chunks that stand for themselves: messages in, bytes out. Pure; needs the extra `record`.

A chunk is sealed whenever its writer wants, and complete on the disk it can be read, whatever becomes of the rest.
`mcap.writer` seals one only when it is full, which may take minutes; so the records are put together here, each by
the library's own code.
"""

import json
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

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
from msgspec import Struct

from engage_hri.schemas.export import bundle
from engage_hri.services.recording.form import JSON
from engage_hri.services.recording.losses import CHUNK, Mark

PROFILE = "engage"
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
    """A chunk that is not in the file yet. index: its offsets count from its own beginning. lines: new in it.

    messages: number of those of the bus.
    """

    data: bytes
    index: ChunkIndex
    counts: Counter[int]
    messages: int
    lines: tuple[Line, ...]
    has_schema: bool


class Writer:
    """The records of one file. waiting: messages that are in no chunk yet."""

    def __init__(self) -> None:
        self.waiting = 0
        self._of_bus = 0
        self._facts: Mapping[str, str] = {}
        self._number = 0
        """Number of the chunk that is being filled."""
        self._chunk = RecordBuilder()
        self._compressor = zstandard.ZstdCompressor(level=LEVEL)
        self._indices: dict[int, MessageIndex] = {}
        self._first = self._last = 0
        self._channels: dict[Line, Channel] = {}
        self._written: set[Line] = set()
        """Lines whose channel is in the file, or in a chunk on its way there."""
        self._new: list[Line] = []
        self._schema: Schema | None = None
        self._has_schema = False
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts = Counter[int]()

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
        self._metadata.append(MetadataIndex(offset=offset, length=len(data), name=name))
        return data

    def add(self, line: Line, data: bytes, log_time: int, publish_time: int, sequence: int = 0) -> None:
        """Add a message to the chunk. Times in nanoseconds since 1970."""
        if not self.waiting:
            facts = {} if self._number else dict(self._facts)
            mark = msgspec.json.encode(Mark(number=self._number, of=self._facts.get("wall", ""), facts=facts))
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
        return line in self._channels or len(self._channels) < MOST_CHANNELS

    def _channel(self, line: Line) -> int:
        channel = self._channels.get(line)
        if channel is None:
            schema = SCHEMA if line.key and line.form == JSON else 0
            channel = self._channels[line] = Channel(
                id=len(self._channels) + 1, topic=line.topic, message_encoding=line.form, schema_id=schema,
                metadata=line.metadata(),
            )  # fmt: skip
        if line not in self._written:
            if channel.schema_id and not self._has_schema:
                self._has_schema = True
                self._schema = self._schema or _schema()
                self._schema.write(self._chunk)
            channel.write(self._chunk)
            self._written.add(line)
            self._new.append(line)
        return channel.id

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
            tuple(self._new),
            self._schema is not None and any(self._channels[line].schema_id for line in self._new),
        )  # fmt: skip
        self._indices, self.waiting, self._of_bus, self._new = {}, 0, 0, []
        self._number += 1
        return sealed

    def placed(self, sealed: Sealed, offset: int) -> None:
        """Note that a chunk is in the file, at this offset."""
        offsets = {channel: offset + at for channel, at in sealed.index.message_index_offsets.items()}
        self._chunks.append(replace(sealed.index, chunk_start_offset=offset, message_index_offsets=offsets))
        self._counts += sealed.counts

    def dropped(self, sealed: Sealed) -> None:
        """Note that the last chunk will never be in the file: what it told of its channels has to be told again."""
        self._number -= 1
        self._written -= set(sealed.lines)
        if sealed.has_schema:
            self._has_schema = False

    def finish(self, offset: int, checksum: int) -> bytes:
        """End of the file, to be written at this offset, behind the last chunk. checksum: of all before."""
        channels = [channel for line, channel in self._channels.items() if line in self._written]
        schemas = [] if self._schema is None else [self._schema]
        return end(Contents(schemas, channels, self._chunks, self._metadata, self._counts), offset, checksum)


class Contents(Struct):
    """Everything in a file that its end has to tell of. counts: number of messages by channel."""

    schemas: list[Schema]
    channels: list[Channel]
    chunks: list[ChunkIndex]
    metadata: list[MetadataIndex]
    counts: Counter[int]

    def statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0, channel_count=len(self.channels), channel_message_counts=dict(self.counts),
            chunk_count=len(self.chunks), message_count=self.counts.total(), metadata_count=len(self.metadata),
            message_start_time=min((each.message_start_time for each in self.chunks), default=0),
            message_end_time=max((each.message_end_time for each in self.chunks), default=0),
            schema_count=len(self.schemas),
        )  # fmt: skip


def end(contents: Contents, offset: int, checksum: int) -> bytes:
    """End of a file, to be written at this offset: where everything is, for readers that seek.

    checksum: CRC-32 of all bytes before.
    """
    data = written(DataEnd(data_section_crc=checksum))
    start = offset + len(data)
    groups: list[tuple[Opcode, Sequence[McapRecord]]] = [
        (Opcode.SCHEMA, contents.schemas),
        (Opcode.CHANNEL, contents.channels),
        (Opcode.STATISTICS, [contents.statistics()]),
        (Opcode.CHUNK_INDEX, contents.chunks),
        (Opcode.METADATA_INDEX, contents.metadata),
    ]
    summary, told = b"", b""
    for opcode, records in groups:
        begin = len(summary)
        summary += b"".join(map(written, records))
        if records:
            told += written(SummaryOffset(opcode, start + begin, len(summary) - begin))
    footer = written(Footer(summary_start=start, summary_offset_start=start + len(summary), summary_crc=0))
    crc = zlib.crc32(summary + told + footer[:-4])
    footer = written(Footer(summary_start=start, summary_offset_start=start + len(summary), summary_crc=crc))
    return data + summary + told + footer + MCAP0_MAGIC


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
