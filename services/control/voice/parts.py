"""Parts of a speech in time: a text is said part by part, and a part may come only while the one before it is said.

A silent voice has one part, with the words in time alone; one that sounds has a part for each phrase. What is to come
in a part are items in time order: words, marks, and where sound is handed over. Pure.
"""

from array import array
from collections.abc import Sequence

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.text import tokens
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Reached, Spoke
from engage_hri.services.control.voice.clauses import Clause
from engage_hri.services.control.voice.timeline import Piece, Utterance, Word, utter, uttered
from engage_hri.services.control.voice.visemes import Lips


class Part(Struct, frozen=True):
    """A part of a speech. Its words have their places in the whole text, and times from the start of the part.

    end: characters of the text up to its end. pause: seconds of silence after it.
    samples: 16 bit, little-endian, one channel; empty: it is silent. rate: samples per second.
    """

    utterance: Utterance
    end: int
    pause: Seconds = 0.0
    lips: tuple[Lips, ...] = ()
    samples: bytes = b""
    rate: int = 0


def silent(speech: Speech, pace: float = 1.0) -> Part:
    """The one part of a speech that is said in silence. pace: 2 takes twice as long."""
    return Part(uttered(speech, pace), len(speech.text))


def sounding(piece: Piece, clause: Clause) -> Part:
    """The part of a phrase that was synthesized."""
    whole = Utterance(_as_written(piece, clause.words), clause.seconds)
    return Part(whole, piece.end, piece.pause, clause.lips, clause.samples, clause.rate)


def expected(piece: Piece, pace: float) -> Part:
    """The part that a phrase will be, for as long as it is not synthesized. pace: 2 takes twice as long."""
    modelled = utter(piece.phrase.text, pace, piece.phrase.prosody)
    return Part(Utterance(_as_written(piece, modelled.words), modelled.seconds), piece.end, piece.pause)


def _as_written(piece: Piece, said: Sequence[Word]) -> tuple[Word, ...]:
    """The words of a phrase as they stand in the text, where there is more: an emoji is not given to the engine."""
    words: list[Word] = []
    number, now = 0, 0.0
    for token in tokens(piece.text):
        begin = token.end - len(token.text)
        since = until = None
        while number < len(said) and said[number].position <= token.end:
            word = said[number]
            number += 1
            if word.position - len(word.text) >= begin:
                since, until = (word.start if since is None else since), word.end
        start, now = (now, now) if since is None or until is None else (since, max(now, until))
        words.append(Word(token.text, min(start, now), now, piece.start + token.end))
    return tuple(words)


def joined(parts: Sequence[Part]) -> Utterance:
    """The whole speech: its parts one after the other; at least one."""
    words: list[Word] = []
    begin = 0.0
    for part in parts:
        words += [replace(word, start=word.start + begin, end=word.end + begin) for word in part.utterance.words]
        begin += part.utterance.seconds + part.pause
    return Utterance(tuple(words), begin - parts[-1].pause)


FADE: Seconds = 0.004
"""Seconds in which sound fades where it is cut between two words, so that it does not click."""


class Gap(Struct, frozen=True):
    """Silence before a word.

    part: the number of its part. since, until: seconds in the part, from this word to the next one. word: its end.
    """

    part: int
    since: Seconds
    until: Seconds
    word: "Item"


class More(Struct, frozen=True):
    """The place at which the next part has to be ready. part: its number."""

    part: int


class Cut(Struct, frozen=True):
    """The place from which on sound is taken back that was handed over. tail: the faded samples before it."""

    tail: bytes


class Item(Struct, frozen=True):
    """A thing that is to come at `at`, seconds from the start of the utterance.

    is_gap: of a mark between two words.
    """

    at: Seconds
    what: Reached | Spoke | Gap | More | Cut
    is_gap: bool = False


def faded(samples: bytes) -> bytes:
    """Let samples end in silence."""
    values = array("h", samples)
    count = len(values)
    return array("h", [value * (count - place) // count for place, value in enumerate(values)]).tobytes()


def items_of(behavior: Speech, part: Part, number: int, start: int, base: Seconds) -> list[Item]:
    """List all that is to come in a part, in time order. start: characters of the text before it.

    Reports of one instant are in the order of the text: a word, the mark after it, the gap before the next.
    """
    last, utterance = len(behavior.text), part.utterance
    is_last = part.end >= last
    score: list[tuple[Seconds, int, Item]] = []
    if number == 0:
        score.append((0.0, -1, Item(0.0, Reached("start", 0.0, 0.0))))
    told = {}
    for word in utterance.words:
        told[word.position] = Item(base + word.end, Spoke(word.text, word.position, word.end))
        score.append((word.end, word.position, told[word.position]))
    for mark in sorted(behavior.marks, key=lambda mark: mark.position):
        if start <= mark.position < part.end or (is_last and mark.position >= part.end):
            at = utterance.said_by(mark.position)
            item = Item(base + at, Reached(mark.id, at, at), utterance.is_gap(mark.position))
            score.append((at, mark.position, item))
    said = [word for word in utterance.words if word.end > word.start]
    following = [word.start for word in said[1:]] + [utterance.seconds] * bool(said)
    for word, until in zip(said, following, strict=True):
        gap = Gap(number, word.start if word is not said[0] else 0.0, until, told[word.position])
        score.append((word.start, word.position - len(word.text), Item(base + word.start, gap)))
    if is_last:
        end = Item(base + utterance.seconds, Reached("end", 0.0, 0.0))
        score.append((utterance.seconds, last, end))
    else:
        after = utterance.seconds + part.pause
        score.append((after, part.end, Item(base + after, More(number + 1))))
    return [item for _, _, item in sorted(score, key=lambda each: each[:2])]
