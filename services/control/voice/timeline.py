"""Time line of an utterance: the seconds at which words and marks of a text are said, known before it begins.

A long text is cut into phrases, each said in one go: it is not synthesized all at once. Pure.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.documents.prosody import Prosody, spans
from engage_hri.schemas.text import Script, Token, has_words, tokens
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.voice.synthesis import Phrase
from engage_hri.services.text.ends import ends

BEFORE_WORD: Seconds = 0.12
PER_LETTER: Seconds = 0.05
"""Seconds for each letter, besides `BEFORE_WORD` for the word: a word of 4.6 letters takes 0.35 s."""
PER_TOKEN: dict[Script, Seconds] = {"ideographs": 0.22, "kana": 0.15, "clusters": 0.14}
"""Seconds for a token of a script without spaces. Mandarin has 5.2 syllables a second, Japanese 7.8 (Pellegrino,
Coupé and Marsico, Language 87, 2011), each without pauses; a syllable of Thai is about one and a half clusters."""
PAUSE = {
    ",": 0.2, ";": 0.25, ":": 0.25, ".": 0.35, "!": 0.35, "?": 0.35, "…": 0.5, "—": 0.25, "–": 0.25,
    "，": 0.2, "、": 0.2, "､": 0.2, "；": 0.25, "：": 0.25, "。": 0.35, "｡": 0.35, "．": 0.35, "！": 0.35, "？": 0.35,
    "،": 0.2, "؛": 0.25, "؟": 0.35, "۔": 0.35, "।": 0.35,
}  # fmt: skip
"""Seconds of silence after punctuation, but for the last of a text."""


class Word(Struct, frozen=True):
    """A word said from `start` to `end`, seconds from the utterance's start.

    position: characters of the text up to its end. In a script without spaces each character is a word. A token
    that cannot be said, such as an emoji, takes no time.
    """

    text: str
    start: Seconds
    end: Seconds
    position: int


class Utterance(Struct, frozen=True):
    words: tuple[Word, ...]
    seconds: Seconds

    def said_by(self, position: int) -> Seconds:
        """Seconds until `position` characters of the text are said; between two words: until the next begins."""
        previous = Word("", 0.0, 0.0, 0)
        for word in self.words:
            first = word.position - len(word.text)
            if position <= first:
                return word.start if position == first else previous.end
            if position < word.position:
                return word.start + (word.end - word.start) * (position - first) / len(word.text)
            previous = word
        return self.seconds

    def is_gap(self, position: int) -> bool:
        """True if `position` characters into the text the voice is within no word, and could pause."""
        return not any(
            word.position - len(word.text) < position < word.position for word in self.words if word.end > word.start
        )


def uttered(speech: Speech, pace: float = 1.0) -> Utterance:
    """Lay the text of a speech out in time, with what its markup says of rate and pauses. pace: as of `utter`."""
    return utter(speech.text, pace, spans(speech))


def utter(text: str, pace: float = 1.0, prosody: Sequence[Prosody] = ()) -> Utterance:
    """Lay `text` out in time. pace: 2 takes twice as long. prosody: spans of the text, in order.

    Of a pause of punctuation and one of a span at the same place the longer counts, as eSpeak NG has it; silence of
    punctuation is as fast as the words before it.
    """
    words: list[Word] = []
    now = silence = pause = 0.0
    is_speaking = False
    ahead = list(reversed(prosody))
    rate, until = 1.0, 0
    for token in tokens(text):
        while ahead and ahead[-1].start < token.end:
            span = ahead.pop()
            pause = max(pause, span.pause * pace)
            rate, until = (span.rate, span.end) if span.end > span.start else (rate, until)
        if token.end - len(token.text) >= until:
            rate = 1.0
        seconds = natural(token) * pace / rate
        start = now + max(silence, pause) if seconds else now
        now = start + seconds
        words.append(Word(token.text, start, now, token.end))
        is_speaking = is_speaking or seconds > 0
        if seconds:
            silence = pause = 0.0
        if is_speaking:
            closing = max((PAUSE.get(each, 0.0) for each in token.closing), default=0.0)
            silence = max(silence, closing * pace / rate)
    last = max((span.pause * pace for span in ahead), default=pause)
    return Utterance(tuple(words), now + last) if is_speaking else Utterance((), 0.0)


def natural(token: Token) -> Seconds:
    """Seconds that a token takes by itself, at natural pace."""
    if not token.letters:
        return 0.0
    return PER_TOKEN.get(token.script, BEFORE_WORD + PER_LETTER * token.letters)


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
