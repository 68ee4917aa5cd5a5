"""Prosody of the end of a turn: its last words are lower, a signal that it is over (thesis 3.3.1). Pure."""

from collections.abc import Sequence

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Speech
from engage_hri.schemas.documents.prosody import marked_up
from engage_hri.schemas.text import tokens

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
