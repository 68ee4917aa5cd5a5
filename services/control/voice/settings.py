"""Settings of a voice that sounds: where its sound goes, and how it speaks where a text does not say."""

from msgspec import Struct

from engage_hri.schemas.units import Seconds


class VoiceSettings(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of every voice with a synthesizer.

    device: `auto`: the first player program that is installed; `none`: no sound device; else the name of one of
        `player.PLAYERS`. In virtual time there is no device.
    player: the command of another player program, which takes raw samples on its standard input, 16 bit, little-
    endian, one channel; `{rate}` stands for the samples per second.
    latency: seconds from the moment at which the player gets a sample until it sounds; None: what is usual for it.
    file: a WAV file for all that is said, each at its loop time; empty: none.
    language: a tag such as `de`, where the text does not name its language (`xml:lang`); empty: the voice's own.
    patience: seconds that a plan may wait for a phrase that was never said before. What is not there by then is
        estimated from its length.
    phrase_limit: seconds that the synthesizer may take for one phrase of at most some 240 characters. One that takes
        longer is ended, and the speech that waits for it fails; the next speech has another one.
    """

    device: str = "auto"
    player: tuple[str, ...] = ()
    latency: Seconds | None = None
    file: str = ""
    language: str = ""
    patience: Seconds = 0.1
    phrase_limit: Seconds = 5.0

    def __post_init__(self) -> None:
        if self.latency is not None and not 0.0 <= self.latency <= 1.0:
            raise ValueError(f"latency is {self.latency}: expected 0..1 s")
        if not 0.0 <= self.patience <= 5.0:
            raise ValueError(f"patience is {self.patience}: expected 0..5 s")
        if not 0.1 <= self.phrase_limit <= 60.0:
            raise ValueError(f"phrase_limit is {self.phrase_limit}: expected 0.1..60 s")
