"""Writer of MCAP files in chunks that stand for themselves: messages in, bytes out. Pure; needs the extra `record`.

A chunk is sealed whenever its writer wants, and complete on the disk it can be read, whatever becomes of the rest:
it tells of its place in the recording, and of the channels of its messages. `mcap.writer` seals a chunk only when it
is full, which may take minutes, and tells of each channel once; so the records are put together here, each by the
library's own code.
"""

import json
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
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
from msgspec import Struct

from engage_hri.schemas.export import bundle
from engage_hri.services.recording.form import CHUNK, JSON, ChunkMark

PROFILE = "engage"
MOST_CHANNELS = 20_000
"""Number of channels that the writer keeps in memory, some 500 bytes each. MCAP has room for 65 535."""
LEVEL = 3
"""Effort of the compression, 1 to 22: at 3 some 100 MB/s."""
SCHEMA = 1
"""Id of the schema of all messages of the bus."""


class Line(Struct, frozen=True):
    """Messages that share a channel: of one key, sender, life, clock, encoding, and either past or not.

    sender: participant. past: from before the recording. form: encoding of its messages in the file. typed: as
    `is_typed` of `StoredForm`.
    """

    topic: str
    form: str
    key: str = ""
    sender: str = ""
    life: str = ""
    clock: str = ""
    encoding: str = ""
    past: bool = False
    typed: bool = False

    @classmethod
    def of(cls, channel: Channel) -> "Line":
        """The line of a channel in a file."""
        told = channel.metadata
        words = {name: told.get(name, "") for name in ("key", "sender", "life", "clock", "encoding")}
        past, typed = (told.get(name) == "true" for name in ("past", "typed"))
        return cls(channel.topic, channel.message_encoding, **words, past=past, typed=typed)

    def channel(self, id: int) -> Channel:
        told = {name: str(getattr(self, name)) for name in ("key", "sender", "life", "clock", "encoding")}
        told |= {"past": "true" if self.past else "", "typed": "true" if self.typed else ""}
        metadata = {name: value for name, value in told.items() if value}
        schema = SCHEMA if self.key and self.form == JSON else 0
        return Channel(
            id=id, topic=self.topic, message_encoding=self.form, schema_id=schema, metadata=metadata
        )  # fmt: skip


_MARKS = Line(topic=CHUNK, form=JSON)


class Sealed(Struct):
    """A chunk that is not in the file yet. index: its offsets count from its own beginning.

    counts: its messages by channel. messages: number of those of the bus.
    """

    data: bytes
    index: ChunkIndex
    counts: Counter[int]
    messages: int


class Records(Protocol):
    """Records that wait for the end of the file: a list, or a file of its own, for they grow with the recording."""

    def append(self, record: bytes, /) -> None: ...

    def __iter__(self) -> Iterator[bytes]:
        """All of them in their order, in pieces of any size."""


class Writer:
    """The records of one file. waiting: messages that are in no chunk yet."""

    def __init__(self, chunks: Records | None = None) -> None:
        """chunks: where to put what the end of the file tells of each chunk; in memory by default."""
        self.waiting = 0
        self._of_bus = 0
        self._facts: Mapping[str, str] = {}
        self._number = 0
        """Number of the chunk that is being filled."""
        self._chunk = RecordBuilder()
        self._compressor = zstandard.ZstdCompressor(level=LEVEL)
        self._indices: dict[int, MessageIndex] = {}
        self._first = self._last = 0
        self._channel_ids: dict[Line, int] = {}
        self._metadata: list[MetadataIndex] = []
        self._chunks: Records = [] if chunks is None else chunks
        self._totals = Statistics(
            attachment_count=0, channel_count=0, channel_message_counts={}, chunk_count=0, message_count=0,
            message_start_time=0, message_end_time=0, metadata_count=0, schema_count=1,
        )  # fmt: skip

    @property
    def size(self) -> int:
        """Bytes of the chunk so far, before compression."""
        return self._chunk.count

    def begin(self, facts: Mapping[str, str]) -> bytes:
        """Beginning of a file: its facts, and again in a first chunk, where they have a checksum."""
        self._facts = facts
        head = MCAP0_MAGIC + written(Header(profile=PROFILE, library="engage"))
        head += self.told(PROFILE, facts, len(head))
        _schema().write(self._chunk)
        self._mark(int(facts["wall"]))
        sealed = self.seal()
        assert sealed is not None
        self.placed(sealed, len(head))
        return head + sealed.data

    def told(self, name: str, metadata: Mapping[str, str], offset: int) -> bytes:
        """Facts about the recording, to be written at this offset."""
        data = written(Metadata(name=name, metadata=dict(metadata)))
        self._metadata.append(MetadataIndex(offset=offset, length=len(data), name=name))
        return data

    def add(self, line: Line, data: bytes, log_time: int, publish_time: int, sequence: int = 0) -> None:
        """Add a message to the chunk. Times in nanoseconds since 1970."""
        if not self.waiting:
            self._mark(log_time)
        self._add(line, data, log_time, publish_time, sequence)

    def _mark(self, now: int) -> None:
        facts = {} if self._number else dict(self._facts)
        mark = msgspec.json.encode(ChunkMark(number=self._number, of=self._facts["wall"], facts=facts))
        self._first = self._last = now
        self._add(_MARKS, mark, now, now, 0)

    def _add(self, line: Line, data: bytes, log_time: int, publish_time: int, sequence: int) -> None:
        channel = self._channel_ids.setdefault(line, len(self._channel_ids) + 1)
        index = self._indices.get(channel)
        if index is None:  # each chunk can be read without those before it
            line.channel(channel).write(self._chunk)
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

    def has_room(self, line: Line) -> bool:
        """True if a message of this line needs no further channel, or there is room for one."""
        return len(self._channel_ids) < MOST_CHANNELS or line in self._channel_ids

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
        )  # fmt: skip
        self._indices, self.waiting, self._of_bus = {}, 0, 0
        self._number += 1
        return sealed

    def placed(self, sealed: Sealed, offset: int) -> None:
        """Note that a chunk is in the file, at this offset."""
        offsets = {channel: offset + at for channel, at in sealed.index.message_index_offsets.items()}
        index = replace(sealed.index, chunk_start_offset=offset, message_index_offsets=offsets)
        self._chunks.append(written(index))
        known, begin = self._totals, index.message_start_time
        known.message_start_time = min(known.message_start_time, begin) if known.chunk_count else begin
        known.message_end_time = max(known.message_end_time, index.message_end_time)
        known.chunk_count += 1
        known.message_count += sealed.counts.total()
        for channel, number in sealed.counts.items():
            known.channel_message_counts[channel] = known.channel_message_counts.get(channel, 0) + number

    def dropped(self) -> None:
        """Note that the last chunk will never be in the file."""
        self._number -= 1

    def finish(self, offset: int, checksum: int) -> Iterator[bytes]:
        """End of the file, to be written at this offset, piece by piece: where everything is, for readers that seek.

        checksum: CRC-32 of all bytes before.
        """
        yield (data := written(DataEnd(data_section_crc=checksum)))
        start = at = offset + len(data)
        known = self._totals
        known.channel_count, known.metadata_count = len(self._channel_ids), len(self._metadata)
        groups: list[tuple[Opcode, Iterable[bytes]]] = [
            (Opcode.SCHEMA, [written(_schema())]),
            (Opcode.CHANNEL, (written(line.channel(id)) for line, id in self._channel_ids.items())),
            (Opcode.STATISTICS, [written(known)]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.METADATA_INDEX, map(written, self._metadata)),
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
