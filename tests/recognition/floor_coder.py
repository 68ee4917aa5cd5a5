"""A coder of the floor: who speaks when, and to whom the last speeches were.

Takes nothing from the code that it judges. Definitions: `Floor` in docs/protocol.md and docs/recognition.md.
"""

from collections.abc import Iterator
from itertools import pairwise
from math import inf

from engage_hri.schemas.recognition import Floor, FloorSpeech
from tests.recognition.coder import is_noise
from tests.recognition.observations import ROBOT
from tests.recognition.timeline import SAID_BEFORE, STRANGER, Timeline

LAST = 4
"""Speeches that are told when they are over."""
QUIET = 5.0
"""Seconds of silence after which all that was said is decided."""
SETTLED = 0.4
"""Seconds after which who speaks is told: a look that has just ended may only be interrupted."""
Said = tuple[str, float, float, tuple[str, ...]]
"""Who has spoken, from when to when, and to whom."""


def judged(timeline: Timeline, floors: list[Floor]) -> Iterator[str]:
    """What is told of the floor and is not so."""
    yield from _speaking(timeline, floors)
    coded = {each[:2]: each for each in ended(timeline)}
    for floor in floors:
        told = [_said(each) for each in floor.ended]
        if len({each[:2] for each in told}) < len(told):
            yield f"floor at {floor.at.seconds}: a speech twice in {told}"
        if [each[2] for each in told] != sorted(each[2] for each in told):
            yield f"floor at {floor.at.seconds}: not in the order of their ends: {told}"
    yield from _taken_back(floors)
    for at in _quiet(timeline):
        before = sorted(
            (each for each in coded.values() if each[2] < at), key=lambda each: (each[2], each[1], each[0])
        )
        told = sorted((_said(each) for each in _at(floors, at).ended), key=lambda each: (each[2], each[1], each[0]))
        expected = before[-LAST:]
        if told != expected:
            yield f"floor at {at}: told  {[each for each in told if each not in expected]}"
            yield f"floor at {at}: coded {[each for each in expected if each not in told]}"
            return


def _taken_back(floors: list[Floor]) -> Iterator[str]:
    """What was told to have been said, and is gone although not four others have ended later."""
    for one, other in pairwise(floors):
        told, then = [_said(each) for each in one.ended], [_said(each) for each in other.ended]
        still = {each[:2] for each in then}  # to whom may be corrected
        gone = [each for each in told if each[:2] not in still and sum(later[2] >= each[2] for later in then) < LAST]
        if gone:
            yield f"floor at {other.at.seconds}: told before, and not any more: {gone}"


def ended(timeline: Timeline) -> Iterator[Said]:
    """All that was said and not only sounded, with whom it was for."""
    if timeline.tells:
        yield STRANGER, *SAID_BEFORE, (ROBOT,)
    for turn in timeline.turns:
        for since, until in turn.speech:
            yield ROBOT, round(since[0], 5), round(until[0], 5), tuple(sorted(turn.to))
    for one in timeline.spans:
        if one.action == "speak" and one.to and not is_noise(one, timeline):
            yield one.who, round(one.since[0], 5), round(one.until[0], 5), (one.to,)


def _speaking(timeline: Timeline, floors: list[Floor]) -> Iterator[str]:
    """Who is told to speak at some instant, and does not, or the other way."""
    spoken = [(ROBOT, since[0], until[0]) for turn in timeline.turns for since, until in turn.speech]
    spoken += [
        (each.who, each.since[0], each.until[0])
        for each in timeline.spans
        if each.action == "speak" and not each.is_alone
    ]
    changes = sorted({at for _, since, until in spoken for at in (since, until)})
    for before, at in zip(changes, [*changes[1:], inf], strict=True):
        if at - before < SETTLED + 1e-6:
            continue
        speak = [who for since, who, until in sorted((since, who, until) for who, since, until in spoken)
                 if since <= before + SETTLED < until]  # fmt: skip
        told = [each.actor for each in _at(floors, before + SETTLED).speeches]
        if sorted(told) != sorted(speak):
            yield f"floor at {at}: {told} are told to speak, and {speak} do"
            return


def _quiet(timeline: Timeline) -> Iterator[float]:
    """Times at which nothing has been said, and no words were told, for long."""
    busy = [(since[0], until[0]) for turn in timeline.turns for since, until in turn.speech]
    busy += [
        (each.since[0], max(each.until, each.known or each.until)[0])
        for each in timeline.spans
        if each.action == "speak"
    ]
    for _, until in busy:
        at = until + QUIET
        if not any(since <= at and end > until for since, end in busy):
            yield at


def _at(floors: list[Floor], at: float) -> Floor:
    return next(each for each in reversed(floors) if each.at.seconds <= at)


def _said(each: FloorSpeech) -> Said:
    until = each.until
    assert until is not None
    return each.actor, round(each.since.seconds, 5), round(until.seconds, 5), each.to
