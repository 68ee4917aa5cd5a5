"""Speech and waiting on loop time: the behaviors of the simulated body that move no joint."""

from collections.abc import AsyncGenerator
from math import inf

from schemas.behaviors import Speech, Wait
from schemas.units import Seconds
from services.control.body import Arrived, Authority, Progress, Reached, Spoke
from services.control.voice import Utterance, utter
from services.control.waiting import Bell


async def speak(behavior: Speech, authority: Authority, pace: float = 1.0) -> AsyncGenerator[Progress, None]:
    """Say it word by word. Revoked, it finishes the word that it is in. pace: 2 takes twice as long."""
    bell = Bell()
    begin = bell.now()
    utterance = utter(behavior.text, pace)
    unwatch = authority.watch(bell.ring)
    try:
        for progress in _score(behavior, utterance, begin):
            while bell.now() < progress.at and authority.revoked is None:
                await bell.heard(progress.at)
            if authority.revoked is not None:
                break
            yield progress
        since = bell.now() - begin
        for word in utterance.words:
            if authority.revoked is not None and word.start < since < word.end:
                while bell.now() < begin + word.end:
                    await bell.heard(begin + word.end)
                yield Spoke(word.text, word.position, begin + word.end)
    finally:
        unwatch()


async def wait(behavior: Wait, authority: Authority) -> AsyncGenerator[Progress, None]:
    """Let its duration pass, and then hold until its end may be passed."""
    bell = Bell()
    begin = bell.now()
    due = begin + (behavior.duration or 0.0)
    unwatch = authority.watch(bell.ring)
    try:
        yield Reached("start", begin, begin)
        while bell.now() < due and authority.revoked is None:
            await bell.heard(due)
        left = due
        if authority.revoked is None and not authority.covers("end"):
            yield Arrived("end", due)
            while authority.revoked is None and not authority.covers("end"):
                await bell.heard(inf)
            left = bell.now()
        if authority.revoked is None:
            yield Reached("end", left, due)
    finally:
        unwatch()


def _score(behavior: Speech, utterance: Utterance, begin: Seconds) -> list[Reached | Spoke]:
    """Everything the voice is going to report, in time order; at one instant the word before the mark after it."""
    end = begin + utterance.seconds
    score: list[Reached | Spoke] = [Reached("start", begin, begin)]
    score += [Spoke(word.text, word.position, begin + word.end) for word in utterance.words]
    for mark in sorted(behavior.marks, key=lambda mark: mark.position):
        at = begin + utterance.said_by(mark.position)
        score.append(Reached(mark.id, at, at))
    score.append(Reached("end", end, end))
    return sorted(score, key=lambda progress: progress.at)
