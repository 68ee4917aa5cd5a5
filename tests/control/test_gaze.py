"""Gaze of the simulated body: over a base, after what moves, under a nod."""

import asyncio
import math

import msgspec
import pytest

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import Gaze, GazeShift, Head, PostureShift
from engage_hri.schemas.units import Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.contract.body import Arrived, Reached
from engage_hri.services.control.testing import WORLD, Stage, performed, times
from engage_hri.services.control.testing.motions import recorded, violations
from engage_hri.services.control.torso.body import SimulatedBody
from tests.control.watching import stops


def body_in(world: World) -> SimulatedBody:
    body = SimulatedBody()
    body.see(world)
    return body


def moved_to(world: World, id: str, position: Vector) -> World:
    entities = (
        msgspec.structs.replace(entity, position=position) if entity.id == id else entity for entity in world.entities
    )
    return World(entities=tuple(entities))


def misses_by(body: SimulatedBody, target: Vector) -> float:
    """Degrees between the gaze axis and the direction of `target`."""
    ray = body.state().gaze
    to = [b - a for a, b in zip(ray.origin, target, strict=True)]
    cosine = sum(a * b for a, b in zip(to, ray.axis, strict=True)) / math.hypot(*to)
    return math.degrees(math.acos(min(1.0, cosine)))


async def test_a_gaze_overlays_the_base_and_returns_to_it():
    body = body_in(WORLD)
    await performed(body, GazeShift(id="base", target="human"))
    looking = [body.state().looking_at]
    stage = Stage(body, Gaze(id="g", target="far-left"))
    await asyncio.sleep(0.1)
    looking.append(body.state().looking_at)
    await asyncio.sleep(1.0)
    looking.append(body.state().looking_at)
    stage.authority.extend("end")
    await stage.over()
    looking.append(body.state().looking_at)

    assert looking == ["human", "", "far-left", "human"]
    assert misses_by(body, (1.3, 0.0, 1.2)) < 1e-6


async def test_a_new_base_beneath_a_gaze_moves_nothing_until_the_gaze_ends():
    body = body_in(WORLD)
    stage = Stage(body, Gaze(id="g", target="near-right"))
    await asyncio.sleep(1.0)
    before = body.state().pose
    await performed(body, GazeShift(id="base", target="far-left"))

    assert body.state().pose == before
    assert body.state().looking_at == "near-right"
    stage.authority.extend("end")
    await stage.over()
    assert body.state().looking_at == "far-left"
    assert misses_by(body, (0.70, 0.30, 0.73)) < 0.5


@pytest.mark.parametrize(("through", "hold"), [("start", "stroke"), ("stroke", "relax")])
async def test_a_gaze_that_holds_follows_a_face(through: str, hold: str):
    body = body_in(WORLD)
    stage = Stage(body, Gaze(id="g", target="human"), through)
    world = WORLD
    async with recorded(body) as recording:
        for step in range(30):
            await asyncio.sleep(0.1)
            world = moved_to(world, "human", (1.3, 0.02 * step, 1.2))
            body.see(world)
        await asyncio.sleep(0.5)

    assert stage.waits_at == [hold]
    assert misses_by(body, (1.3, 0.58, 1.2)) < 0.6
    assert body.state().looking_at == "human"
    assert violations(recording, body.capabilities.joints) == []
    stage.authority.revoke()
    await stage.over()


async def test_a_base_gaze_follows_a_hand_on_the_move():
    body = body_in(WORLD)
    await performed(body, GazeShift(id="base", target="near-right"))
    world = moved_to(WORLD, "near-right", (0.6, 0.2, 0.85))
    body.see(world)
    await asyncio.sleep(1.0)

    assert misses_by(body, (0.6, 0.2, 0.85)) < 0.1


async def test_a_gaze_whose_target_moves_on_the_way_arrives_at_it():
    body = body_in(WORLD)
    stage = Stage(body, Gaze(id="g", target="far-left"), "stroke")
    async with recorded(body) as recording:
        await asyncio.sleep(0.2)
        body.see(moved_to(WORLD, "far-left", (0.6, 0.0, 0.73)))
        await asyncio.sleep(2.0)

    assert stage.passed == ["start", "ready", "stroke_start", "stroke"]
    assert stage.waits_at == ["relax"]
    assert misses_by(body, (0.6, 0.0, 0.73)) < 0.1
    assert violations(recording, body.capabilities.joints) == []
    stage.authority.extend("end")
    assert tuple(times(await stage.over())) == sync_points(Gaze(id="g", target="far-left"))


async def test_a_nod_adds_to_the_gaze():
    body = body_in(WORLD)
    stage = Stage(body, Gaze(id="g", target="human"), "stroke")
    await asyncio.sleep(1.0)
    nodding = asyncio.create_task(performed(body, Head(id="nod", lexeme="NOD")))
    async with recorded(body, ["neck_pitch"]) as recording:
        await nodding

    assert stage.waits_at == ["relax"]
    assert body.state().looking_at == "human"
    assert math.degrees(float(recording.angles.max() - recording.angles.min())) == pytest.approx(9, abs=3)
    assert misses_by(body, (1.3, 0.0, 1.2)) < 1e-6
    stage.authority.revoke()
    await stage.over()


async def test_eyes_stay_on_target_while_the_torso_leans():
    body = body_in(WORLD)
    await performed(body, GazeShift(id="base", target="human"))
    await performed(body, PostureShift(id="lean", lexeme="LEAN_FORWARD"))
    await asyncio.sleep(1.0)

    assert misses_by(body, (1.3, 0.0, 1.2)) < 0.1


async def test_with_an_offset_the_eyes_are_beside_the_target_and_on_nothing():
    body = body_in(WORLD)
    straight = body_in(WORLD)
    await performed(straight, GazeShift(id="base", target="human"))
    await performed(body, GazeShift(id="base", target="human", offset_direction="UPRIGHT", offset_angle=20))
    axis, on_target = body.state().gaze.axis, straight.state().gaze.axis

    assert (body.state().looking_at, straight.state().looking_at) == ("", "human")
    assert axis[1] < on_target[1]  # right
    assert axis[2] > on_target[2]  # up


async def test_standing_on_target_is_one_stop_however_its_authority_comes():
    """Told to leave before it stands, it never stops; told late, it leaves from where it stands, on target."""
    gaze = Gaze(id="g", target="far-left")
    free = SimulatedBody()
    free.see(WORLD)
    arrival = times(await performed(free, gaze))["stroke"]
    for told, expected in ((arrival + 0.01, 0), (arrival + 1.0, 1)):
        body = body_in(WORLD)
        began = asyncio.get_running_loop().time()
        stage = Stage(body, gaze)
        async with recorded(body, ["neck_yaw", "neck_pitch"]) as recording:
            await asyncio.sleep(told)
            on_target = misses_by(body, (0.70, 0.30, 0.73))
            stage.authority.extend("end")
            progress = await stage.over()

        left = times(progress)
        assert on_target < 0.5
        assert stage.waits_at == ["stroke"]
        assert left["stroke"] == pytest.approx(began + told)
        assert left["relax"] <= left["stroke"] + 0.1
        assert stops(recording, began, left["end"]) == expected


async def test_left_at_the_stroke_alone_it_stays_on_target():
    body = body_in(WORLD)
    stage = Stage(body, Gaze(id="g", target="far-left"))
    await asyncio.sleep(1.0)
    before = body.state().pose
    stage.authority.extend("stroke")
    await asyncio.sleep(1.0)

    assert stage.waits_at == ["stroke", "relax"]
    assert body.state().pose == before
    left, arrived = (next(it for it in stage.progress if isinstance(it, kind) and it.sync == sync)
                     for kind, sync in ((Reached, "stroke"), (Arrived, "relax")))  # fmt: skip
    assert left.at == arrived.at
    stage.authority.extend("end")
    await stage.over()


async def test_a_gaze_at_what_lies_where_the_head_rests_has_no_way_back():
    near = Entity(id="near-human", kind="object", position=(1.3, 0.004, 1.2))  # a sixth of a degree beside the human
    body = body_in(World(entities=(*WORLD.entities, near)))
    await performed(body, GazeShift(id="base", target="human"))
    Stage(body, Gaze(id="before", target="far-left"))
    await asyncio.sleep(1.0)

    points = times(await performed(body, Gaze(id="g", target="near-human")))

    assert points["start"] < points["stroke"]
    assert points["relax"] == points["end"]
