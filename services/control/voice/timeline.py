"""Time line of an utterance: the seconds at which words and marks of a text are said, known before it begins."""

from collections.abc import Sequence

from msgspec import Struct

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.documents.prosody import Prosody, spans
from engage_hri.schemas.speakable import Script, Token, tokens
from engage_hri.schemas.units import Seconds

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
