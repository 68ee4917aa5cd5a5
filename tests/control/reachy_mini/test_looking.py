"""Reachy Mini looks, nods, leans and shows what it has for a face: on loop time, by what its daemon measures."""

import asyncio
import math
from collections.abc import AsyncIterator

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import FaceLexeme, Gaze, GazeShift, Head, Posture, PostureShift
from engage_hri.schemas.units import Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.bases.walk import settling
from engage_hri.services.control.contract.body import BodyFailed, Reached
from engage_hri.services.control.motion.path import JointMotion, resting
from engage_hri.services.control.reachy_mini import joints
from engage_hri.services.control.reachy_mini.body import ReachyMini
from engage_hri.services.control.reachy_mini.moves import FRAME, NEAR, SHORTEST, Moves
from engage_hri.services.control.reachy_mini.settings import ReachyMiniSettings
from engage_hri.services.control.testing import WORLD, Stage, performed
from engage_hri.services.control.testing.findings import aside
from engage_hri.services.control.testing.suite import ON_AXIS
from tests.control.reachy_mini.fake import FakeDaemon
from tests.control.reachy_mini.limits import too_much


@pytest.fixture
async def daemon() -> FakeDaemon:
    return FakeDaemon()


@pytest.fixture
async def body(daemon: FakeDaemon) -> AsyncIterator[ReachyMini]:
    body = ReachyMini(connect=daemon)
    body.see(WORLD)
    async with body.connected():
        yield body


def off(body: ReachyMini, place: Vector) -> float:
    gaze = body.state().gaze
    assert gaze is not None
    return aside(gaze, place)


def place(name: str) -> Vector:
    entity = WORLD.entity(name)
    assert entity is not None
    return entity.position


def angle(body: ReachyMini, joint: str) -> float:
    return {each.joint: math.degrees(each.angle) for each in body.state().pose.joints}[joint]


def antennas(body: ReachyMini) -> tuple[float, float]:
    return angle(body, "right_antenna"), angle(body, "left_antenna")


def with_person(at: Vector) -> World:
    return World(entities=(Entity(id="human", kind="person", position=at), *WORLD.entities[1:]))


async def test_it_follows_somebody_who_walks_by(body: ReachyMini, daemon: FakeDaemon):
    stage = Stage(body, Gaze(id="look", target="human"), "stroke_start")
    farthest, began = 0.0, asyncio.get_running_loop().time()
    for step in range(120):
        at = (1.3, -0.6 + 0.01 * step, 1.2)
        body.see(with_person(at))
        await asyncio.sleep(0.05)
        if step > 30:
            farthest = max(farthest, off(body, at))
    assert asyncio.get_running_loop().time() - began == pytest.approx(6.0)

    # 0.2 m/s at 1.3 m are 9 degrees a second: it is a third of a second behind at most.
    assert farthest < math.radians(0.8 + 0.3 * 9.0)
    assert stage.waits_at == ["stroke"]
    assert body.state().looking_at == "human"
    stage.authority.extend("end")
    await stage.over()
    assert too_much(daemon.commands, body.capabilities.joints) == []


async def test_the_base_of_its_gaze_follows_too(body: ReachyMini):
    await performed(body, GazeShift(id="shift", target="human"))
    body.see(with_person((1.0, 0.8, 1.1)))
    await asyncio.sleep(2.0)

    assert off(body, (1.0, 0.8, 1.1)) < ON_AXIS
    assert body.state().looking_at == "human"


async def test_the_body_turns_along_for_what_is_far_aside_and_comes_back(body: ReachyMini):
    aside_place = (-0.2, 1.0, 1.0)
    body.see(with_person(aside_place))
    look = Gaze(id="look", target="human")
    promised = body.estimate(look, None, with_person(aside_place)).pose_after
    stage = Stage(body, look, "stroke_start")
    await asyncio.sleep(4.0)

    assert off(body, aside_place) < ON_AXIS
    assert angle(body, "body_yaw") == pytest.approx(angle(body, "head_yaw") - 30.0, abs=0.5)
    assert promised is not None
    assert [each.angle for each in promised.joints] == pytest.approx(
        [each.angle for each in body.state().pose.joints], abs=0.01
    )
    stage.authority.extend("end")
    await stage.over()
    await asyncio.sleep(0.5)
    assert angle(body, "body_yaw") == pytest.approx(0.0, abs=0.1)


async def test_a_shift_of_the_waist_turns_the_body_which_stays_under_looks_of_the_head(body: ReachyMini):
    aside_place = (1.0, 0.35, 1.0)
    body.see(with_person(aside_place))
    await performed(body, GazeShift(id="turn", target="human", influence="WAIST"))

    assert off(body, aside_place) < ON_AXIS
    assert angle(body, "body_yaw") == pytest.approx(19.3, abs=1.0)

    look = Stage(body, Gaze(id="look", target="near-right"), "stroke_start")
    await asyncio.sleep(2.0)

    assert off(body, place("near-right")) < ON_AXIS
    # The head takes it along no further than any look does.
    assert angle(body, "body_yaw") == pytest.approx(angle(body, "head_yaw") + 30.0, abs=0.5)
    look.authority.extend("end")
    await look.over()
    await asyncio.sleep(1.0)
    assert angle(body, "body_yaw") == pytest.approx(19.3, abs=1.0)


async def test_what_is_behind_it_or_under_its_chin_it_refuses_with_the_joint_and_its_range(body: ReachyMini):
    for position, joint in (((-1.0, 0.1, 1.0), "head_yaw"), ((0.2, 0.0, 0.7), "head_pitch")):
        world = with_person(position)
        estimate = body.estimate(Gaze(id="look", target="human"), None, world)

        assert not estimate.feasible
        assert estimate.fault is not None
        assert f"{joint} would be at" in estimate.fault.reason
        assert estimate.fault.advice


@pytest.mark.parametrize("posture", ["LEAN_FORWARD", "LEAN_BACK", "TURN_LEFT", "TURN_RIGHT"])
async def test_a_look_stays_on_its_target_while_the_body_leans_or_turns(body: ReachyMini, posture: str):
    look = Stage(body, Gaze(id="look", target="near-right"), "stroke_start")
    await asyncio.sleep(2.0)
    lean = Stage(body, Posture(id="lean", lexeme=posture), "end")
    farthest = 0.0
    while not lean.task.done():
        await asyncio.sleep(0.02)
        farthest = max(farthest, off(body, place("near-right")))
    await lean.over()

    assert farthest < ON_AXIS
    assert look.waits_at == ["stroke"]
    look.authority.extend("end")
    await look.over()


async def test_a_nod_is_on_top_of_the_look(body: ReachyMini):
    look = Stage(body, Gaze(id="look", target="human"), "stroke_start")
    await asyncio.sleep(2.0)
    up = angle(body, "head_pitch")
    nod = Stage(body, Head(id="nod", lexeme="NOD", repetition=2), "end")
    lowest = up
    while not nod.task.done():
        await asyncio.sleep(0.02)
        lowest = min(lowest, angle(body, "head_pitch"))
    progress = await nod.over()

    told = [each.sync for each in progress if isinstance(each, Reached)]
    assert told == ["start", "ready", "stroke_start", "stroke", "stroke:2", "stroke_end", "relax", "end"]
    assert 3.5 < up - lowest < 7.5
    assert off(body, place("human")) < ON_AXIS
    look.authority.extend("end")
    await look.over()


async def test_antennas_tell_faces_apart(body: ReachyMini):
    shown = {}
    for lexeme in ("NEUTRAL", "SMILE", "SADNESS", "ANGER", "SURPRISE", "WINK"):
        stage = Stage(body, FaceLexeme(id=lexeme, lexeme=lexeme, amount=1.0), "stroke_start")
        await asyncio.sleep(2.0)
        shown[lexeme] = (angle(body, "left_antenna"), -angle(body, "right_antenna"))
        stage.authority.extend("end")
        await stage.over()

    assert shown["NEUTRAL"] == pytest.approx((10.0, 10.0), abs=0.1)
    assert shown["SURPRISE"][0] < 0.0 < shown["SMILE"][0] - 10.0 < shown["ANGER"][0] < shown["SADNESS"][0] + 60.0
    assert shown["WINK"][0] > 50.0 > 11.0 > shown["WINK"][1]
    faces = list(shown.values())
    assert all(math.dist(a, b) > 8.0 for n, a in enumerate(faces) for b in faces[:n])


FACES = ("SMILE", "SADNESS", "ANGER", "SURPRISE", "WINK")


@pytest.mark.parametrize("slow", [math.inf, math.radians(60.0)], ids=["quick", "slow"])
@pytest.mark.parametrize("lexeme", FACES)
async def test_a_face_is_told_once_the_antennas_show_it(
    body: ReachyMini, daemon: FakeDaemon, lexeme: str, slow: float
):
    """What counts is where the antennas are as a point is told, against where they are seconds later."""
    daemon.slow = slow
    rest = antennas(body)
    stage = Stage(body, FaceLexeme(id=lexeme, lexeme=lexeme), "stroke_start")
    await stage.holding()
    told = antennas(body)
    await asyncio.sleep(3.0)
    assert told == pytest.approx(antennas(body), abs=1.0)
    assert max(abs(a - b) for a, b in zip(told, rest, strict=True)) > 5.0
    stage.authority.extend("end")
    await stage.over()
    assert antennas(body) == pytest.approx(rest, abs=1.0)


@pytest.mark.parametrize(("bent", "comes"), [(3.0, True), (5.0, False)])
async def test_an_antenna_that_stands_off_shows_its_face_once_it_stands(
    body: ReachyMini, daemon, bent: float, comes: bool
):
    daemon.bent = math.radians(bent)
    stage = Stage(body, FaceLexeme(id="smile", lexeme="SMILE"), "stroke_start")
    await stage.holding()
    if comes:
        told = antennas(body)
        await asyncio.sleep(3.0)
        assert told == pytest.approx(antennas(body), abs=0.1)
        stage.authority.extend("end")
        await stage.over()
        await body.home()
    else:
        with pytest.raises(BodyFailed, match=r"antenna stands at .*5\.0 from where it should be for its stroke"):
            await stage.over()


async def test_arms_are_left_out_of_a_posture_with_a_word(body: ReachyMini):
    crossed = body.estimate(Posture(id="p", lexeme="ARMS_CROSSED"), None, WORLD)

    assert not crossed.feasible
    assert crossed.fault is not None
    assert "no arms" in crossed.fault.reason


async def test_a_shift_of_the_posture_stays(body: ReachyMini):
    await performed(body, PostureShift(id="p", lexeme="TURN_LEFT"))
    await asyncio.sleep(3.0)
    assert angle(body, "body_yaw") == pytest.approx(15.0, abs=0.1)
    assert angle(body, "head_yaw") == pytest.approx(0.0, abs=0.1)
    await body.home()
    assert angle(body, "body_yaw") == pytest.approx(0.0, abs=0.1)


async def test_where_it_stands_is_a_setting():
    settings = ReachyMiniSettings(position=(0.2, -0.4, 0.5), facing=40.0)
    body = ReachyMini(settings, FakeDaemon())
    body.see(WORLD)
    async with body.connected():
        stage = Stage(body, Gaze(id="look", target="far-left"), "stroke_start")
        await asyncio.sleep(2.0)
        state = body.state()

        assert off(body, place("far-left")) < ON_AXIS
        assert state.gaze is not None
        assert math.dist(state.gaze.origin, (0.2, -0.4, 0.73)) < 0.08
        assert math.degrees(math.atan2(0.7, 0.5)) - 40.0 == pytest.approx(angle(body, "head_yaw"), abs=1.0)
        stage.authority.extend("end")
        await stage.over()


async def test_a_slower_pace_takes_longer_and_says_so():
    took = {}
    for pace in (1.0, 0.3):
        body = ReachyMini(ReachyMiniSettings(pace=pace), FakeDaemon())
        body.see(WORLD)
        async with body.connected():
            look = Gaze(id="look", target="near-right")
            promised = sum(phase.natural for phase in body.estimate(look, None, WORLD).phases)
            progress = await performed(body, look)
            took[pace] = progress[-1].at - progress[0].at
            assert took[pace] == pytest.approx(promised, abs=0.1)

    assert took[0.3] > 1.8 * took[1.0]


async def test_a_gaze_beside_its_target_says_that_it_rests_on_nothing(body: ReachyMini):
    look = Gaze(id="look", target="human", offset_angle=8.0, offset_direction="LEFT")
    stage = Stage(body, look, "stroke_start")
    await asyncio.sleep(2.0)

    assert off(body, place("human")) == pytest.approx(math.radians(8.0), abs=math.radians(0.8))
    assert body.state().looking_at == ""
    assert angle(body, "head_yaw") > 7.0
    stage.authority.extend("end")
    await stage.over()
    assert not body.estimate(replace(look, target="nobody"), None, WORLD).feasible


class Still:
    """A clock that does not move."""

    def time(self) -> float:
        return 0.0


def at_rest() -> Moves:
    return Moves(Still(), ReachyMiniSettings())


@pytest.mark.parametrize("track", joints.TRACKS)
def test_what_rests_where_it_is_to_go_takes_no_time_and_what_still_moves_there_some(track: str) -> None:
    moves, here = at_rest(), resting(joints.HOME[track])

    assert moves.way(track, here, joints.HOME[track]).length == 0.0
    moving = JointMotion(here.q, here.v + 0.02, here.a)
    assert moves.way(track, moving, joints.HOME[track]).length >= SHORTEST


@pytest.mark.parametrize("lag", [0.1, 0.25, 0.4])
@pytest.mark.parametrize("yaw", [0.1, 0.4, 0.9])
def test_joints_that_follow_late_are_expected_at_their_goal_not_before_and_soon_after(yaw: float, lag: float) -> None:
    home = joints.HOME["head"]
    path = at_rest().way("head", resting(home), (home[0] + yaw, *home[1:]))
    limit = NEAR[joints.TRACKS["head"][0].joint]
    places = [path.at(path.length - lag * step / 16_000).q[0] for step in range(16_001)]
    near = max(
        step for step, place in enumerate(places) if abs(place - home[0] - yaw) <= limit
    )  # it only comes nearer

    told = settling(path, path.length, lag, [NEAR[each.joint] for each in joints.TRACKS["head"]], FRAME)

    assert 0 < near < 16_000
    assert told == pytest.approx(lag * (1.0 - near // 1000 / 16) + FRAME / 2)  # in sixteenths, rounded up
