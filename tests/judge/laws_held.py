"""Laws about what is held: nothing begins, nothing is late for it, and words go on where they stopped."""

from collections.abc import Iterator
from itertools import pairwise

from tests.judge.case import Case, Finding
from tests.judge.laws_time import EXACT

WORD = 1.5
"""Seconds, more than any word takes."""


def held(case: Case) -> Iterator[Finding]:
    """What is held does not begin, and says no word beyond the one that it was saying."""
    if not case.is_told_true:
        return
    for id, block in case.blocks.items():
        for behavior in block.behaviors:
            for since, until in case.holds(id, behavior):
                yield from _stands(case, id, behavior, since, until)
    yield from _words(case)


def late(case: Case) -> Iterator[Finding]:
    """Nothing is late only because something was held."""
    if not case.story.is_held or not case.is_exact:
        return
    for id in case.blocks.keys() - case.record.refused_anyhow:
        for warning in case.record.late(id):
            if (id, warning.behavior) not in case.record.late_anyhow:
                yield Finding("late for a hold", id, f"{warning.behavior}: {warning.message}", warning.behavior)


def _stands(case: Case, id: str, behavior: str, since: float, until: float) -> Iterator[Finding]:
    for each in case.record.points(id):
        at = each.at.seconds
        if each.behavior == behavior and each.sync == "start" and since + EXACT < at < until - EXACT:
            text = f"{behavior} begins at {at:.3f}, and is held from {since:.3f} to {until:.3f}"
            yield Finding("moves though held", id, text, behavior)
    for word in case.record.words:
        if (word.block, word.behavior) == (id, behavior) and since + WORD < word.at.seconds < until - EXACT:
            text = f"{behavior} says {word.word!r} at {word.at.seconds:.3f}, and is held from {since:.3f}"
            yield Finding("moves though held", id, text, behavior)


def _words(case: Case) -> Iterator[Finding]:
    """No word is said twice, or before the one before it."""
    places: dict[tuple[str, str], list[int]] = {}
    for word in case.record.words:
        places.setdefault((word.block, word.behavior), []).append(word.position)
    for (block, behavior), said in places.items():
        if any(one >= other for one, other in pairwise(said)):
            yield Finding("words", block, f"{behavior}: words at {said}", behavior)
