"""The simulated body: exact times, fluid motion, gaze that follows, parts that add up, and ends that are safe."""

import asyncio
import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import (
    BlockBehavior,
    FaceFacs,
    FaceLexeme,
    FaceShift,
    Gaze,
    GazeShift,
    Gesture,
    Head,
    HeadDirectionShift,
    Pointing,
    Pose,
    Posture,
    Speech,
)
from engage_hri.schemas.body import NoPointZone
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.contract.body import Arrived, BehaviorRefused, Bell, MovementAuthority
from engage_hri.services.control.testing import WORLD, Stage, performed, times
from engage_hri.services.control.testing.motions import recorded, violations
from engage_hri.services.control.testing.stage import default
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.control.watching import stops
from tests.random_cases import share_of

ARMS = ("LEFT_HAND", "RIGHT_HAND")


def body_in(world: World = WORLD, **settings: object) -> SimulatedBody:
    body = SimulatedBody(**settings)  # type: ignore[arg-type]
    body.see(world)
    return body


async def test_a_pointing_reaches_its_points_at_its_natural_times():
    body = body_in()
    await asyncio.sleep(1.0)
    estimate = body.estimate(Pointing(id="p", target="near-right"), None, WORLD)
    at = times(await performed(body, Pointing(id="p", target="near-right")))

    assert at["start"] == 1.0
    assert at["stroke_start"] == pytest.approx(at["ready"] + 0.1, abs=1e-9)
    assert at["stroke_end"] == pytest.approx(at["stroke"] + 0.2, abs=1e-9)
    assert at["relax"] == pytest.approx(at["stroke_end"] + 0.1, abs=1e-9)
    assert at["end"] - 1.0 == pytest.approx(sum(phase.natural for phase in estimate.phases), abs=1e-9)
    assert all(0.1 - 1e-9 <= phase.natural <= 1.0 for phase in estimate.phases)


@pytest.mark.parametrize(("degrees", "seconds"), [(30, 0.3), (60, 0.5)])
async def test_a_gaze_takes_as_long_as_a_persons(degrees: int, seconds: float):
    yaw = math.radians(degrees)
    world = World(entities=(Entity(id="x", kind="object", position=(2 * math.cos(yaw), 2 * math.sin(yaw), 1.17)),))
    at = times(await performed(body_in(world), Gaze(id="g", target="x")))

    assert at["start"] == at["ready"] == at["stroke_start"]
    assert at["stroke"] - at["start"] == pytest.approx(seconds, abs=0.01)
    assert at["stroke_end"] == at["relax"]


FREE: list[BlockBehavior] = [
    *(Pointing(id=f"{target}-{hand}", target=target, mode=hand)  # type: ignore[arg-type]
      for target in ("near-right", "far-left", "middle") for hand in ARMS),
    *(Gaze(id=f"gaze-{target}", target=target) for target in ("near-right", "far-left", "middle", "human")),
    Gesture(id="beat", lexeme="BEAT"), Gesture(id="wave", lexeme="WAVE", mode="BOTH_HANDS"),
    Head(id="nod", lexeme="NOD", repetition=3), Head(id="shake", lexeme="SHAKE", repetition=2, amount=1.0),
    *(FaceLexeme(id=lexeme, lexeme=lexeme, amount=1.0) for lexeme in ("SMILE", "FROWN", "BLINK", "RAISE_BROWS")),
    FaceFacs(id="au", au=12), Posture(id="lean", lexeme="LEAN_FORWARD"), Posture(id="turn", lexeme="TURN_LEFT"),
]  # fmt: skip


@pytest.mark.parametrize("behavior", FREE, ids=lambda behavior: behavior.id)
async def test_what_nobody_holds_is_one_fluid_motion_within_its_limits(behavior: BlockBehavior):
    middle = Entity(id="middle", kind="object", position=(0.55, 0.0, 0.73), radius=0.03)
    world = World(entities=(*WORLD.entities, middle))
    body = body_in(world)
    phases = body.estimate(behavior, None, world).phases
    async with recorded(body) as recording:
        at = times(await performed(body, behavior))

    assert tuple(at) == ("start", *(phase.to for phase in phases))
    assert default(tuple(at)) == sync_points(behavior)
    assert stops(recording, at["start"], at["end"]) == 0
    assert violations(recording, body.capabilities.joints) == []


async def test_each_stroke_of_a_repeated_movement_is_told_when_it_is():
    body = body_in()
    nod = Head(id="nod", lexeme="NOD", repetition=3)
    async with recorded(body, ("neck_pitch",)) as recording:
        at = times(await performed(body, nod))

    assert list(at)[3:7] == ["stroke", "stroke:2", "stroke:3", "stroke_end"]
    for stroke in ("stroke", "stroke:2", "stroke:3"):
        pitch = recording.angles[:, 0]
        lowest = pitch[np.abs(np.array(recording.times) - at[stroke]) < 0.1].min()
        assert np.interp(at[stroke], recording.times, pitch) == pytest.approx(lowest, abs=1e-3)


async def test_authority_that_comes_in_time_costs_no_stop():
    body = body_in()
    behavior = Pointing(id="p", target="far-left")
    estimate = body.estimate(behavior, None, WORLD)
    async with recorded(body) as recording:
        stage = Stage(body, behavior)
        await asyncio.sleep(0.1)
        stage.authority.extend("stroke_end")
        await asyncio.sleep(0.5)
        stage.authority.extend("end")
        at = times(await stage.over())

    assert not stage.waits_at
    assert at["end"] == pytest.approx(sum(phase.natural for phase in estimate.phases), abs=1e-9)
    assert stops(recording, at["start"], at["end"]) == 0


@pytest.mark.parametrize(
    "behavior",
    [
        Pointing(id="p", target="far-left"),
        Gesture(id="p", lexeme="BEAT"),
        Gesture(id="p", lexeme="WAVE", mode="BOTH_HANDS"),
    ],
)
async def test_a_hold_stops_once_per_hold_and_goes_on_at_its_natural_times(behavior: BlockBehavior):
    body = body_in()
    natural = {phase.to: phase.natural for phase in body.estimate(behavior, None, WORLD).phases}
    async with recorded(body) as recording:
        stage = Stage(body, behavior)
        await asyncio.sleep(3.0)
        stage.authority.extend("end")
        at = times(await stage.over())

    assert at["stroke_start"] == 3.0
    assert at["stroke"] - at["stroke_start"] == pytest.approx(natural["stroke"], abs=1e-9)
    assert stops(recording, at["start"], at["end"]) == 1
    assert violations(recording, body.capabilities.joints) == []


@pytest.mark.parametrize("kind", [FaceLexeme, Posture])
async def test_who_takes_over_on_target_is_there_at_once(kind: type[FaceLexeme | Posture]):
    body = body_in()
    lexeme = "FROWN" if kind is FaceLexeme else "LEAN_FORWARD"
    Stage(body, kind(id="one", lexeme=lexeme))
    await asyncio.sleep(2.0)
    at = times(await performed(body, kind(id="two", lexeme=lexeme)))

    assert at["start"] == at["stroke"] == 2.0


async def test_an_arm_that_holds_points_at_its_target():
    body = body_in()
    stage = Stage(body, Pointing(id="p", target="far-left", mode="LEFT_HAND"), "stroke")
    await asyncio.sleep(5.0)
    ray, target = body.state().left_arm, WORLD.entity("far-left")

    assert stage.waits_at == ["stroke_end"]
    assert target is not None
    to = [b - a for a, b in zip(ray.origin, target.position, strict=True)]
    assert [a / math.hypot(*to) for a in to] == pytest.approx(ray.axis, abs=1e-6)
    stage.authority.revoke()
    await stage.over()


async def test_the_nearer_free_arm_points():
    body = body_in()
    left = Stage(body, Pointing(id="left", target="far-left"))
    await asyncio.sleep(0.1)
    again = Stage(body, Pointing(id="again", target="far-left"))
    await asyncio.sleep(3.0)

    state = body.state()
    assert left.waits_at == again.waits_at == ["stroke_start"]
    assert state.left_arm.tip is not None
    assert state.right_arm.tip is not None
    assert state.left_arm.tip[1] > 0.1
    assert state.right_arm.tip[1] > -0.2
    await body.home()
    await asyncio.gather(left.task, again.task)


async def test_shifts_stay():
    body = body_in()
    await performed(body, FaceShift(id="face", lexeme="SMILE"))
    await performed(body, Pose(id="pose", lexeme="TURN_LEFT"))
    await performed(body, HeadDirectionShift(id="head", target="human"))
    await asyncio.sleep(5.0)
    pose = {angle.joint: angle.angle for angle in body.state().pose.joints}

    assert pose["left_mouth_corner"] == pose["right_mouth_corner"] == pytest.approx(0.95 * 0.5)
    assert math.degrees(pose["torso_turn"]) == pytest.approx(15)


async def test_estimates_chain_over_poses():
    body = body_in()
    one = body.estimate(Gaze(id="one", target="near-right"), None, WORLD)
    two = body.estimate(Pointing(id="two", target="near-right"), one.pose_after, WORLD)
    three = body.estimate(Gaze(id="three", target="near-right"), two.pose_after, WORLD)
    four = body.estimate(Pointing(id="four", target="near-right", mode="RIGHT_HAND"), two.pose_after, WORLD)

    assert one.head_degrees > 30
    assert two.arm_degrees > 40
    assert two.head_degrees == one.arm_degrees == 0.0
    assert three.head_degrees == pytest.approx(0.0, abs=1e-6)
    assert 30 < four.arm_degrees < two.arm_degrees  # the arm is raised a little and comes down on the target again
    assert two.ray is not None
    assert two.ray.tip is not None


@pytest.mark.parametrize(
    ("behavior", "warning", "reason"),
    [
        (Gaze(id="b", target="behin"), "NO_SUCH_TARGET", "no 'behin' (did you mean 'behind'?)"),
        (Gaze(id="b", target="behind"), "CANNOT_CREATE_BEHAVIOR", "neck_yaw cannot turn"),
        (Pointing(id="b", target="far"), "CANNOT_CREATE_BEHAVIOR", "farther than"),
        (Pointing(id="b", target="cup"), "CANNOT_CREATE_BEHAVIOR", "no-point zone"),
        (Gesture(id="b", lexeme="MOONWALK"), "CANNOT_CREATE_BEHAVIOR", "there are BEAT"),
        (Gesture(id="b", lexeme="WAVES"), "CANNOT_CREATE_BEHAVIOR", "do you mean WAVE"),
        (Head(id="b", lexeme="ROLL"), "CANNOT_CREATE_BEHAVIOR", "no head gesture 'ROLL': there are NOD, SHAKE"),
        (Posture(id="b", stance="LYING"), "CANNOT_CREATE_BEHAVIOR", "no stance 'LYING': BML defines it"),
        (FaceFacs(id="b", au=99), "CANNOT_CREATE_BEHAVIOR", "no action unit '99'"),
        (Posture(id="b", lexeme="HANDSTAND"), "CANNOT_CREATE_BEHAVIOR", "no posture"),
    ],
)
async def test_what_it_cannot_do_is_refused_with_the_reason(behavior: BlockBehavior, warning: str, reason: str):
    world = World(
        entities=(
            *WORLD.entities,
            Entity(id="behind", kind="object", position=(-1.0, 0.1, 1.0)),
            Entity(id="far", kind="object", position=(4.0, 0.0, 0.5)),
            Entity(id="cup", kind="object", position=(0.6, 0.0, 0.75)),
        )
    )
    body = body_in(world, zones=(NoPointZone(center=(0.6, 0.0, 0.75), radius=0.1),))
    estimate = body.estimate(behavior, None, world)

    assert (estimate.feasible, estimate.warning) == (False, warning)
    assert estimate.fault is not None
    assert reason in str(estimate.fault)
    with pytest.raises(BehaviorRefused, match="b: "):
        await performed(body, behavior)


async def test_a_voice_says_one_thing_at_a_time():
    body = body_in()
    stage = Stage(body, Speech(id="one", text="wait for me"), "end")
    await asyncio.sleep(0.1)

    assert body.state().speaking == "wait for me"
    with pytest.raises(BehaviorRefused, match="busy with 'wait for me'"):
        await performed(body, Speech(id="two", text="no"))
    await stage.over()


async def test_taking_one_arm_of_two_sends_the_other_home():
    body = body_in()
    home = body.state().right_arm
    both = Stage(body, Gesture(id="both", lexeme="WAVE", mode="BOTH_HANDS"))
    await asyncio.sleep(2.0)
    one = Stage(body, Pointing(id="one", target="far-left", mode="LEFT_HAND"))
    await asyncio.sleep(3.0)

    assert both.authority.revoked == "taken_over"
    assert both.passed == ["start", "ready"]
    assert body.state().right_arm.tip == pytest.approx(home.tip)
    assert one.waits_at == ["stroke_start"]
    await body.home()
    await one.over()


async def test_behaviors_that_go_home_together_end_in_the_order_in_which_they_began():
    body, ended = body_in(), list[str]()
    behaviors = (Pointing(id="arm", target="far-left"), Gaze(id="eyes", target="human"), Head(id="nod", lexeme="NOD"),
                 FaceLexeme(id="face", lexeme="SMILE"), Posture(id="torso", lexeme="LEAN_FORWARD"))  # fmt: skip
    stages = {behavior.id: Stage(body, behavior) for behavior in behaviors}
    await asyncio.sleep(0.05)
    for id, stage in stages.items():
        stage.authority.watch(lambda id=id: ended.append(id))
    await body.home()

    assert ended == list(stages)


async def test_a_frozen_arm_stands_still_before_it_relaxes():
    body = body_in()
    stage = Stage(body, Pointing(id="p", target="far-left"), "end")
    async with recorded(body) as recording:
        await asyncio.sleep(0.4)
        stage.authority.revoke("freeze")
        await stage.over()
        await asyncio.sleep(2.0)

    still = [speed < 1e-9 for speed in abs(recording.speeds).max(axis=1)]
    first = still.index(True, 20)
    assert all(still[first : first + 100])
    assert violations(recording, body.capabilities.joints) == []


TARGETS = st.sampled_from(["near-right", "far-left", "human"])
ANY = st.one_of(
    st.builds(lambda target, mode: Pointing(id="p", target=target, mode=mode), TARGETS, st.sampled_from(ARMS)),
    st.builds(lambda target: Gaze(id="g", target=target), TARGETS),
    st.builds(lambda target: GazeShift(id="s", target=target), TARGETS),
    st.builds(lambda lexeme, n: Head(id="h", lexeme=lexeme, repetition=n), st.sampled_from(["NOD", "SHAKE"]),
              st.integers(1, 3)),
    st.builds(lambda hand: Gesture(id="b", lexeme="WAVE", mode=hand), st.sampled_from([*ARMS, "BOTH_HANDS"])),
    st.builds(lambda lexeme: Posture(id="o", lexeme=lexeme), st.sampled_from(["LEAN_FORWARD", "TURN_LEFT"])),
    st.builds(lambda lexeme: FaceLexeme(id="f", lexeme=lexeme, amount=1.0), st.sampled_from(["SMILE", "FROWN"])),
)  # fmt: skip
STORY = st.lists(
    st.tuples(
        ANY, st.sampled_from(["start", "stroke", "end"]), st.floats(0.02, 0.8),
        st.sampled_from(["", "relax", "freeze"]),
    ),
    min_size=1, max_size=8,
)  # fmt: skip


@settings(max_examples=share_of(25), deadline=None)
@given(story=STORY)
def test_no_story_breaks_a_limit_or_leaves_an_arm_in_the_air(story: list[tuple[BlockBehavior, str, float, str]]):
    async def tell() -> None:
        body = body_in()
        home = body.state().pose
        stages = []
        async with recorded(body) as recording:
            for number, (behavior, through, wait, how) in enumerate(story):
                through = "end" if isinstance(behavior, GazeShift) else through
                stage = Stage(body, msgspec.structs.replace(behavior, id=f"b{number}"), through)
                stages.append(stage)
                await asyncio.sleep(wait)
                if how:
                    stage.authority.revoke(how)  # type: ignore[arg-type]
            await body.home()
        for stage in stages:
            stage.authority.extend("end")
            progress = await stage.over()
            passed = default(stage.passed)
            assert passed == sync_points(stage.behavior)[: len(passed)]
            assert len([item for item in progress if isinstance(item, Arrived)]) <= 2

        assert violations(recording, body.capabilities.joints) == []
        for angle, there in zip(body.state().pose.joints, home.joints, strict=True):
            assert angle.angle == pytest.approx(there.angle, abs=1e-6), angle.joint

    run_virtual(tell())


async def test_an_instant_that_rounding_puts_behind_its_timer_is_waited_for_once():
    """A loop runs its timers a nanosecond early; looking again, a task would find its instant ahead for ever."""
    bell = Bell()
    await asyncio.sleep(1.0)
    almost = 1.0 + 2**-52

    assert bell.now() < almost
    assert bell.is_past(almost)
    await bell.wait(almost)


async def test_words_wait_for_the_word_that_an_aborted_utterance_ends_with() -> None:
    body = body_in()
    long, short = Speech(id="a", text="extraordinarily long words"), Speech(id="b", text="next")
    first, second = MovementAuthority(long, "end"), MovementAuthority(short, "end")
    told: list[str] = []

    async def say(speech: Speech, authority: MovementAuthority) -> None:
        async for progress in body.perform(speech, authority):
            told.append(f"{speech.id} {type(progress).__name__}")

    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(say(long, first))
        await asyncio.sleep(0.1)
        first.revoke()
        tasks.create_task(say(short, second))
    assert told == ["a Reached", "a Spoke", "b Reached", "b Spoke", "b Reached"]


async def test_words_that_wait_for_the_voice_are_given_up_when_they_are_aborted() -> None:
    body = body_in()
    long, short = Speech(id="a", text="extraordinarily long words"), Speech(id="b", text="next")
    first, second = MovementAuthority(long, "end"), MovementAuthority(short, "end")
    aborted = asyncio.create_task(anext(body.perform(long, first)))
    await aborted
    first.revoke()
    waiting = asyncio.ensure_future(anext(body.perform(short, second), None))
    await asyncio.sleep(0)
    second.revoke()

    assert await waiting is None
