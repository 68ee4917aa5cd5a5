"""Words of a block as a voice needs them: punctuation stands at the end of a phrase, and a turn ends in a low voice.

A voice can't say a comma alone. In "[the red cup], please" the phrase becomes "the red cup,", and "please" is left of
the speech. The last words of a turn are lower, a signal that it is over (thesis 3.3.1). Pure.
"""

import re
from collections.abc import Collection, Sequence

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, FragmentBehavior, Mark, Reference, Speech
from engage_hri.schemas.documents.prosody import marked_up
from engage_hri.schemas.text import tokens

_ALPHABETIC = r"""(?:['’](?:s|d|m|ll|re|ve)\b)?[.,;:!?…)\]"'”’»]*(?=\s|$)"""
_IDEOGRAPHIC = "[、。，．；：！？…）］」』】》〉]+"
"""Punctuation that needs no space behind it."""
_CLOSING = re.compile(rf"\s*({_ALPHABETIC}|{_IDEOGRAPHIC})\s*")


class MovedPunctuation(Struct, frozen=True):
    """Punctuation that was moved to phrases.

    closings: what a reference's phrase ends with, by reference. rest: what is left of a speech, by speech; None:
    nothing. follows: by speech of which nothing is left, the reference with the phrase that has its punctuation.
    """

    closings: dict[str, str]
    rest: dict[str, Speech | None]
    follows: dict[str, str]


def moved_punctuation(order: Sequence[FragmentBehavior], phrased: Collection[str]) -> MovedPunctuation:
    """Find the punctuation to move. order: that of the voice. phrased: references that are made with a phrase.

    Speech with prosodic markup is left as it is: its words stand in the text and in the markup.
    """
    result = MovedPunctuation({}, {}, {})
    before = ""
    for behavior in order:
        if isinstance(behavior, Reference):
            before = behavior.id if behavior.id in phrased else ""
        elif isinstance(behavior, Speech) and behavior.text.strip():
            match = _CLOSING.match(behavior.text)
            if before and match and match[1] and not behavior.markup:
                result.closings[before] = result.closings.get(before, "") + match[1]
                result.rest[behavior.id] = _without_start(behavior, match.end())
                if match.end() == len(behavior.text):
                    result.follows[behavior.id] = before
                    continue
            before = ""
    return result


def _without_start(speech: Speech, length: int) -> Speech | None:
    """The speech without its first `length` characters; None if nothing is left."""
    if length == len(speech.text):
        return None
    marks = tuple(Mark(mark.id, max(0, mark.position - length)) for mark in speech.marks)
    return replace(speech, text=speech.text[length:], marks=marks)


WORDS = 2
"""Last words of the turn that are lowered."""
PER_WORD = 2
"""Characters of a script without spaces that count as one word."""


def lowered(behaviors: Sequence[BlockBehavior], last: str) -> tuple[BlockBehavior, ...]:
    """Lower the end of the speech `last`. A speech with prosodic markup stays as its author wrote it."""
    return tuple(
        _lowered(each) if isinstance(each, Speech) and each.id == last and not each.markup else each
        for each in behaviors
    )


def _lowered(speech: Speech) -> Speech:
    left, start = float(WORDS), len(speech.text)
    for token in reversed(list(tokens(speech.text))):
        if not token.letters:
            continue
        start = token.end - len(token.text)
        left -= 1.0 if token.script == "spaced" else 1.0 / PER_WORD
        if left <= 0.0:
            break
    if start == len(speech.text):
        return speech
    markup = marked_up(speech.text, speech.marks, start, len(speech.text), pitch="low")
    return replace(speech, markup=markup)
