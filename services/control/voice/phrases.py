"""Cutting of a text into phrases, each said in one go: a long text is not synthesized all at once. Pure."""

import unicodedata
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from msgspec.structs import replace

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.documents.prosody import Prosody, spans
from engage_hri.schemas.speakable import Token, has_words, tokens
from engage_hri.services.control.voice.synthesis import Phrase
from engage_hri.services.control.voice.timeline import PAUSE

ENOUGH = 120
"""Characters after which a phrase ends at the next end of a sentence; some eight seconds of English."""
LONGEST = 240
"""Characters after which it ends at the next comma, or at the next word."""
_UNHEARD = ("So", "Sk", "Cf", "Cs", "Co", "Cn", "Cc")
"""Categories of characters that are not given to an engine: emoji, which it would read out by name, and controls."""
_JOINERS = "\u200c\u200d"
"""Characters without a width that belong to the spelling of Persian and of Indian scripts."""
_SENTENCE = 0.35
"""Pause from which on punctuation ends a sentence, seconds; see `timeline.PAUSE`."""
_DENSE = 3
"""Characters of text that one character of a script without spaces counts as: it takes that much longer to say."""


class Piece(NamedTuple):
    """A phrase with its place in the whole text, in characters.

    text: as it is written there. pause: seconds of silence after it.
    """

    phrase: Phrase
    text: str
    start: int
    end: int
    pause: float


def pieces(speech: Speech, language: str = "") -> list[Piece]:
    """Cut a speech into phrases; none if it has nothing to say. language: the one where the speech names none."""
    text = speech.text
    if not has_words(text):
        return []
    prosody = spans(speech)
    cuts = list(_cuts(text))
    found = []
    for start, end in zip([0, *cuts], [*cuts, len(text)], strict=True):
        inside = tuple(_inside(prosody, start, end))
        said = _heard(text[start:end])
        pause = max((PAUSE.get(each, 0.0) for each in text[start:end].rstrip()[-3:]), default=0.0)
        found.append(Piece(Phrase(said, speech.language or language, inside), text[start:end], start, end, pause))
    return found


def _heard(text: str) -> str:
    """The text with a space instead of each character that an engine is not given, so that positions stay."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(
        " " if (unicodedata.category(each) in _UNHEARD and each not in _JOINERS) or each == "\ufe0f" else each
        for each in text
    )


def _inside(prosody: Sequence[Prosody], start: int, end: int) -> Iterator[Prosody]:
    for span in prosody:
        if (span.end > start and span.start < end) or (span.start == span.end and start <= span.start < end):
            pause = span.pause if span.start >= start else 0.0
            low, high = max(0, span.start - start), min(end, span.end) - start
            yield replace(span, start=low, end=max(low, high), pause=pause)


def _cuts(text: str) -> Iterator[int]:
    """Places at which the text is cut, in characters."""
    since, length = 0, 0
    all_tokens = list(tokens(text))
    for token, after in pairwise(all_tokens):
        length += len(token.text) * (1 if token.script == "spaced" else _DENSE)
        pause = max((PAUSE.get(each, 0.0) for each in token.closing), default=0.0)
        ends = length >= ENOUGH and pause >= _SENTENCE and _is_end(token, after)
        if ends or (length >= LONGEST and pause) or length >= 2 * LONGEST:
            place = after.end - len(after.text)
            if has_words(text[since:place]) and has_words(text[place:]):
                yield place
                since, length = place, 0


def _is_end(token: Token, after: Token) -> bool:
    """True if a sentence ends between the two tokens: not at `Dr. Smith`, `e.g. this` or `3. floor`."""
    if token.script != "spaced" or not token.closing.startswith("."):
        return True
    word = token.text.rstrip(token.closing)
    return len(word) > 3 and "." not in word and not after.text[:1].islower()
