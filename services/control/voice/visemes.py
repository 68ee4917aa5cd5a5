"""Shapes of the mouth for speech sounds in IPA, of any language. Pure.

A sound is known by its first letter that is in a class; marks of stress, length and tone say nothing about the lips.
Classes after the phonetic description of the sounds (International Phonetic Association, Handbook, 1999): lips closed
for bilabials, the lower lip at the teeth for labiodentals, rounded for rounded vowels and [w], opening by vowel
height.
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise

from msgspec import Struct

from engage_hri.schemas.units import Seconds


class Lips(Struct, frozen=True, array_like=True):
    """A shape of the lips from `at` on, seconds from the start. opening: 0 to 1. width: -1 rounded to 1 spread."""

    at: Seconds
    opening: float
    width: float = 0.0


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


def shape(phone: str) -> tuple[float, float] | None:
    """Opening and width of the lips for a speech sound in IPA; None: its name has no letter that is known.

    A diphthong or an affricate has the shape that it begins with. French nasal vowels are letters with a mark.
    """
    return next((_SHAPES[letter] for letter in phone if letter in _SHAPES), None)


def lips(phones: Iterable[tuple[str, Seconds]], end: Seconds) -> tuple[Lips, ...]:
    """Shapes of the mouth for speech sounds with the time at which each begins. end: when the last one is over.

    In silence the mouth is closed. A diphthong changes its shape half-way.
    """
    timed = [*phones, ("", end)]
    found: list[Lips] = []
    for (name, at), (_, until) in pairwise(timed):
        if not name:
            _add(found, at, (0.0, 0.0))
            continue
        seen = [_SHAPES[letter] for letter in name if letter in _SHAPES]
        for number, each in enumerate(seen[:2]):
            _add(found, at + number * (until - at) / 2, each)
    _add(found, end, (0.0, 0.0))
    return tuple(found)


def _add(found: list[Lips], at: Seconds, shape: tuple[float, float]) -> None:
    if not found or (found[-1].opening, found[-1].width) != shape:
        found.append(Lips(at, *shape))


def loud(levels: Sequence[float], step: Seconds) -> tuple[Lips, ...]:
    """Shapes of the mouth from loudness alone, for an engine that tells no speech sounds.

    levels: 0 for silence to 1 for the loudest, one each `step` seconds.
    """
    found: list[Lips] = []
    for number, level in enumerate(levels):
        _add(found, number * step, (round(0.8 * level, 1), 0.0))
    _add(found, len(levels) * step, (0.0, 0.0))
    return tuple(found)
