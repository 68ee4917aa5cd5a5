"""Random blocks that are held and then planned again for what does not concern them: all comes as without that."""

import asyncio
import random
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager

import pytest
from msgspec import Struct

from engage_hri.schemas.behaviors import (
    BlockBehavior,
    FaceLexeme,
    Gaze,
    Gesture,
    Head,
    Mark,
    Pointing,
    Posture,
    Speech,
    Wait,
)
from engage_hri.schemas.blocks import Block, BlockOutcome, SyncPointProgress, WarningFeedback
from engage_hri.services.control.config import Variability
from engage_hri.services.requests.ends import RequestRefused
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody
from tests.realizer.planning import timed
from tests.realizer.stage import Stage, before, block, stage
from tests.realizer.steering import NUMBERS, interrupt, steer
from tests.realizer.test_simulated_body import Robot, robot

KINDS: tuple[tuple[BlockBehavior, tuple[str, ...]], ...] = (
    (Wait(id="w", duration=3.0), ("start", "end")),
    (Wait(id="v", duration=1.0), ("start", "end")),
    (Speech(id="s", text="one two three four five", marks=(Mark("m", 7),)), ("start", "m", "end")),
    (Speech(id="t", text="and so on"), ("start", "end")),
    (Gesture(id="l", lexeme="BEAT", mode="LEFT_HAND"), ("start", "stroke", "end")),
    (Gesture(id="r", lexeme="WAVE", mode="RIGHT_HAND"), ("start", "stroke", "end")),
    (Pointing(id="p", target="a", mode="RIGHT_HAND"), ("start", "stroke_start", "end")),
    (Gaze(id="g", target="a"), ("start", "stroke")),
    (Gaze(id="h", target="b"), ("start", "stroke")),
    (FaceLexeme(id="f", lexeme="SMILE"), ("start",)),
    (FaceLexeme(id="e", lexeme="OPEN_MOUTH"), ("start", "stroke")),
    (Head(id="n", lexeme="NOD"), ("start", "stroke")),
    (Posture(id="u", stance="STANDING"), ("start",)),
)
"""Behaviors, and the points of each that may be timed or tied to."""
INTERRUPTED, LONG = timed(Wait(id="y", duration=50.0), start="0"), timed(Wait(id="z", duration=60.0), start="0")
"""The one that is interrupted, and one because of which all that lasts with the block does so all the same."""
EXACT = 0.01


class Story(Struct):
    """A block that is held, and then planned again."""

    block: Block
    held: tuple[str, str]
    since: float
    lasts: float
    replanned: float


class Seen(Struct):
    """What came of it: when each point came, what was dropped, what was told to be late, or warned of at all."""

    times: dict[str, float]
    dropped: tuple[str, ...]
    late: set[str]
    warned: set[str]


def story(seed: int) -> Story:
    chance = random.Random(seed)
    behaviors: list[BlockBehavior] = []
    known: list[str] = []
    operators = []
    for kind, syncs in chance.sample(KINDS, chance.randint(3, 7)):
        times = {}
        draw = chance.random()
        sync = chance.choice(syncs)
        if draw < 0.4:
            times[sync] = str(chance.choice((0.5, 1.0, 2.0, 3.0, 4.5)))
        elif draw < 0.8 and known:
            offset = chance.choice((0.0, 0.3, 1.0, -0.3, -0.5))
            ends = [each for each in known if each.endswith("end")]
            times[sync] = chance.choice(chance.choice((known, ends or known))) + (f"{offset:+}" if offset else "")
        elif draw < 0.9:
            operators.append(before(str(chance.choice((6.0, 9.0))), f"{kind.id}:{sync}"))
        behaviors.append(timed(kind, **times))
        known += [f"{kind.id}:{each}" for each in syncs]
    chance.shuffle(behaviors)
    held = chance.choice((("", ""), ("b", ""), ("b", chance.choice(behaviors).id)))
    since = chance.choice((0.1, 0.4, 0.75, 1.1, 1.6, 2.2, 3.3))
    made = block((*behaviors, INTERRUPTED, LONG), *operators)
    return Story(made, held, since, chance.choice((0.2, 1.3, 4.0)), chance.choice((0.05, 0.6, 1.7)))


async def performed(
    told: Story, stage_of: Callable[[], AbstractAsyncContextManager[Stage | Robot]], *, is_replanned: bool
) -> Seen | None:
    """What comes of it; None if the block is refused, or what is to be held has ended."""
    async with stage_of() as seen:
        began = asyncio.get_running_loop().time()
        asked = seen.ask(told.block)
        await asyncio.sleep(told.since)
        try:
            for to in ("hold", "continue"):
                await seen.requests.send(*steer(f"at-random-{next(NUMBERS)}", to, *told.held)).outcome  # type: ignore[arg-type]
                await asyncio.sleep(told.lasts if to == "hold" else told.replanned)
            if is_replanned:
                await interrupt(seen.requests, "b", INTERRUPTED.id).outcome
            outcome = await asked.outcome
        except RequestRefused:
            asked.outcome.cancel()
            return None
        assert isinstance(outcome, BlockOutcome)
    points = [each for each in seen.feedback if isinstance(each, SyncPointProgress)]
    warnings = [each for each in seen.feedback if isinstance(each, WarningFeedback)]
    ours = [each for each in points if each.behavior != INTERRUPTED.id]
    return Seen(
        {f"{each.behavior}:{each.sync}": each.at.seconds - began for each in ours},
        outcome.dropped,
        {each.behavior for each in warnings if each.kind == "LATE"},
        {each.behavior for each in warnings},
    )


def differences(told: Story, stage_of: Callable[[], AbstractAsyncContextManager[Stage | Robot]]) -> list[str]:
    """Points that come at other times because the block was planned again, and what was dropped."""
    without = run_virtual(performed(told, stage_of, is_replanned=False))
    again = run_virtual(performed(told, stage_of, is_replanned=True))
    if without is None or again is None:
        return []
    lost = sorted({*again.dropped} - {*without.dropped, INTERRUPTED.id})
    found = [f"{each} is dropped" for each in lost] + [f"{each} late" for each in sorted(again.late - without.warned)]
    for point in sorted(without.times.keys() | again.times.keys()):
        one, other = without.times.get(point, -1.0), again.times.get(point, -1.0)
        if abs(one - other) > EXACT:
            found.append(f"{point} at {other:.3f}, not {one:.3f}")
    return found


@pytest.mark.parametrize("seed", [*range(share_of(60)), 129, 1168])
def test_a_block_that_was_held_goes_on_the_same_if_it_is_planned_again(seed: int) -> None:
    assert differences(story(seed), lambda: stage(FakeBody(pauses=True))) == []


@pytest.mark.parametrize("seed", range(share_of(6)))
def test_so_it_does_with_the_simulated_body(seed: int) -> None:
    assert differences(story(seed), lambda: robot(Variability())) == []
