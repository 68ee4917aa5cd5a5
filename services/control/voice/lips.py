"""Shapes of the mouth for what is said: from its speech sounds, its loudness, or its letters alone. Pure.

A speech sound has the class of its first letter in IPA that is in one; marks of stress, length and tone say nothing
about the lips. Classes after the phonetic description of the sounds (International Phonetic Association, Handbook,
1999): lips closed for bilabials, the lower lip at the teeth for labiodentals, rounded for rounded vowels and [w],
opening by vowel height.

Times of all shapes in here are seconds from the start of what is said.
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise

from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import MouthShape
from engage_hri.services.control.voice.timeline import Utterance

CLASSES: dict[str, tuple[str, float, float]] = {
    "closed": ("pbmɓʘ", 0.0, 0.0),
    "lip to teeth": ("fvɱʋɸβⱱ", 0.08, 0.1),
    "rounded consonants": ("wʍɥʃʒ", 0.2, -0.6),
    "teeth": ("θðszʦʣ", 0.12, 0.35),
    "tongue tip": ("tdnlrɾɹɬɮɺɻʈɖɳɭɽʂʐ", 0.2, 0.1),
    "back of the tongue": ("kɡgŋxɣqɢɴχʁʀcɟɲçʝʎjɰʟɕʑ", 0.25, 0.15),
    "throat": ("hɦħʕʔ", 0.3, 0.0),
    "open": ("aɑæɐɶ", 0.9, 0.15),
    "open rounded": ("ɒ", 0.8, -0.35),
    "half open": ("ɛɜʌɞœ", 0.65, 0.2),
    "half open rounded": ("ɔ", 0.6, -0.5),
    "middle": ("əɚɝɘ", 0.4, 0.0),
    "half closed": ("eɤ", 0.45, 0.4),
    "half closed rounded": ("oøɵ", 0.4, -0.75),
    "spread": ("iɪɨɯ", 0.25, 0.7),
    "rounded": ("uʊyʏʉ", 0.2, -0.95),
}
"""The shape of each class of sounds, with the IPA letters in it: letters, opening, width."""
_SHAPES = {letter: (opening, width) for letters, opening, width in CLASSES.values() for letter in letters}
VOWELS: dict[str, tuple[float, float]] = {
    "a": (0.9, 0.15), "e": (0.5, 0.35), "i": (0.25, 0.65), "o": (0.5, -0.7), "u": (0.25, -0.9), "y": (0.25, 0.4),
}  # fmt: skip
"""Opening and width of the mouth for vowel letters: opening by vowel height, width by rounding."""
OTHERWISE = (0.5, 0.0)
"""The shape for a syllable whose letters say nothing."""
CLOSER = 0.15
"""Opening between two syllables."""


def lips(phones: Iterable[tuple[str, Seconds]], end: Seconds) -> tuple[MouthShape, ...]:
    """Shapes of the mouth for speech sounds with the time at which each begins. end: when the last one is over.

    In silence the mouth is closed. A diphthong changes its shape half-way.
    """
    timed = [*phones, ("", end)]
    found: list[MouthShape] = []
    for (name, at), (_, until) in pairwise(timed):
        if not name:
            _add(found, at, (0.0, 0.0))
            continue
        seen = [_SHAPES[letter] for letter in name if letter in _SHAPES]
        for number, each in enumerate(seen[:2]):
            _add(found, at + number * (until - at) / 2, each)
    _add(found, end, (0.0, 0.0))
    return tuple(found)


def _add(found: list[MouthShape], at: Seconds, shape: tuple[float, float]) -> None:
    if not found or (found[-1].opening, found[-1].width) != shape:
        found.append(MouthShape(at, *shape))


def loud(levels: Sequence[float], step: Seconds) -> tuple[MouthShape, ...]:
    """Shapes of the mouth from loudness alone, for an engine that tells no speech sounds.

    levels: 0 for silence to 1 for the loudest, one each `step` seconds.
    """
    found: list[MouthShape] = []
    for number, level in enumerate(levels):
        _add(found, number * step, (round(0.8 * level, 1), 0.0))
    _add(found, len(levels) * step, (0.0, 0.0))
    return tuple(found)


def spelled(utterance: Utterance) -> tuple[MouthShape, ...]:
    """Shapes of the mouth from letters alone, for a voice that knows its words and nothing else.

    The mouth opens once for each syllable, and is closed after each word.
    """
    shapes: list[MouthShape] = []
    for word in utterance.words:
        if word.end > word.start:
            syllables = _syllables(word.text)
            each = (word.end - word.start) / len(syllables)
            for number, (opening, width) in enumerate(syllables):
                at = word.start + number * each
                shapes += [
                    MouthShape(at + 0.15 * each, opening, width), MouthShape(at + 0.75 * each, CLOSER, width / 2),
                ]  # fmt: skip
            shapes.append(MouthShape(word.end, 0.0))
    return tuple(shapes)


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
