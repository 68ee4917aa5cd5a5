"""Time line of an utterance: the seconds at which words and marks of a text are said, known before it begins.

A long text is cut into phrases, each said in one go: it is not synthesized all at once. Pure.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.documents.prosody import Prosody, spans
from engage_hri.schemas.text import Script, Token, has_words, tokens
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import MouthShape
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


# -- shapes of the mouth ---------------------------------------------------------------------------------------------
# A speech sound has the class of its first letter in IPA that is in one; marks of stress, length and tone say nothing
# about the lips. Classes after the phonetic description of the sounds (International Phonetic Association, Handbook,
# 1999): lips closed for bilabials, the lower lip at the teeth for labiodentals, rounded for rounded vowels and [w],
# opening by vowel height.
#
# Times of all shapes in here are seconds from the start of what is said.

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
