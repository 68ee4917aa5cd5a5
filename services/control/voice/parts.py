"""Parts of a speech in time: a text is said part by part, and a part may come only while the one before it is said.

A silent voice has one part, with the words in time alone; one that sounds has a part for each phrase. Pure.
"""

from collections.abc import Sequence

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.speakable import tokens
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.refusals import infeasible
from engage_hri.services.control.voice.clauses import Clause
from engage_hri.services.control.voice.phrases import Piece
from engage_hri.services.control.voice.timeline import Utterance, Word, utter, uttered
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


def joined(parts: Sequence[Part], length: int) -> Utterance:
    """The whole speech: its parts one after the other. length: characters of the text."""
    if not parts:
        return Utterance((), 0.0)
    words: list[Word] = []
    begin = 0.0
    for number, part in enumerate(parts):
        words += [replace(word, start=word.start + begin, end=word.end + begin) for word in part.utterance.words]
        is_last = number == len(parts) - 1
        begin += part.utterance.seconds + (0.0 if is_last else part.pause)
    return Utterance(tuple(words), begin)


def unspeakable(behavior: Speech, fault: Fault) -> Estimate:
    """The estimate of a speech that cannot be said."""
    return infeasible(behavior.id, "CANNOT_CREATE_BEHAVIOR", replace(fault, where=behavior.id))
