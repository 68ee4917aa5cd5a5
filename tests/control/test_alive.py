"""Idle motion: human-like, within the joints' limits, and in nothing that counts; lips in step with the words."""

import asyncio
import math
from collections.abc import Sequence
from itertools import pairwise
from random import Random
from statistics import mean, median

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import FaceLexeme, FaceShift, Gaze, Mark, Pointing, Speech
from engage_hri.schemas.body import BodyPose, JointAngle, RobotState
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.body import BodyState, MouthShape, Reached
from engage_hri.services.control.torso import kinematics
from engage_hri.services.control.torso.alive import CLOSED, CLOSING, GIVES_WAY, OPENING, Blinks, closure
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.control.torso.mouth import CHANGE, Mouth
from engage_hri.services.control.voice.lipsync import mouth_shapes
from engage_hri.services.control.voice.timeline import utter
from tests.control.contract_truth import CROWDS, witnessed
from tests.control.directing import robot
from tests.control.motions import recorded, violations
from tests.control.suite import WORLD, Stage, performed

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
        witness = await witnessed(body, WORLD, CROWDS[crowd], Random(crowd))
        watching.cancel()
        assert witness is not None
        assert witness.lies == []
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


# -- lips ---------------------------------------------------------------------------------------------------------


def summed(shapes: Sequence[MouthShape], t: float) -> tuple[float, float]:
    """Oracle: every change of shape, added up, by the polynomial of least jerk."""
    opening = width = 0.0
    for before, each in pairwise((MouthShape(-math.inf, 0.0), *shapes)):
        x = min(max((t - each.at) / CHANGE + 0.5, 0.0), 1.0)
        come = 10 * x**3 - 15 * x**4 + 6 * x**5
        opening, width = opening + come * (each.opening - before.opening), width + come * (each.width - before.width)
    return opening, width


def test_the_mouth_goes_from_shape_to_shape() -> None:
    mouth, shapes = Mouth(), mouth_shapes(utter(TEXT), 10.0)
    mouth.move(shapes, 9.0)

    for step in range(6000):
        t = 9.5 + step / 1000
        assert mouth.at(t) == pytest.approx(summed(shapes, t), abs=1e-9)
    assert mouth.at(100.0) == pytest.approx((0.0, 0.0))


def test_it_leaves_what_it_was_about_without_a_jump() -> None:
    mouth, shapes = Mouth(), mouth_shapes(utter(TEXT), 10.0)
    mouth.move(shapes, 9.0)
    before = mouth.at(10.3)
    mouth.move((), 10.3)

    assert before[0] > 0.1
    assert mouth.at(10.3) == pytest.approx(before)
    assert mouth.at(10.3 + CHANGE) == pytest.approx((0.0, 0.0))
    assert not mouth.is_moving(10.3 + CHANGE)


def test_the_mouth_opens_for_each_syllable_and_closes_after_the_words() -> None:
    shapes = mouth_shapes(utter("papa, tutu"), 0.0)
    words = utter("papa, tutu").words

    wide = [each for each in shapes if each.opening > 0.2]
    assert [each.width < 0 for each in wide] == [False, False, True, True]  # rounded for u
    assert [each.at for each in shapes if each.opening == 0.0] == [word.end for word in words]
    assert mouth_shapes(utter("你好"), 0.0)
    assert mouth_shapes(utter("👍"), 0.0) == ()


async def openings(body: SimulatedBody, stage: Stage) -> list[tuple[float, float]]:
    """When the mouth is open how far, until the speech is over and a moment longer."""
    found = []
    while not stage.task.done():
        found.append((asyncio.get_running_loop().time(), body.idle().added.get("jaw", 0.0)))
        await asyncio.sleep(0.01)
    await stage.over()
    await asyncio.sleep(CHANGE)
    assert body.idle().added.get("jaw", 0.0) == pytest.approx(0.0)
    return found


async def test_lips_move_with_the_words_and_rest_in_pauses() -> None:
    body = SimulatedBody()
    body.see(WORLD)
    words = utter(TEXT).words
    begin = asyncio.get_running_loop().time()
    seen = await openings(body, Stage(body, Speech(id="s", text=TEXT), "end"))

    for word in words:
        assert max(opening for t, opening in seen if word.start <= t - begin <= word.end) > 0.15, word
    (pause,) = [(one.end, other.start) for one, other in pairwise(words) if other.start > one.end + 0.1]
    quiet = [opening for t, opening in seen if pause[0] + CHANGE < t - begin < pause[1] - CHANGE]
    assert quiet
    assert max(quiet) < 0.01


@pytest.mark.parametrize("how", ["at a mark", "held"])
async def test_lips_rest_while_the_voice_waits_and_go_on_with_it(how: str) -> None:
    body = SimulatedBody()
    body.see(WORLD)
    text, begin = "one two three four five six", asyncio.get_running_loop().time()
    mark = Mark("m", text.index("four"))
    stage = Stage(body, Speech(id="s", text=text, marks=(mark,)), "start" if how == "at a mark" else "end")
    at = utter(text).said_by(mark.position)
    if how == "held":
        await asyncio.sleep(at - 0.1)
        stage.authority.hold()
    await asyncio.sleep(begin + at + 0.1 - asyncio.get_running_loop().time())
    for _ in range(100):
        assert body.idle().added.get("jaw", 0.0) == pytest.approx(0.0, abs=1e-6)
        await asyncio.sleep(0.02)
    stage.authority.extend("end")
    stage.authority.go_on()
    resumed = asyncio.get_running_loop().time()
    seen = await openings(body, stage)

    for word in utter(text).words[3:]:
        since, until = (resumed + each - at for each in (word.start, word.end))
        assert max(opening for t, opening in seen if since <= t <= until) > 0.1, word


async def test_a_mute_voice_moves_its_lips_and_one_that_knows_it_does_not() -> None:
    """Thesis 5.4.3: "lips would just move without speech"."""
    body = SimulatedBody()
    body.switch_faults([BodyFault(kind="mute")])
    seen = await openings(body, Stage(body, Speech(id="s", text=TEXT), "end"))
    assert max(opening for _, opening in seen) > 0.3

    stage = Stage(body, Speech(id="t", text=TEXT), "end")
    body.switch_faults([])
    await asyncio.sleep(0.5)
    body.switch_faults([BodyFault(kind="voiceless")])
    await asyncio.gather(stage.task, return_exceptions=True)
    await asyncio.sleep(CHANGE)
    assert body.idle().added.get("jaw", 0.0) == pytest.approx(0.0)


async def test_lips_add_to_the_mouth_that_an_expression_makes() -> None:
    body = SimulatedBody()
    await performed(body, FaceShift(id="f", lexeme="OPEN_MOUTH", amount=1.0))
    assert shown(body, "jaw") == pytest.approx(rest := 0.95)
    stage = Stage(body, Speech(id="s", text=TEXT), "end")
    jaws = await sampled(body, "jaw", 2.0)
    assert rest - 1e-9 <= min(jaws) < max(jaws) <= 1.0  # there is hardly any way left
    await stage.over()

    await performed(body, FaceShift(id="g", lexeme="SMILE", amount=1.0))
    stage = Stage(body, Speech(id="t", text="you who"), "end")
    corners = await sampled(body, "left_mouth_corner", 0.8)
    assert 0.9 < min(corners) <= max(corners) <= 1.0  # nor for lips to be rounded, in a full smile
    await stage.over()


async def test_another_voice_moves_the_lips_and_this_one_others() -> None:
    body, heard = SimulatedBody(), list[Sequence[MouthShape]]()
    now = asyncio.get_running_loop().time()
    body.move_lips([MouthShape(now + 0.2, 1.0), MouthShape(now + 0.5, 0.0)])
    await asyncio.sleep(0.35)
    assert shown(body, "jaw") > 0.5

    body.on_lips = heard.append
    await performed(body, Speech(id="s", text="papa"))
    assert [bool(shapes) for shapes in heard] == [True, False]


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
