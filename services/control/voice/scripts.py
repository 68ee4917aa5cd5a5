"""Scripts that eSpeak NG reads in a language, and what of a text it spells there letter by letter. Pure.

What it does was asked of its versions 1.51 and 1.52: a word that it reads has one main stress, one that it spells has
one for each letter. `tests/control/test_unread_scripts.py` asks the engine that is installed, for all its voices.
"""

import unicodedata
from collections.abc import Iterator, Mapping
from functools import lru_cache
from itertools import groupby
from typing import NamedTuple

from engage_hri.schemas.documents.prosody import Prosody

READ_IN: Mapping[str, tuple[str, ...]] = {
    "ARABIC": ("ar", "fa", "ur", "sd", "ug"),
    "CJK": ("zh", "cmn", "yue"),
    "CYRILLIC": (
        "ru", "uk", "bg", "sr", "mk", "kk", "ky", "tt", "be", "ba", "bs", "cv", "hr", "hbs", "ka", "lfn", "ltg",
        "lv", "nog", "uz",
    ),
    "ETHIOPIC": ("am", "ti"),
    "HEBREW": ("he", "iw"),
    "HIRAGANA": ("ja",),
    "KATAKANA": ("ja",),
    "KHMER": (),
    "LAO": (),
    "MONGOLIAN": (),
    "MYANMAR": ("my",),
    "ORIYA": ("or",),
    "SYRIAC": (),
    "TELUGU": ("te",),
    "THAANA": (),
    "THAI": ("th",),
    "TIBETAN": (),
}  # fmt: skip
"""Languages in which it reads a script, the most usual one first. Scripts that are not here it reads in every one:
it takes the voice of another language for Armenian, Georgian, Korean and most of those of India."""
UNREAD_IN: Mapping[str, tuple[str, ...]] = {
    "GREEK": ("en", "af", "bs", "hbs", "hr", "lt", "mk", "sr", "vi"),
    "LATIN": ("ja", "ba", "cv", "hyw", "kok", "ky", "my", "nog", "shn"),
}
"""Languages in which it spells a script that it reads in all the others."""
_OTHERWISE: Mapping[str, str] = {"GREEK": "el", "LATIN": "en"}
_SYLLABLES = ("CJK", "HIRAGANA", "KATAKANA")
"""Scripts of which one character may be a word."""
_IN_WORDS: Mapping[str, str] = {
    "CJK": "Chinese characters", "MYANMAR": "Burmese", "ETHIOPIC": "Ethiopic", "ORIYA": "Odia", "THAANA": "Thaana",
}  # fmt: skip


class Unread(NamedTuple):
    """The first word of a text in a script that is not read in its language."""

    word: str
    script: str
    language: str


@lru_cache(256)  # of a plan the same speeches are estimated again and again
def unread(text: str, language: str, prosody: tuple[Prosody, ...] = ()) -> tuple[Unread, ...]:
    """Find what of a text is in scripts that eSpeak NG does not read, one word for each script and language.

    language: the tag of the text, such as `en-us`. prosody: spans of it, some of which may be in another language.
    """
    found: dict[tuple[str, str], Unread] = {}
    for start, word, script in _words(text):
        spoken = next(
            (each.language for each in prosody if each.language and each.start <= start < each.end), language
        )
        if not is_read(script, spoken):
            found.setdefault((script, spoken), Unread(word, script, spoken))
    return tuple(found.values())


def is_read(script: str, language: str) -> bool:
    """Tell whether a script is read in a language, and not spelled. script: as characters are named in Unicode."""
    own = language.replace("_", "-").lower().partition("-")[0]
    if script in UNREAD_IN:
        return own not in UNREAD_IN[script]
    return script not in READ_IN or own in READ_IN[script]


def told(each: Unread) -> str:
    """Say what happens with a word, and what to do about it."""
    name = _IN_WORDS.get(each.script, each.script.capitalize())
    languages = READ_IN.get(each.script) or (_OTHERWISE.get(each.script, ""),)
    if each.script == "CJK" and each.language.lower().startswith("ja"):
        advice = "write it in kana"
    elif languages[0]:
        advice = f"it does in {languages[0]!r}: give the speech its xml:lang, or set control.drivers.espeak.language"
    else:
        advice = "it does in none: another voice is needed"
    return (
        f"eSpeak NG spells {each.word!r}, since it does not read {name} in the language {each.language!r}; {advice}"
    )


def _words(text: str) -> Iterator[tuple[int, str, str]]:
    """The words of a text that are not in one of the scripts that are read anywhere: start, word, script."""
    for script, run in groupby(enumerate(text), key=lambda at: _script(at[1])):
        letters = list(run)
        start, word = letters[0][0], "".join(each for _, each in letters)
        is_word = len(word) > 1 or script in _SYLLABLES
        if script and is_word and not (script == "LATIN" and word.isupper()):  # such as TV
            yield start, word, script


def _script(character: str) -> str:
    """The script of a letter: names of characters begin with it in Unicode. Empty: it is no letter."""
    if unicodedata.category(character)[0] not in "LM":
        return ""
    name = unicodedata.name(character, "")
    return name.partition(" ")[0] if character.isalpha() or name.split(" ")[0] in READ_IN else ""
