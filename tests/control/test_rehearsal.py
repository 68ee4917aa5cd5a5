"""A behavior is rehearsed beside what others are about: it takes the time then that it takes when it is performed."""

import asyncio
from collections.abc import Sequence
from random import Random

import pytest

from engage_hri.schemas.behaviors import (
    BlockBehavior,
    Gaze,
    GazeShift,
    Gesture,
    Head,
    Pointing,
    Posture,
    PostureShift,
)
from engage_hri.schemas.body import EstimateItem, PlannedTime
from engage_hri.services.control.config import Stall, Variability
from engage_hri.services.control.contract.body import BehaviorRefused, MovementAuthority, Reached
from engage_hri.services.control.testing import WORLD
from engage_hri.services.control.torso.body import SimulatedBody
from tests.random_cases import share_of

EXACT = 0.002
"""Seconds by which a phase may be other than rehearsed."""
TARGETS = ("near-right", "far-left")
"""The left arm comes to the second from wherever the torso is."""


class Performed:
    """A behavior that a body performs from now on. at: when it has passed its points, by the loop's clock."""

    def __init__(self, body: SimulatedBody, behavior: BlockBehavior) -> None:
        self.behavior = behavior
        self.at: dict[str, float] = {}
        self.authority = MovementAuthority(behavior, "end")
        self._body = body
        self.task = asyncio.create_task(self._run())

    async def _run(self) -> None:
        async for progress in self._body.perform(self.behavior, self.authority):
            if isinstance(progress, Reached):
                self.at[progress.sync] = progress.at

    def item(self) -> EstimateItem:
        """The behavior as the body is asked about it: it is under way, and may go to its end."""
        now = asyncio.get_running_loop().time()
        times = tuple(PlannedTime(sync=sync, at=at - now) for sync, at in self.at.items())
        return EstimateItem(behavior=self.behavior, times=times, reached=len(times))


def to_begin(behavior: BlockBehavior, seconds: float) -> EstimateItem:
    return EstimateItem(behavior=behavior, times=(PlannedTime(sync="start", at=seconds),))


def one_for(part: str, id: str, chance: Random) -> BlockBehavior:
    if part == "head":
        return Gaze(id=id, target=chance.choice(TARGETS))
    if part == "torso":
        lexeme = chance.choice(["LEAN_FORWARD", "TURN_LEFT", "LEAN_BACK"])
        return chance.choice([Posture, PostureShift])(id=id, lexeme=lexeme, part="WHOLEBODY")
    pointing = Pointing(id=id, target=TARGETS[1], mode="LEFT_HAND")
    return chance.choice([pointing, *(Gesture(id=id, lexeme=each, mode="LEFT_HAND") for each in ("WAVE", "BEAT"))])


async def rehearsed_and_performed(
    first: BlockBehavior, then: BlockBehavior, asked: float, begins: float
) -> tuple[dict[str, float], dict[str, float], dict[str, float]]:
    """Phases of `then`, which begins so long after `first`: as rehearsed, as estimated alone, and as performed.

    asked: seconds after the start of `first` at which the body is asked.
    """
    body = SimulatedBody()
    body.see(WORLD)
    earlier = Performed(body, first)
    await asyncio.sleep(asked)
    [told] = body.rehearse([to_begin(then, begins - asked)], WORLD, [earlier.item()])
    alone = body.estimate(then, None, WORLD)
    await asyncio.sleep(begins - asked)
    later = Performed(body, then)
    await asyncio.wait((earlier.task, later.task))
    if not told.feasible:
        assert isinstance(later.task.exception(), BehaviorRefused)
        return {}, {}, {}
    earlier.task.result()
    later.task.result()
    made = [later.at[phase.to] - later.at[phase.since] for phase in told.phases]
    return (
        {phase.to: phase.natural for phase in told.phases},
        {phase.to: phase.natural for phase in alone.phases},
        dict(zip([phase.to for phase in told.phases], made, strict=True)),
    )


def off(one: dict[str, float], other: dict[str, float]) -> float:
    return max((abs(one[sync] - other[sync]) for sync in one), default=0.0)


@pytest.mark.parametrize("seed", range(share_of(60)))
async def test_it_is_as_fast_as_rehearsed_beside_another_that_has_its_part_or_carries_it(seed: int) -> None:
    chance = Random(seed)
    part = chance.choice(["head", "left_arm"])
    first = one_for(chance.choice([part, "torso"]), "first", chance)
    then = one_for(part, "then", chance)
    asked = chance.uniform(0.05, 0.6)

    told, _, made = await rehearsed_and_performed(first, then, asked, asked + chance.uniform(0.05, 1.5))

    assert off(told, made) < EXACT, (first, then)


async def test_that_is_another_time_than_alone_where_the_arm_is_elsewhere_by_then() -> None:
    first = Pointing(id="first", target=TARGETS[0], mode="LEFT_HAND")
    then = Gesture(id="then", lexeme="BEAT", mode="LEFT_HAND")

    told, alone, made = await rehearsed_and_performed(first, then, 0.05, 1.2)

    assert off(told, made) < EXACT < off(alone, made)


async def test_what_is_under_way_is_told_with_the_way_home_that_another_behavior_will_change() -> None:
    body = SimulatedBody()
    body.see(WORLD)
    look = Performed(body, Gaze(id="look", target=TARGETS[0]))
    await asyncio.sleep(0.3)
    shift = GazeShift(id="shift", target=TARGETS[1])
    at = asyncio.get_running_loop().time()
    [told] = body.rehearse([look.item()], WORLD, [to_begin(shift, 0.1)])
    [without] = body.rehearse([look.item()], WORLD)
    await asyncio.sleep(0.1)
    await asyncio.gather(look.task, Performed(body, shift).task)

    end = {phase.to: phase.natural for phase in told.phases}["end"]
    assert asyncio.get_running_loop().time() > at
    assert end == pytest.approx(look.at["end"] - look.at["relax"], abs=EXACT)
    assert abs(end - without.phases[-1].natural) > 10 * EXACT


async def test_what_moves_nothing_has_no_phases() -> None:
    body = SimulatedBody()
    item = to_begin(Gaze(id="g", target=TARGETS[0]), -0.5)
    [told] = body.rehearse([EstimateItem(behavior=item.behavior, times=item.times, reached=1)], WORLD)

    assert told.feasible
    assert told.phases == ()


async def test_others_change_nothing_of_the_body() -> None:
    body = SimulatedBody()
    body.see(WORLD)
    look = Performed(body, Gaze(id="look", target=TARGETS[0]))
    await asyncio.sleep(0.2)
    before = body.state()
    others: Sequence[EstimateItem] = [
        look.item(),
        to_begin(Posture(id="p", lexeme="LEAN_BACK", part="WHOLEBODY"), 0.1),
    ]
    body.rehearse([to_begin(Gaze(id="other", target=TARGETS[1]), 0.05)], WORLD, others)

    assert body.state() == before
    await look.task
    assert list(look.at)[-1] == "end"


async def test_a_stall_to_come_is_not_rehearsed():
    """Else whoever stalls is expected to go on when the next behavior begins, and that may wait for its end."""
    body = SimulatedBody(deviations=Variability(stall=(Stall(part="head", before="stroke", seconds=3.0),)))
    body.see(WORLD)
    shake = Performed(body, Head(id="shake", lexeme="SHAKE"))
    await asyncio.sleep(0.15)
    natural = {each.to: each.natural for each in body.estimate(shake.behavior, None, WORLD).phases}

    for begins in (0.5, 2.0, 20.0):
        [told] = body.rehearse([shake.item()], WORLD, [to_begin(Gaze(id="look", target=TARGETS[0]), begins)])
        assert {each.to: each.natural for each in told.phases} == pytest.approx(natural, abs=EXACT)
    await shake.task
