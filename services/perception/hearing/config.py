"""Settings of hearing: which sound, whose voice, and who understands the words."""

from msgspec import Struct

from engage_hri.schemas.units import Seconds, positive

PAGE = "page"
"""Source that is no device: what the pages of windows send."""


class HearingConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of hearing. Raises ValueError if out of range."""

    source: str | tuple[str, ...] = "auto"
    """The sound: a WAV file; `page`: the microphones of all pages of windows; a program that records: `parec`,
    `arecord`, `rec`, `sounddevice`; `auto`: the first of these that is here; or a command, as a list, that writes raw
    samples (16 bit, little-endian, 16 kHz)."""
    people: tuple[str, ...] = ()
    """Ids of those who speak, one for each channel of the sound; empty: there is one channel, and who speaks is the
    only person in the world, or else `visitor`. Of a page it is who sits there, and this is left out."""
    is_deaf_while_robot_speaks: bool | None = None
    """Whether nothing is heard while the robot's voice sounds. No: what the sound has of it is taken for a person's.
    Without a value it is taken out of sound that is recorded now, and left in a file."""
    pause: Seconds = 0.3
    """Silence that ends a speech."""
    recognizer: str = ""
    """Who understands the words: `sphinx`, `vosk`, `whisper`, `sherpa`, `endpoint`, or the name of another package's;
    empty: nobody, and only voices are heard."""
    language: str = "en"
    """Language of the people, as a tag."""
    model: str = ""
    """Folder of the recognizer's model, or, of an `endpoint`, the name of the model there."""
    phrases: tuple[str, ...] = ()
    """Phrases to expect. `sphinx` understands nothing else; others may ignore them."""
    turn_detector: str = ""
    """Who judges by the sound whether a person has finished: `smart-turn`, or the name of another package's; empty:
    nobody. Wants a recognizer, with whose words it is told."""
    turn_model: str = ""
    """File of the detector's model; empty: the one that `engage hearing install` has fetched."""
    address: str = ""
    """Address of an `endpoint`, up to `/v1`. Its key is that of the environment: `ENGAGE_RECOGNIZER_KEY`."""

    def __post_init__(self) -> None:
        positive(self, ("pause",))
        if self.turn_detector and not self.recognizer:
            raise ValueError("`turn_detector` wants a `recognizer`: how a turn ends is told with its words")
        if self.people and self.source == PAGE:
            raise ValueError("`people` are those of the channels of a device: who sits at a page is known")
