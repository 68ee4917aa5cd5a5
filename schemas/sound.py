"""Sound on its way: of microphones, for those who hear what people say, and of the robot's own voice, for the pages
that play it and for those who tell it from the voices of people.

Keys of sound have a chunk that no wildcard includes (`keys.SOUND`): a recorder of everything records nobody's voice.
"""

from typing import Annotated

from msgspec import Meta, Struct

from engage_hri.schemas.units import Stamp

MOST_SAMPLES = 16 * 1024
"""Bytes of one frame: half a second at 16 kHz."""


class SoundFrame(Struct, frozen=True, kw_only=True, tag="sound_frame", omit_defaults=True):
    """stream: a short piece of sound, one channel, 16 bit, little-endian.

    A frame without samples says that what was told before is not heard from `at` on: a voice was interrupted, or a
    microphone is off.

    at: when the first sample was picked up, or is to be heard. rate: samples per second. number: counts the frames
    of this source; where one is left out, a frame was lost.
    """

    at: Stamp
    rate: Annotated[int, Meta(ge=4000, le=192_000)]
    samples: Annotated[bytes, Meta(max_length=MOST_SAMPLES)] = b""
    number: Annotated[int, Meta(ge=0)] = 0

    def __post_init__(self) -> None:
        if len(self.samples) % 2:
            raise ValueError(f"samples of {len(self.samples)} bytes: expected two for each")
