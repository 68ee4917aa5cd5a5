"""Arms and the table while the trunk leans: no elbow, forearm or hand comes into it, whatever begins when.

The witness looks at the forearms that the body tells, every 10 ms, and knows only where the table is.
"""

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from random import Random

import numpy as np
import pytest

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Gesture, Hand, Pointing, Posture, PostureShift
from engage_hri.schemas.body import EstimateItem, PlannedTime
from engage_hri.services.control.contract.body import BehaviorRefused, Body, BodyFailed
from engage_hri.services.control.figure.kinematics import TABLE_EDGE, TABLE_TOP
from engage_hri.services.control.figure.repertoire import BUILT_IN, extended
from engage_hri.services.control.testing import WORLD, Stage, performed
from engage_hri.services.control.torso.body import SimulatedBody
from tests.random_cases import share_of

WIDE = """
[pose]
BOW = { torso = { lean = 16, turn = -8 } }
DEEP = { torso = { lean = 25 } }
DEEP_OPEN = { torso = { lean = 25 }, arms = { inward = -40, forward = -32, elbow = 95 } }
[gesture.LOW]
ready = { inward = 0, forward = 18, elbow = 100 }
stroke = { inward = 4, forward = 20, elbow = 72 }
stroke_end = { inward = 8, forward = 14, elbow = 78 }
"""
LEANS = (
    "LEAN_FORWARD",
    "LEAN_FORWARD",
    "LEAN_BACK",
    "TURN_LEFT",
    "TURN_RIGHT",
    "BOW",
    "DEEP",
    "DEEP_OPEN",
    "UPRIGHT",
)
GESTURES = ("BEAT", "BEAT", "WAVE", "CONDUIT", "SHRUG", "PAST", "SELF", "LOW")
HANDS: tuple[Hand, ...] = ("LEFT_HAND", "RIGHT_HAND", "BOTH_HANDS")


def new_body() -> SimulatedBody:
    body = SimulatedBody(repertoire=extended(BUILT_IN, [("wide.toml", WIDE)]))
    body.see(WORLD)
    return body


def lowest(body: Body) -> float:
    """Metres by which the forearms are above the table top where they are over the table; infinite: nowhere."""
    state, low = body.state(), math.inf
    for forearm in (state.left_arm, state.right_arm):
        assert forearm is not None
        assert forearm.tip is not None
        for x, _, z in np.linspace(forearm.origin, forearm.tip, 26).tolist():
            if x > TABLE_EDGE:
                low = min(low, z - TABLE_TOP)
    return low


class Watched:
    """The lowest place so far."""

    lowest = math.inf


@asynccontextmanager
async def watched(body: Body) -> AsyncIterator[Watched]:
    seen = Watched()

    async def watch() -> None:
        while True:
            seen.lowest = min(seen.lowest, lowest(body))
            await asyncio.sleep(0.01)

    watching = asyncio.create_task(watch())
    try:
        yield seen
    finally:
        watching.cancel()


@pytest.mark.parametrize("lexeme", ["BEAT", "LOW", "CONDUIT"])
async def test_a_gesture_of_a_leaning_trunk_is_raised_as_it_was_estimated(lexeme: str) -> None:
    body = new_body()
    await performed(body, PostureShift(id="lean", lexeme="LEAN_FORWARD"))
    gesture = Gesture(id="gesture", lexeme=lexeme, mode="BOTH_HANDS")
    told = body.estimate(gesture, None, WORLD)
    async with watched(body) as seen:
        stage = Stage(body, gesture, "stroke")
        await stage.until(lambda: "stroke" in stage.passed)
        assert told.pose_after is not None
        there = {joint.joint: joint.angle for joint in body.state().pose.joints}
        stage.authority.extend("end")
        await stage.over()

    assert [there[each.joint] for each in told.pose_after.joints] == pytest.approx(
        [each.angle for each in told.pose_after.joints], abs=1e-6
    )
    assert seen.lowest > 0.005


@pytest.mark.parametrize("since", [0.0, 0.2, 0.5, 0.8, 1.5])
@pytest.mark.parametrize("through", ["start", "ready", "stroke", "end"])
async def test_a_gesture_gives_way_to_a_trunk_that_leans_later(since: float, through: str) -> None:
    body = new_body()
    async with watched(body) as seen:
        stage = Stage(body, Gesture(id="beat", lexeme="BEAT", mode="BOTH_HANDS"), through)
        await asyncio.sleep(since)
        await performed(body, PostureShift(id="lean", lexeme="LEAN_FORWARD"))
        stage.authority.extend("end")
        await stage.over()
        await asyncio.sleep(1.0)

    assert stage.passed[-1] == "end"
    assert seen.lowest > 0.005


async def test_a_trunk_that_would_take_resting_arms_into_the_table_stays() -> None:
    body = new_body()
    deep = PostureShift(id="deep", lexeme="DEEP")
    told = body.estimate(deep, None, WORLD)
    assert not told.feasible
    assert told.fault is not None
    assert "the left arm would come into the table" in told.fault.reason
    with pytest.raises(BehaviorRefused, match="the left arm would come into the table"):
        await performed(body, deep)


async def test_a_plan_with_a_lean_in_a_gesture_is_performed_as_it_was_rehearsed() -> None:
    begins = [
        (Gesture(id="beat", lexeme="BEAT", mode="BOTH_HANDS"), 0.0),
        (PostureShift(id="lean", lexeme="LEAN_FORWARD"), 0.3),
        (Pointing(id="point", target="far-left", mode="LEFT_HAND"), 2.4),
    ]
    body = new_body()
    items = [EstimateItem(behavior=each, times=(PlannedTime(sync="start", at=at),)) for each, at in begins]
    told = {each.behavior: each.phases for each in body.rehearse(items, WORLD)}
    stages, loop = {}, asyncio.get_running_loop()
    for behavior, at in begins:
        await asyncio.sleep(at - loop.time())
        stages[behavior.id] = Stage(body, behavior, "end")
    for stage in stages.values():
        await stage.over()
        at = {item.sync: item.at for item in stage.progress}
        id = next(name for name, each in stages.items() if each is stage)
        taken = [at[phase.to] - at[phase.since] for phase in told[id]]
        assert taken == pytest.approx([phase.natural for phase in told[id]], abs=1e-3), id


def arbitrary(number: int, chance: Random) -> BlockBehavior:
    id = str(number)
    kinds = (
        Gesture(id=id, lexeme=chance.choice(GESTURES), mode=chance.choice(HANDS)),
        Gesture(id=id, lexeme=chance.choice(GESTURES), mode=chance.choice(HANDS)),
        Pointing(id=id, target=chance.choice(("near-right", "far-left")), mode=chance.choice(HANDS[:2])),
        PostureShift(id=id, lexeme=chance.choice(LEANS)),
        Posture(id=id, lexeme=chance.choice(LEANS)),
    )
    return chance.choice(kinds)


async def at_random(seed: int, name: str) -> tuple[float, int, int]:
    """Begin, extend, hold and abort gestures, pointings and postures: lowest place, done and refused ones."""
    body, chance, stages = new_body(), Random(f"{name} {seed}"), []
    done = refused = lost = 0
    async with watched(body) as seen:
        for number in range(25):
            await asyncio.sleep(chance.choice((0.0, chance.uniform(0.0, 0.4), chance.uniform(0.0, 1.5))))
            live = [each for each in stages if not each.task.done()]
            act = chance.choice(("begin", "begin", "begin", "extend", "abort", "hold", "go on")) if live else "begin"
            if act == "begin":
                behavior = arbitrary(number, chance)
                stages.append(Stage(body, behavior, chance.choice(("start", "end", *sync_points(behavior)))))
                continue
            one = chance.choice(live).authority
            match act:
                case "extend":
                    one.extend(chance.choice(one.points))
                case "abort":
                    one.revoke(chance.choice(("relax", "freeze")))
                case "hold":
                    one.hold()
                case "go on":
                    one.go_on()
        for stage in stages:
            stage.authority.go_on()
            stage.authority.extend("end")
        for stage in stages:
            try:
                await stage.over()
                done += 1
            except BehaviorRefused:
                refused += 1
            except BodyFailed:
                lost += 1
        await asyncio.sleep(2.0)
    assert lost <= done, "few lose their target"
    return seen.lowest, done, refused


@pytest.mark.parametrize("seed", [*range(share_of(14)), 38, 41, 211, 242, 1006, 2096])
async def test_no_arm_comes_into_the_table_whatever_begins_when(seed: int) -> None:
    low, done, _ = await at_random(seed, "table")
    assert low > 0.0
    assert done > 3
