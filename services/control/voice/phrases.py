"""Cutting of a text into phrases, each said in one go: a long text is not synthesized all at once. Pure."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from msgspec.structs import replace

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.documents.prosody import Prosody, spans
from engage_hri.schemas.speakable import has_words, tokens
from engage_hri.services.control.voice.synthesis import Phrase
from engage_hri.services.control.voice.timeline import PAUSE
from engage_hri.services.text.ends import ends

ENOUGH = 120
"""Characters after which a phrase ends at the next end of a sentence; some eight seconds of English."""
LONGEST = 240
"""Characters after which it ends at the next comma, or at the next word."""
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
        pause = max((PAUSE.get(each, 0.0) for each in text[start:end].rstrip()[-3:]), default=0.0)
        found.append(
            Piece(Phrase(text[start:end], speech.language or language, inside), text[start:end], start, end, pause)
        )
    return found


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
        is_over = length >= ENOUGH and pause >= _SENTENCE and ends(text, token.end)
        if is_over or (length >= LONGEST and pause) or length >= 2 * LONGEST:
            place = after.end - len(after.text)
            if has_words(text[since:place]) and has_words(text[place:]):
                yield place
                since, length = place, 0
