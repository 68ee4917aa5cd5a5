"""Messages that the recorder itself writes into a recording, by topic: marks of chunks, clocks, losses. Pure."""

from typing import Any

from msgspec import Struct

from engage_hri.schemas.units import Seconds

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
