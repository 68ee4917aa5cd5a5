"""What directly follows a referring phrase and is no word belongs to it: a voice can't say a comma by itself."""

import re
from collections.abc import Collection, Sequence

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import FragmentBehavior, Mark, Reference, Speech

_ALPHABETIC = r"""(?:['’](?:s|d|m|ll|re|ve)\b)?[.,;:!?…)\]"'”’»]*(?=\s|$)"""
_IDEOGRAPHIC = "[、。，．；：！？…）］」』】》〉]+"
"""Without a space behind it."""
_CLOSING = re.compile(rf"\s*({_ALPHABETIC}|{_IDEOGRAPHIC})\s*")


class Joined(Struct, frozen=True):
    """closings: what a reference's phrase ends with, by reference. rest: what is left of a speech, by speech; None:
    nothing. follows: the reference whose phrase says all of a speech, by speech."""

    closings: dict[str, str]
    rest: dict[str, Speech | None]
    follows: dict[str, str]


def joined(order: Sequence[FragmentBehavior], phrased: Collection[str]) -> Joined:
    """order: of the voice. phrased: references that are made with a phrase.

    Speech with prosodic markup is left as it is: its words stand twice.
    """
    result = Joined({}, {}, {})
    before = ""
    for behavior in order:
        if isinstance(behavior, Reference):
            before = behavior.id if behavior.id in phrased else ""
        elif isinstance(behavior, Speech) and behavior.text.strip():
            match = _CLOSING.match(behavior.text)
            if before and match and match[1] and not behavior.markup:
                result.closings[before] = result.closings.get(before, "") + match[1]
                result.rest[behavior.id] = _without(behavior, match.end())
                if match.end() == len(behavior.text):
                    result.follows[behavior.id] = before
                    continue
            before = ""
    return result


def _without(speech: Speech, length: int) -> Speech | None:
    """Its text from there on."""
    if length == len(speech.text):
        return None
    marks = tuple(Mark(mark.id, max(0, mark.position - length)) for mark in speech.marks)
    return replace(speech, text=speech.text[length:], marks=marks)
