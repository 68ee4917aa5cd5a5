"""Idle motion: human-like, within the joints' limits, and in nothing that counts."""

import asyncio
import math
from itertools import pairwise
from random import Random
from statistics import mean, median

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import FaceLexeme, FaceShift, Gaze, Pointing, Speech
from engage_hri.schemas.body import BodyPose, JointAngle, RobotState
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.contract.body import BodyState, Reached
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.alive import CLOSED, CLOSING, GIVES_WAY, OPENING, Blinks, closure
from engage_hri.services.control.testing import WORLD, Stage, performed
from engage_hri.services.control.testing.motions import recorded, violations
from engage_hri.services.control.testing.truth import CROWDS, crowded
from engage_hri.services.control.torso.body import SimulatedBody
from tests.control.directing import robot
from tests.control.watching import Bystander

LIDS, LEAN = ("left_lid", "right_lid"), ("torso_lean", "neck_pitch")
TEXT = "Please move the yellow triangle, and then the blue square."


class Shown(SimulatedBody):
    """A body whose state is what people see: with idle motion and lips."""

    def state(self) -> BodyState:
        state, added = super().state(), self.idle().added
        joints = [JointAngle(it.joint, it.angle + added.get(it.joint, 0.0)) for it in state.pose.joints]
        return replace(state, pose=BodyPose(joints=tuple(joints)))


def shown(body: SimulatedBody, joint: str) -> float:
    pose = {each.joint: each.angle for each in body.state().pose.joints}
    return pose[joint] + body.idle().added.get(joint, 0.0)


def living(kind: type[SimulatedBody] = SimulatedBody) -> SimulatedBody:
    body = kind(alive=True)
    body.see(WORLD)
    return body


# -- blinks -------------------------------------------------------------------------------------------------------


def begun(seed: int, until: float) -> list[float]:
    blinks, found, at = Blinks(seed), [], 0.0
    while (at := blinks.around(at)[1]) < until:
        found.append(at)
    return found


def test_blinks_come_as_often_and_as_unevenly_as_those_of_people() -> None:
    """17 a minute at rest, log-normal: Bentivoglio et al. 1997."""
    pauses = [after - before for seed in range(5) for before, after in pairwise(begun(seed, 3600.0))]
    logs = [math.log(pause) for pause in pauses]

    assert 60.0 / mean(pauses) == pytest.approx(17.0, rel=0.05)
    assert median(pauses) < 0.9 * mean(pauses)
    middle = mean(logs)
    spread = math.sqrt(mean((each - middle) ** 2 for each in logs))
    assert mean(((each - middle) / spread) ** 3 for each in logs) == pytest.approx(0.0, abs=0.2)
    assert min(pauses) >= CLOSING + CLOSED + OPENING


def test_blinks_are_those_of_the_seed_in_whatever_order_they_are_asked_for() -> None:
    times = [Random(5).uniform(0.0, 300.0) for _ in range(100)]
    one, other = Blinks(1), Blinks(1)

    assert [one.around(t) for t in sorted(times)] == [other.around(t) for t in sorted(times)]
    assert [one.around(t) for t in times] == [Blinks(1).around(t) for t in times]
    assert begun(1, 60.0) != begun(2, 60.0)


def test_a_lid_closes_all_the_way_and_more_quickly_than_it_opens() -> None:
    way = [closure(step / 1000) for step in range(1000)]

    assert (way[0], max(way), way[-1]) == (0.0, 1.0, 0.0)
    half = [step / 1000 for step, share in enumerate(way) if share >= 0.5]
    assert half[0] < 0.06  # half-way down
    assert CLOSING + CLOSED + OPENING - half[-1] > 1.5 * half[0]
    assert closure(-1.0) == 0.0


# -- what it may not touch ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("crowd", CROWDS)
async def test_whatever_it_does_is_the_same_with_it_and_without(crowd: str) -> None:
    """Every state, every point and its time: bit by bit."""
    stories = []
    for alive in (True, False):
        body = SimulatedBody(alive=alive)
        body.see(WORLD)
        start, samples = asyncio.get_running_loop().time(), []

        async def watch(body: SimulatedBody = body, samples: list[BodyState] = samples) -> None:
            while True:
                body.idle()
                samples.append(body.state())
                await asyncio.sleep(0.05)

        watching = asyncio.create_task(watch())
        witness = await crowded(Bystander(), body, CROWDS[crowd], Random(crowd))
        assert witness is not None
        assert await witness.close() == []
        watching.cancel()
        points = [
            (stage.behavior.id, item.sync, round(item.at - start, 9))
            for stage in witness.stages
            for item in stage.progress
            if isinstance(item, Reached)
        ]
        stories.append((points, samples))

    assert stories[0][0] == stories[1][0]
    assert len(stories[0][1]) == len(stories[1][1])
    for one, other in zip(stories[0][1], stories[1][1], strict=True):
        assert one.moving == other.moving
        here = [angle.angle for angle in one.pose.joints]
        assert here == pytest.approx([angle.angle for angle in other.pose.joints], abs=1e-9)


async def test_estimates_know_nothing_of_it() -> None:
    body, still = living(), SimulatedBody()
    still.see(WORLD)
    point = Pointing(id="p", target="near-right")
    for _ in range(20):
        await asyncio.sleep(0.37)
        assert body.idle().added
        assert body.estimate(point, None, WORLD) == still.estimate(point, None, WORLD)


async def test_breath_gives_way_to_a_hold_and_comes_back_after_it() -> None:
    body = living()
    await asyncio.sleep(0.7)
    assert set(body.idle().added) >= set(LEAN)
    stage = Stage(body, Pointing(id="p", target="near-right"), "stroke")
    await asyncio.sleep(0.01)
    body.idle()  # somebody looks: from now on it gives way
    await asyncio.sleep(GIVES_WAY + 0.01)
    for _ in range(200):
        assert not set(body.idle().added) & {*LEAN, *kinematics.joints_of("right_arm")}
        await asyncio.sleep(0.05)
    assert stage.waits_at == ["stroke_end"]
    stage.authority.extend("end")
    await stage.over()
    body.idle()
    await asyncio.sleep(2.0)
    assert max([abs(body.idle().added.get("torso_lean", 0.0)) for _ in range(3)]) > 0.0


async def test_blinks_go_on_while_the_arm_waits_and_yield_to_the_face() -> None:
    body = living()
    stage = Stage(body, Gaze(id="g", target="human"), "stroke")
    lids = await sampled(body, "left_lid", 20.0)
    assert max(lids) == pytest.approx(1.0, abs=0.02)
    stage.authority.extend("end")
    await stage.over()

    face = Stage(body, FaceLexeme(id="f", lexeme="WIDEN_EYES"), "stroke")
    await asyncio.sleep(0.01)
    body.idle()
    await asyncio.sleep(1.0)
    for _ in range(600):
        assert not set(body.idle().added) & {*LIDS, "left_brow", "left_mouth_corner", "lips"}
        await asyncio.sleep(0.05)
    face.authority.extend("end")
    await face.over()
    await asyncio.sleep(2.0)
    assert max(await sampled(body, "left_lid", 20.0)) == pytest.approx(1.0, abs=0.02)


async def test_an_expression_that_stays_is_where_it_blinks_from() -> None:
    body = living()
    await performed(body, FaceShift(id="f", lexeme="WIDEN_EYES", amount=1.0))
    await asyncio.sleep(3.0)
    lids = await sampled(body, "left_lid", 30.0)

    assert min(lids) == pytest.approx(-0.475, abs=1e-9)
    assert max(lids) == pytest.approx(1.0, abs=0.02)


async def test_the_eyes_stay_where_they_are_as_it_breathes() -> None:
    body = living(Shown)
    still = SimulatedBody().state().gaze
    assert still is not None
    leans = []
    for _ in range(200):
        await asyncio.sleep(0.05)
        ray = body.ray_at("head", body.state().pose)
        assert ray is not None
        assert math.degrees(math.dist(ray.axis, still.axis)) < 0.01
        assert math.dist(ray.origin, still.origin) < 0.004
        leans.append(math.degrees(shown(body, "torso_lean")))

    assert max(leans) > 0.2
    assert min(leans) < -0.2


async def sampled(body: SimulatedBody, joint: str, seconds: float) -> list[float]:
    found = []
    for _ in range(round(seconds / 0.02)):
        found.append(shown(body, joint))
        await asyncio.sleep(0.02)
    return found


@pytest.mark.parametrize("seed", range(3))
async def test_all_of_it_keeps_the_limits_of_the_joints(seed: int) -> None:
    body, chance = living(Shown), Random(seed)
    async with recorded(body) as recording:
        for number in range(12):
            stages = [Stage(body, Speech(id=f"s{number}", text=TEXT), "end")]
            if chance.random() < 0.7:
                lexeme = chance.choice(("SMILE", "OPEN_MOUTH", "WIDEN_EYES", "CLOSE_EYES", "JOY", "SURPRISE"))
                await asyncio.sleep(chance.uniform(0.0, 1.0))
                stages.append(Stage(body, FaceLexeme(id=f"f{number}", lexeme=lexeme), "end"))
            await asyncio.sleep(chance.uniform(0.0, 3.0))
            if chance.random() < 0.5:
                stages[0].authority.revoke()
            for stage in stages:
                await stage.over()
            await asyncio.sleep(chance.uniform(0.0, 2.0))

    assert violations(recording, body.capabilities.joints) == []


# -- on the bus ---------------------------------------------------------------------------------------------------


async def states(hub: MemoryHub, key: str, seconds: float, **settings: object) -> list[RobotState]:
    hears = (keys.ROBOT_MOTION,) if key == keys.ROBOT_MOTION else ()
    async with robot(hub, hears=hears, **settings) as client:
        with client.bus.subscribe(key) as inbox:
            await asyncio.sleep(seconds)
            found = []
            while len(inbox):
                received = await inbox.next()
                assert received is not None
                found.append(received.message)
    return found


async def test_blinks_that_nobody_follows_cost_no_message(hub: MemoryHub) -> None:
    told = await states(hub, keys.ROBOT_STATE, 60.0)

    assert len(told) == pytest.approx(60, abs=2)
    assert len({each.pose for each in told}) == 1


async def test_who_follows_sees_it_blink(hub: MemoryHub) -> None:
    told = await states(hub, keys.ROBOT_MOTION, 60.0)
    lids = [{it.joint: it.angle for it in each.pose.joints}["left_lid"] for each in told]

    blinks = sum(before < 0.5 <= after for before, after in pairwise(lids))
    assert blinks == pytest.approx(len(begun(0, 60.0)), abs=2)
    assert 240 < len(told) < 500  # 4 a second, and 20 in a blink
    assert len(await states(hub, keys.ROBOT_MOTION, 60.0, alive=False)) <= 64
