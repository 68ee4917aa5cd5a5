"""A gaze shift of the WAIST: eyes first, the trunk under them, which stays; arms that point keep to their targets."""

import asyncio
import math

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Gaze, GazeShift, Pointing, Posture
from engage_hri.schemas.units import Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.contract.body import BodyState
from engage_hri.services.control.testing import Stage, performed, times
from engage_hri.services.control.testing.findings import aside, beside
from engage_hri.services.control.testing.motions import STEP, recorded, violations
from engage_hri.services.control.testing.suite import ON_AXIS
from engage_hri.services.control.torso.body import SimulatedBody

ANN: Vector = (1.0, 0.7, 1.2)
CUP: Vector = (0.6, -0.2, 0.73)
TURN = GazeShift(id="turn", target="ann", influence="WAIST")


def world(ann: Vector = ANN) -> World:
    return World(
        entities=(
            Entity(id="ann", kind="person", position=ann),
            Entity(id="cup", kind="object", position=CUP, radius=0.03),
        )
    )


@pytest.fixture
async def body() -> SimulatedBody:
    body = SimulatedBody()
    body.see(world())
    return body


def off(state: BodyState, place: Vector) -> float:
    assert state.gaze is not None
    return aside(state.gaze, place)


def turned(body: SimulatedBody) -> float:
    return {each.joint: math.degrees(each.angle) for each in body.state().pose.joints}["torso_turn"]


async def test_the_trunk_goes_as_far_as_it_can_and_stays_under_looks_of_the_head(body: SimulatedBody):
    await performed(body, TURN)
    assert turned(body) == pytest.approx(27.0)
    assert off(body.state(), ANN) < ON_AXIS

    await performed(body, Gaze(id="look", target="cup"))
    await performed(body, GazeShift(id="shift", target="cup"))
    await performed(body, Posture(id="lean", lexeme="LEAN_FORWARD"))
    assert turned(body) == pytest.approx(27.0)
    assert off(body.state(), CUP) < ON_AXIS


async def test_the_eyes_come_as_soon_as_without_the_trunk_and_stay_while_it_turns(body: SimulatedBody):
    alone = sum(each.natural for each in body.estimate(replace(TURN, influence=""), None, world()).phases)
    turning = asyncio.create_task(performed(body, TURN))
    await asyncio.sleep(alone + STEP)
    assert 2.0 < turned(body) < 25.0
    while not turning.done():
        assert off(body.state(), ANN) < ON_AXIS
        await asyncio.sleep(STEP)

    assert times(await turning)["end"] > alone + 0.4


async def test_a_pointing_arm_stays_on_its_target(body: SimulatedBody):
    pointing = Stage(body, Pointing(id="point", target="cup", mode="RIGHT_HAND"), "stroke")
    await asyncio.sleep(2.0)
    async with recorded(body) as recording:
        turning = asyncio.create_task(performed(body, TURN))
        while not turning.done():
            arm = body.state().right_arm
            assert arm is not None
            assert beside(arm, CUP) < 0.02
            await asyncio.sleep(STEP)
        pointing.authority.extend("end")
        await pointing.over()

    await turning
    assert turned(body) == pytest.approx(27.0)
    assert violations(recording, body.capabilities.joints) == []


async def test_a_look_that_takes_the_head_lets_the_trunk_go_on(body: SimulatedBody):
    turning = asyncio.create_task(performed(body, TURN))
    await asyncio.sleep(0.4)
    await performed(body, Gaze(id="look", target="cup"))

    assert "end" in times(await turning)
    await asyncio.sleep(1.0)
    assert turned(body) == pytest.approx(27.0)
    assert off(body.state(), ANN) < ON_AXIS


async def test_a_turn_that_is_aborted_stays_where_it_can_stop(body: SimulatedBody):
    turning = Stage(body, TURN)
    await asyncio.sleep(0.5)
    turning.authority.revoke("abort")
    await turning.over()
    await asyncio.sleep(1.0)
    stopped = turned(body)
    assert 5.0 < stopped < 26.0

    await performed(body, Posture(id="lean", lexeme="LEAN_FORWARD"))
    assert turned(body) == pytest.approx(stopped)


async def test_who_walks_while_the_trunk_turns_is_faced_where_they_have_come(body: SimulatedBody):
    body.see(world((1.2, -0.2, 1.2)))
    turning = asyncio.create_task(performed(body, TURN))
    for step in range(40):
        body.see(world((1.2, -0.2 + 0.01 * step, 1.2)))
        await asyncio.sleep(0.02)
    there = (1.2, -0.2 + 0.39, 1.2)
    await turning

    assert off(body.state(), there) < ON_AXIS
    assert turned(body) == pytest.approx(math.degrees(math.atan2(there[1], there[0])), abs=1.0)


async def test_with_the_trunk_it_sees_what_the_neck_alone_cannot(body: SimulatedBody):
    far = world((0.1, 0.9, 1.2))
    assert not body.estimate(replace(TURN, influence=""), None, far).feasible

    body.see(far)
    await performed(body, TURN)
    assert off(body.state(), (0.1, 0.9, 1.2)) < ON_AXIS
