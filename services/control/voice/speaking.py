"""Speech and waiting on loop time: the behaviors of the simulated body that move no joint."""

from collections.abc import AsyncGenerator
from math import inf

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Speech, Wait
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.body import Arrived, MovementAuthority, Progress, Reached, Spoke
from engage_hri.services.control.voice.timeline import Utterance, utter
from engage_hri.services.control.waiting import Bell

ROUNDING: Seconds = 1e-6
"""Seconds by which sums of times may be off: a voice that waits between two words is in neither."""


class _Gap(Struct, frozen=True):
    """Silence before a word, at `at` seconds from the start of the utterance."""

    at: Seconds


async def speak(behavior: Speech, authority: MovementAuthority, pace: float = 1.0) -> AsyncGenerator[Progress, None]:
    """Say a text word by word. At a mark between two words the voice pauses until it may pass the mark.

    While it is held it pauses before the next word, too. If the authority is revoked, the voice finishes the current
    word. pace: 2 takes twice as long.
    """
    bell = Bell()
    begin = bell.now()
    utterance = utter(behavior.text, pace)
    gaps = {mark.id for mark in behavior.marks if utterance.is_gap(mark.position)}
    unwatch = authority.watch(bell.ring)
    is_silent = False
    try:
        for progress in _score(behavior, utterance):
            while not bell.is_past(begin + progress.at) and authority.revoked is None:
                await bell.wait(begin + progress.at)
            arrived = at = begin + progress.at
            if isinstance(progress, _Gap):
                while authority.held and authority.revoked is None:
                    await bell.wait(inf)
                    begin = bell.now() - progress.at
                    is_silent = authority.revoked is not None
                continue
            if isinstance(progress, Reached) and progress.sync in gaps and not authority.covers(progress.sync):
                yield Arrived(progress.sync, arrived)
                while authority.revoked is None and not authority.covers(progress.sync):
                    await bell.wait(inf)
                at = bell.now()
                begin += at - arrived
                is_silent = authority.revoked is not None
            if authority.revoked is not None:
                break
            yield Reached(progress.sync, at, arrived) if isinstance(progress, Reached) else replace(progress, at=at)
        since = bell.now() - begin
        for word in () if is_silent else utterance.words:
            if authority.revoked is not None and word.start + ROUNDING < since < word.end - ROUNDING:
                while not bell.is_past(begin + word.end):
                    await bell.wait(begin + word.end)
                yield Spoke(word.text, word.position, begin + word.end)
    finally:
        unwatch()


async def wait(behavior: Wait, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
    """Let the duration of the behavior pass, and then hold until its end may be passed."""
    bell = Bell()
    begin = bell.now()
    due = begin + (behavior.duration or 0.0)
    unwatch = authority.watch(bell.ring)
    try:
        yield Reached("start", begin, begin)
        while not bell.is_past(due) and authority.revoked is None:
            await bell.wait(due)
        left = due
        if authority.revoked is None and not authority.covers("end"):
            yield Arrived("end", due)
            while authority.revoked is None and not authority.covers("end"):
                await bell.wait(inf)
            left = bell.now()
        if authority.revoked is None:
            yield Reached("end", left, due)
    finally:
        unwatch()


def _score(behavior: Speech, utterance: Utterance) -> list[Reached | Spoke | _Gap]:
    """List all that the voice is going to report in time order, seconds from its start, and the gaps before words.

    Reports of one instant are in the order of the text: a word, the mark after it, the gap before the next.
    """
    last = len(behavior.text)
    score: list[tuple[Seconds, int, Reached | Spoke | _Gap]] = [(0.0, -1, Reached("start", 0.0, 0.0))]
    score += [(word.end, word.position, Spoke(word.text, word.position, word.end)) for word in utterance.words]
    for mark in sorted(behavior.marks, key=lambda mark: mark.position):
        at = utterance.said_by(mark.position)
        score.append((at, mark.position, Reached(mark.id, at, at)))
    said = [word for word in utterance.words if word.end > word.start]
    score += [(word.start, word.position - len(word.text), _Gap(word.start)) for word in said]
    score.append((utterance.seconds, last, Reached("end", utterance.seconds, utterance.seconds)))
    return [progress for _, _, progress in sorted(score, key=lambda each: each[:2])]
