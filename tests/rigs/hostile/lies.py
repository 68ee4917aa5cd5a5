"""Lies of a body about its behaviors. Pure, from chance alone; tests/rigs/hostile/service.py carries them out."""

from collections.abc import Sequence
from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Face, FaceFacs, FaceLexeme, Gesture, Pointing, Speech
from engage_hri.schemas.body import Estimate, Phase
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds
from tests.rigs.hostile.chance import Chance, happens

Status = Literal["done", "taken_over", "aborted", "failed"]
FAR = (1e9, -1e9, 1e308, -1e308, -1.0, 60.0)
WAITS = {"stroke_start", "stroke_end", "stroke", "relax"}
"""Sync points before which an honest body waits for its authority."""


class Step(Struct, frozen=True):
    """A report, `delay` seconds after the one before. off: seconds added to the true time.

    twice: it is sent twice. unasked: it names a behavior that was never asked for.
    """

    say: Literal["reached", "arrived", "word"]
    sync: str
    delay: Seconds
    off: Seconds = 0.0
    twice: bool = False
    unasked: bool = False
    waits: bool = False
    """True if it waits for its authority, as it should."""


class Lie(Struct, frozen=True, kw_only=True):
    """Course of one behavior. end: None if it never ends. end_delay: seconds after the last step.

    accept_delay: seconds until it is accepted or refused. ignores_cancel: it goes on when it is cancelled.
    cancel_delay: seconds from a cancellation to the end. afterwards: reports after the end.
    """

    refuse: bool = False
    accept_delay: Seconds = 0.0
    steps: tuple[Step, ...] = ()
    end: Status | None = "done"
    end_delay: Seconds = 0.0
    ignores_cancel: bool = False
    cancel_delay: Seconds = 0.0
    afterwards: tuple[Step, ...] = ()


def lie(chance: Chance, behavior: BlockBehavior) -> Lie:
    """Draw what a body does with a behavior. Half of the draws are honest."""
    points = sync_points(behavior)
    if happens(chance, 0.5):
        return Lie(steps=_steps(chance, points, 1.0))
    match chance.randrange(0, 11):
        case 0:
            return Lie(refuse=True, accept_delay=_pause(chance))
        case 1:  # slow
            return Lie(steps=_steps(chance, points, chance.uniform(2.0, 10.0)), accept_delay=_pause(chance))
        case 2:  # stalled, perhaps even when it is cancelled
            reached = _steps(chance, points, 1.0)[: chance.randrange(0, len(points))]
            return Lie(steps=reached, end=None, ignores_cancel=happens(chance, 0.5), cancel_delay=_pause(chance))
        case 3:  # out of order
            steps = list(_steps(chance, points, 1.0))
            chance.shuffle(steps)
            return Lie(steps=tuple(steps))
        case 4:  # twice
            return Lie(steps=tuple(_changed(chance, step) for step in _steps(chance, points, 1.0)))
        case 5:  # after the end
            return Lie(steps=_steps(chance, points, 1.0), afterwards=_steps(chance, points, 1.0))
        case 6:  # done without its points
            return Lie(steps=_steps(chance, points, 1.0)[: chance.randrange(0, len(points))])
        case 7:
            broken = _steps(chance, points, 1.0)[: chance.randrange(0, len(points))]
            return Lie(steps=broken, end="failed", end_delay=_pause(chance))
        case 8:  # ended by itself, or by a behavior that nobody has asked for
            end: Status = chance.choice(("aborted", "taken_over"))
            return Lie(steps=_steps(chance, points, 1.0)[:1], end=end, cancel_delay=_pause(chance))
        case 9:  # late after a cut, or a cancellation
            return Lie(steps=_steps(chance, points, 3.0), cancel_delay=chance.uniform(4.0, 40.0))
    twofold = _steps(chance, (*points, *points), 0.5)
    return Lie(steps=tuple(_changed(chance, step) for step in twofold), ignores_cancel=True)


def _steps(chance: Chance, points: Sequence[str], slow: float) -> tuple[Step, ...]:
    obeys = happens(chance, 0.8)
    steps = []
    for number, sync in enumerate(points):
        delay = chance.uniform(0.0, 0.6) * slow if number else 0.0
        steps.append(Step("reached", sync, delay, waits=obeys and sync in WAITS))
    return tuple(steps)


def _changed(chance: Chance, step: Step) -> Step:
    return Step(
        chance.choice(("reached", "reached", "arrived", "word")),
        step.sync if happens(chance, 0.8) else chance.choice(("", "stroke:2", "nothing", "end", "start")),
        step.delay,
        off=chance.choice(FAR) if happens(chance, 0.3) else 0.0,
        twice=happens(chance, 0.5),
        unasked=happens(chance, 0.2),
        waits=step.waits,
    )


def _pause(chance: Chance) -> Seconds:
    return chance.choice((0.0, 0.1, 1.0, chance.uniform(0.0, 12.0)))


def estimate(chance: Chance, behavior: BlockBehavior) -> Estimate:
    """Draw an estimate of a behavior. Most are sound, and say no more of what the body then does."""
    points = sync_points(behavior)
    natural = [chance.uniform(0.0, 0.6) for _ in points[1:]]
    what = chance.randrange(0, 40)
    if what == 0:
        fault = Fault(reason="no way", where=behavior.id)
        return Estimate(behavior=behavior.id, feasible=False, warning="CANNOT_CREATE_BEHAVIOR", fault=fault)
    if what == 1:
        return Estimate(behavior=behavior.id, feasible=True)
    if what == 2:
        natural = [chance.choice((float("nan"), float("inf"), 1e308, 1e6, -1.0, 0.5)) for _ in natural]
    if what == 3:
        points = (*points[1:], *points[:1])
    shortest = longest = natural
    if what == 5:  # shortest and longest in no order
        shortest, longest = ([chance.uniform(0.0, 2.0) for _ in natural] for _ in range(2))
    phases = [
        Phase(since=since, to=to, shortest=least, natural=seconds, longest=most, hold=to in WAITS)
        for since, to, least, seconds, most in zip(points, points[1:], shortest, natural, longest, strict=False)
    ]
    named = "stranger" if what == 4 else behavior.id
    return Estimate(behavior=named, feasible=True, parts=(_part(behavior),), phases=tuple(phases))


def _part(behavior: BlockBehavior) -> str:
    match behavior:
        case Speech():
            return "voice"
        case Pointing() | Gesture():
            return "left_arm" if behavior.mode == "LEFT_HAND" else "right_arm"
        case Face() | FaceLexeme() | FaceFacs():
            return "face"
    return "head"
