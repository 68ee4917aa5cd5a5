"""Recordings made in tests: of samples, and of whole runs in memory and virtual time."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from zlib import crc32

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message, encode, encoding_of, published
from engage_hri.services.bus.interface import Sample
from engage_hri.services.recording.form import StoredForm, kept
from engage_hri.services.recording.reading import BILLION, Recording
from engage_hri.services.recording.writing import Line, Writer

WALL = 1_700_000_000 * BILLION
FACTS = {"format": "1", "robot": "robot", "clock": "loop", "began": "0.0", "wall": str(WALL)}


def sample(
    key: str, message: Message, at: float, *, source: str = "there", life: str = "1", number: int = 1
) -> Sample:
    payload, encoding = (encode(message), encoding_of(message)) if keys.is_presence(key) else published(key, message)
    return Sample(key, payload, encoding, source, at, life=life, number=number, clock="loop", sent=at)


def line(one: Sample, form: StoredForm) -> Line:
    return Line(
        topic=f"robot/{one.key}", form=form.encoding, typed=form.is_typed, key=one.key, sender=one.source,
        life=one.life, clock=one.clock, encoding=one.encoding, past=one.past,
    )  # fmt: skip


def nanoseconds(at: float) -> int:
    return WALL + round(at * BILLION)


def bytes_of(samples: Sequence[Sample], chunk: int = 7, *, is_whole: bool = True, wall: int = WALL) -> bytes:
    """A file with these messages, in chunks of so many."""
    writer = Writer()
    data = writer.begin({**FACTS, "wall": str(wall)})
    for number, one in enumerate(samples, 1):
        form = kept(one)
        writer.add(line(one, form), form.data, nanoseconds(one.at), nanoseconds(one.sent), one.number)
        if number % chunk == 0 or number == len(samples):
            sealed = writer.seal()
            assert sealed is not None
            writer.placed(sealed, len(data))
            data += sealed.data
    if not is_whole:
        return data
    data += writer.told("end", {"messages": str(len(samples)), "lost": "0"}, len(data))
    return data + b"".join(writer.finish(len(data), crc32(data)))


def chunks_of(data: bytes) -> list[tuple[int, int]]:
    """Begin and end of each chunk in a whole file that has messages: the first chunk of a file has none."""
    return [(begin, end) for begin, end in records(data) if data[begin] == Opcode.CHUNK][1:]


def records(data: bytes) -> Iterator[tuple[int, int]]:
    """Begin and end of each record of an undamaged file."""
    at = len(MCAP0_MAGIC)
    while at < len(data) - len(MCAP0_MAGIC):
        end = at + 9 + int.from_bytes(data[at + 1 : at + 9], "little")
        yield at, end
        at = end


def recording(samples: Sequence[Sample], chunk: int = 7) -> Recording:
    return Recording(bytes_of(samples, chunk), "test")


def all_of(recording: Recording) -> list[Sample]:
    return [recording.sample(number) for number in range(len(recording))]


def saved(path: Path, samples: Sequence[Sample], chunk: int = 7) -> Path:
    path.write_bytes(bytes_of(samples, chunk))
    return path
