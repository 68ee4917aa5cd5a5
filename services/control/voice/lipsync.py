"""Shapes of the mouth for a voice that knows its words alone, in step with it as it waits and goes on. Pure."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Arrived, MouthShape, MovementAuthority, Progress, Reached, Spoke
from engage_hri.services.control.voice.timeline import Utterance, Word

VOWELS: dict[str, tuple[float, float]] = {
    "a": (0.9, 0.15), "e": (0.5, 0.35), "i": (0.25, 0.65), "o": (0.5, -0.7), "u": (0.25, -0.9), "y": (0.25, 0.4),
}  # fmt: skip
"""Opening and width of the mouth for vowel letters: opening by vowel height, width by rounding."""
OTHERWISE = (0.5, 0.0)
"""The shape for a syllable whose letters say nothing."""
CLOSER = 0.15
"""Opening between two syllables."""


def mouth_shapes(utterance: Utterance, begin: Seconds) -> tuple[MouthShape, ...]:
    """Shapes for the words of an utterance that begins then: the mouth opens once for each syllable."""
    shapes: list[MouthShape] = []
    for word in utterance.words:
        shapes += _shapes_of(word, begin)
    return tuple(shapes)


def _shapes_of(word: Word, begin: Seconds) -> list[MouthShape]:
    if word.end <= word.start:
        return []
    syllables = _syllables(word.text)
    each = (word.end - word.start) / len(syllables)
    shapes = []
    for number, (opening, width) in enumerate(syllables):
        at = begin + word.start + number * each
        shapes += [MouthShape(at + 0.15 * each, opening, width), MouthShape(at + 0.75 * each, CLOSER, width / 2)]
    return [*shapes, MouthShape(begin + word.end, 0.0)]


def _syllables(text: str) -> list[tuple[float, float]]:
    """The shape of each group of vowel letters; of a word without any, one of its own."""
    found: list[tuple[float, float]] = []
    was_vowel = False
    for letter in text.lower():
        is_vowel = letter in VOWELS
        if is_vowel and not was_vowel:
            found.append(VOWELS[letter])
        was_vowel = is_vowel
    # An e at the end of an English word is mute, if there is another vowel.
    if len(found) > 1 and text.rstrip(".,;:!?").lower().endswith("e"):
        found.pop()
    return found or [OTHERWISE]


class LipSync:
    """Lips of a voice: told what it reports, and when its authority changes. move: takes the shapes to come."""

    def __init__(
        self,
        behavior: Speech,
        utterance: Utterance,
        authority: MovementAuthority,
        now: Callable[[], Seconds],
        move: Callable[[Sequence[MouthShape]], None],
    ) -> None:
        self._utterance = utterance
        self._times = {"start": 0.0, **{mark.id: utterance.said_by(mark.position) for mark in behavior.marks}}
        self._authority = authority
        self._now = now
        self._move = move
        self._begin: Seconds | None = None
        self._silent_from: Seconds | None = None
        """Seconds from the start at which it falls silent, since it is held."""

    @contextmanager
    def following(self) -> Iterator[None]:
        """Follow the authority during the body of `with`. The mouth is closed after it, however it ends."""
        unwatch = self._authority.watch(self.authority_changed)
        try:
            yield
        finally:
            unwatch()
            self._move(())

    def hear(self, progress: Progress) -> None:
        """Follow what the voice reports."""
        match progress:
            case Arrived():
                self._move(())
            case Reached(sync=sync, at=at, arrived=arrived) if sync in self._times:
                if self._begin is None or at > arrived:
                    self._begin = at - self._times[sync]
                    self._go_on()
            case Spoke() | Reached():
                pass

    def authority_changed(self) -> None:
        """Fall silent at the end of the word, or go on, as the authority has changed."""
        if self._begin is None:
            return
        stops, now = self._authority.held or self._authority.revoked is not None, self._now()
        if stops and self._silent_from is None:
            since = now - self._begin
            said = [word.end for word in self._utterance.words if word.start < since]
            self._silent_from = max([since, *said[-1:]])
            self._tell(until=self._silent_from)
        elif not stops and self._silent_from is not None:
            coming = [word.start for word in self._utterance.words if word.start >= self._silent_from]
            if coming and now - self._begin > coming[0]:
                self._begin = now - coming[0]
            self._silent_from = None
            self._go_on()

    def _go_on(self) -> None:
        if self._silent_from is None:
            self._tell()

    def _tell(self, until: Seconds | None = None) -> None:
        assert self._begin is not None
        now, shapes = self._now(), mouth_shapes(self._utterance, self._begin)
        begun = [each for each in shapes if each.at <= now]
        coming = [each for each in shapes if each.at > now and (until is None or each.at < self._begin + until)]
        if until is not None:
            coming.append(MouthShape(self._begin + until, 0.0))
        self._move((*begun[-1:], *coming))
