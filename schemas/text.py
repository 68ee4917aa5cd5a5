"""Text: as the bytes of a file, as a terminal shows it, and as the tokens that a voice says one by one.

Tokens are words, and characters of scripts without spaces between words. `Hello, 世界！` is three: `Hello,`,
`世`, `界！`. Punctuation and symbols belong to the token beside them; alone between spaces they are a token without
anything to say. There is no dictionary: words of Chinese or Thai are not found, only places at which a text can be
cut without cutting a syllable in two.
"""

import codecs
import re
import unicodedata
from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import Literal, NamedTuple

from engage_hri.schemas.faults import Fault, InputRefused

_MARKS = {
    codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF32_LE: "utf-32", codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16",
}  # fmt: skip
"""Byte order marks with their encodings; that of UTF-32 begins with that of UTF-16."""


def begins_with(data: bytes) -> str:
    """Return the first visible ASCII character of a text in UTF-8, UTF-16 or UTF-32; empty if there is none."""
    mark = next((mark for mark in _MARKS if data.startswith(mark)), b"")
    start = data[:256].removeprefix(mark).replace(b"\0", b"").lstrip()
    return start[:1].decode("ascii", errors="replace")


def utf8(data: bytes, source: str = "") -> str:
    """Decode the bytes of a file: UTF-8, or UTF-16 or UTF-32 with a byte order mark, as some shells write it.

    Raises InputRefused with the line.
    """
    encoding = next((encoding for mark, encoding in _MARKS.items() if data.startswith(mark)), "utf-8")
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        line = data[: error.start].decode(encoding, errors="ignore").count("\n") + 1
        found = f"byte 0x{data[error.start]:02x}, {error.reason}"
        reason = f"not {encoding.upper().removesuffix('-SIG')}: {found}"
        raise InputRefused(Fault(reason=reason, where=source, line=line, advice="save it as UTF-8")) from error


def is_utf8(text: str) -> bool:
    """Tell whether a text can be encoded. Half a character cannot: a command line that is not UTF-8 has such."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def printable(text: str) -> str:
    """Return the text on one line, without what a terminal would obey: that is written as Python escapes it."""
    return text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


Script = Literal["spaced", "ideographs", "kana", "clusters"]
"""Scripts by their tokens. clusters: a consonant of Thai, Lao, Burmese or Khmer with its vowels and marks."""

CHARACTERS_PER_WORD = 2
"""Characters of a script without spaces that take about as long to say as one word of a script with spaces."""

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
_CLOSE = re.compile(r"[.,;:!?…)\]}”’»](?!\d)|['’](?:s|d|m|ll|re|ve)\b")
"""What stands close to the word before it."""
_UNSPACED_ENDS = re.compile(rf"[{UNSPACED}{_STOPS_WIDE}{_OPENING_WIDE}」』）】》〉］｝〕]")


class Token(NamedTuple):
    """A piece of text with its script. end: characters of the text up to its end."""

    text: str
    end: int
    script: Script

    @property
    def letters(self) -> int:
        """Number of letters and digits, the letters of a Korean syllable one by one; 0: there is nothing to say."""
        text = self.text if self.text.isascii() else unicodedata.normalize("NFD", self.text)
        return sum(map(str.isalnum, text))

    @property
    def closing(self) -> str:
        """The punctuation and symbols at its end."""
        said = next((place for place in range(len(self.text), 0, -1) if self.text[place - 1].isalnum()), 0)
        return self.text[said:]


def tokens(text: str) -> Iterator[Token]:
    """Split a text into tokens, in order; together they are all of it but the white space."""
    for match in _TOKEN.finditer(text):
        script: Script = match.lastgroup or "spaced"  # type: ignore[assignment]
        yield Token(match.group(), match.end(), script)


def has_words(text: str) -> bool:
    """Tell whether a text has something to say, not only punctuation and symbols."""
    return any(map(str.isalnum, text))


@lru_cache(1024)  # the same few phrases again and again
def word_count(text: str) -> float:
    """Length of a text, in words of a script with spaces."""
    said = [token for token in tokens(text) if token.letters]
    return sum(1.0 if token.script == "spaced" else 1.0 / CHARACTERS_PER_WORD for token in said)


def joined(texts: Iterable[str]) -> str:
    """Join texts with single spaces between words; with none at brackets, stops, and in scripts without spaces."""
    whole = ""
    for text in texts:
        text = " ".join(text.split())
        is_unspaced = whole and text and _UNSPACED_ENDS.match(whole[-1]) and _UNSPACED_ENDS.match(text[0])
        is_close = is_unspaced or whole.endswith(tuple(_OPENING)) or _CLOSE.match(text)
        whole += text if not whole or not text or is_close else f" {text}"
    return whole
