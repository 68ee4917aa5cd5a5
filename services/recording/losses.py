"""Losses of a recording, and the topics under which the recorder itself writes. Pure."""

from msgspec import Struct

from engage_hri.schemas.units import Seconds

CLOCK, LOST, MORE = "recording/clock", "recording/lost", "recording/more"
"""Topics of the recorder's own: offsets of clocks, messages that were lost, and all for which no channel is left."""


class Losses(Struct, frozen=True, kw_only=True):
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
