"""What a voice says one after the other: words, and characters of the scripts that write no space between words.

`Hello, 世界！` is three tokens: `Hello,`, `世`, `界！`. Punctuation and symbols belong to what they stand at; alone
between spaces they are a token in which there is nothing to say. No dictionary: where a word of Chinese or Thai ends
is not known, only between which characters nothing spoken is cut in two.
"""

import re
import unicodedata
from collections.abc import Iterable, Iterator
from typing import Literal, NamedTuple

Script = Literal["spaced", "ideographs", "kana", "clusters"]
"""clusters: a consonant of Thai, Lao, Burmese or Khmer with the vowels and marks that belong to it."""

CHARACTERS_PER_WORD = 2
"""So many characters of a script without spaces take about as long to say as a word of one with spaces."""

_IDEOGRAPHS = "\u3005-\u3007\u3105-\u312f\u3400-\u4dbf\u4e00-\u9fff\ua000-\ua48c\uf900-\ufaff\U00020000-\U0003ffff"
_KANA = "\u3041-\u3096\u309d-\u309f\u30a1-\u30fa\u30fc-\u30ff\u31f0-\u31ff\uff66-\uff9f"
_SMALL_KANA = "ぁぃぅぇぉゃゅょゎァィゥェォャュョヮ\u3099\u309a\uff67-\uff6e\uff9e\uff9f"
_THAI, _LAO = "\u0e01-\u0e3a\u0e40-\u0e4e", "\u0e81-\u0ecd\u0edc-\u0edf"
_BURMESE, _KHMER = "\u1000-\u103f\u1050-\u1059", "\u1780-\u17d3\u17d7\u17dc\u17dd"
_CLUSTERED = f"{_THAI}{_LAO}{_BURMESE}{_KHMER}"
UNSPACED = f"{_IDEOGRAPHS}{_KANA}{_CLUSTERED}"
"""The characters of scripts without spaces, for a class of a regular expression."""
_VOWELS_BEFORE = "\u0e40-\u0e44\u0ec0-\u0ec4"
_BELONGING = (
    "\u0e30-\u0e3a\u0e45\u0e47-\u0e4e\u0eb0-\u0ebc\u0ec8-\u0ecd"
    "\u102b-\u1038\u103a-\u103e\u1056-\u1059\u17b4-\u17d1\u17dd"
)
_STACKING = "\u1039\u17d2"
"""The consonant after it is written below the one before."""
_OPENING = "([{“‘«‹「『（【《〈［｛〔"
_OPENING_WIDE = "「『（【《〈［｛〔"
_STOPS_WIDE = "、。，．！？：；…｡､"
_AT_ITS_END = rf"[^\w\s{re.escape(_OPENING)}]*"
_TOKEN = re.compile(
    rf"[{re.escape(_OPENING)}]*"
    rf"(?:(?P<ideographs>[{_IDEOGRAPHS}])|(?P<kana>[{_KANA}][{_SMALL_KANA}]*)"
    rf"|(?P<clusters>[{_VOWELS_BEFORE}]*[{_CLUSTERED}](?:[{_BELONGING}]|[{_STACKING}].)*)){_AT_ITS_END}"
    rf"|[{re.escape(_OPENING)}]*[^\s{UNSPACED}{_STOPS_WIDE}{_OPENING_WIDE}]+"
    rf"(?:[{_STOPS_WIDE}]{_AT_ITS_END})?"
    rf"|[^\w\s]+"
)
_UNSPACED_ENDS = re.compile(rf"[{UNSPACED}{_STOPS_WIDE}{_OPENING_WIDE}」』）】》〉］｝〕]")


class Token(NamedTuple):
    """end: in characters of the text."""

    text: str
    end: int
    script: Script

    @property
    def letters(self) -> int:
        """Letters and digits, those of a Korean syllable one by one; 0: there is nothing to say."""
        text = self.text if self.text.isascii() else unicodedata.normalize("NFD", self.text)
        return sum(map(str.isalnum, text))

    @property
    def closing(self) -> str:
        """The punctuation and symbols at its end."""
        said = next((place for place in range(len(self.text), 0, -1) if self.text[place - 1].isalnum()), 0)
        return self.text[said:]


def tokens(text: str) -> Iterator[Token]:
    """All of the text but white space, in order."""
    for match in _TOKEN.finditer(text):
        script: Script = match.lastgroup or "spaced"  # type: ignore[assignment]
        yield Token(match.group(), match.end(), script)


def has_words(text: str) -> bool:
    """Is there anything to say, and not only punctuation and symbols?"""
    return any(map(str.isalnum, text))


def word_count(text: str) -> float:
    """How long it is, in words of a script with spaces."""
    said = [token for token in tokens(text) if token.letters]
    return sum(1.0 if token.script == "spaced" else 1.0 / CHARACTERS_PER_WORD for token in said)


def joined(texts: Iterable[str]) -> str:
    """One text after the other, with single spaces between words and none where the script writes none."""
    whole = ""
    for text in texts:
        text = " ".join(text.split())
        is_unspaced = whole and text and _UNSPACED_ENDS.match(whole[-1]) and _UNSPACED_ENDS.match(text[0])
        whole += text if not whole or not text or is_unspaced else f" {text}"
    return whole
