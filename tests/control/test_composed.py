"""A body of several drivers is held to the contract as one, and does what its drivers can and no more."""

import asyncio
from random import Random

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    BlockBehavior,
    FaceLexeme,
    Gaze,
    Gesture,
    Pointing,
    Pose,
    Posture,
    PostureShift,
    Speech,
)
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate, EstimateItem, JointAngle, PlannedTime
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.control.bases.composed import ComposedBody, Member, composed
from engage_hri.services.control.contract.body import BehaviorRefused, Body, MouthShape, MovementAuthority, Reached
from engage_hri.services.control.testing.contract import BodyContract
from engage_hri.services.control.testing.stage import Stage, performed
from engage_hri.services.control.testing.suite import BEHAVIORS, WORLD
from engage_hri.services.control.torso.body import SimulatedBody
from tests.random_cases import share_of, trials

ALL = ("head", "face", "torso", "left_arm", "right_arm", "voice")


def of(*parts: str, name: str = "") -> Member:
    body = SimulatedBody()
    return Member(name or "+".join(parts), body, parts)


def split() -> Body:
    """The torso in three drivers, each of which has all the rest as well and may not use it."""
    return composed([of("head", "torso", "left_arm", "right_arm"), of("face"), of("voice")])


def apart() -> Body:
    """The torso in three drivers, of which none may move the trunk."""
    return composed([of("head", "face"), of("left_arm", "right_arm"), of("voice")])


class TestComposedBody(BodyContract):
    seeds = trials()

    def make(self) -> Body:
        return split()


class TestApart(BodyContract):
    seeds = trials()
    behaviors = tuple(each for each in BEHAVIORS if not isinstance(each, Posture | PostureShift | Pose))

    def make(self) -> Body:
        return apart()


async def test_a_single_driver_with_all_its_parts_stays_as_it_is():
    body = SimulatedBody()

    assert composed([Member("simulated", body, body.capabilities.parts)]) is body


@pytest.mark.parametrize("seed", range(share_of(20)))
async def test_each_part_does_what_it_does_alone(seed: int):
    chance = Random(seed)
    behavior = chance.choice(BEHAVIORS)
    whole, parts = SimulatedBody(), split()
    for body in (whole, parts):
        body.see(WORLD)

    assert _told(parts.estimate(behavior, None, WORLD)) == _told(whole.estimate(behavior, None, WORLD))
    alone, together = await asyncio.gather(performed(whole, behavior), performed(parts, behavior))
    assert together == alone


async def test_behaviors_of_several_drivers_go_on_at_once_and_only_their_own_parts_move():
    body = apart()
    body.see(WORLD)
    before = {each.joint: each.angle for each in body.state().pose.joints}
    point, look = Pointing(id="p", target="near-right"), Gaze(id="g", target="far-left")
    performing = asyncio.gather(
        performed(body, point), performed(body, look), performed(body, Speech(id="s", text="a b"))
    )
    await asyncio.sleep(0.3)
    state = body.state()
    moved = {each.joint for each in state.pose.joints if abs(each.angle - before[each.joint]) > 1e-3}

    assert state.speaking == "a b"
    assert any(joint.startswith("neck") for joint in moved)
    assert any("right" in joint for joint in moved)
    for progress in await performing:
        assert isinstance(progress[-1], Reached)
        assert progress[-1].sync == "end"


async def test_what_one_driver_says_of_poses_is_completed_with_where_the_others_are():
    body = apart()
    here = {each.joint: each.angle for each in body.state().pose.joints}
    estimate = body.estimate(Gaze(id="g", target="far-left"), None, WORLD)
    assert estimate.pose_after is not None
    after = {each.joint: each.angle for each in estimate.pose_after.joints}

    assert after.keys() == here.keys()
    assert {joint for joint in here if after[joint] != pytest.approx(here[joint], abs=1e-9)} <= {
        "neck_yaw",
        "neck_pitch",
    }
    assert len(after) == len(estimate.pose_after.joints)


async def test_an_estimate_leaves_the_parts_of_other_drivers_where_they_are():
    """Each driver has arms and a head of its own, of which the other knows nothing."""
    body = apart()
    body.see(WORLD)
    stage = Stage(body, Pointing(id="p", target="near-right"), "stroke")
    await asyncio.sleep(3.0)
    here = {each.joint: each.angle for each in body.state().pose.joints}
    (rehearsed,) = body.rehearse([EstimateItem(behavior=(look := Gaze(id="g", target="far-left")))], WORLD)
    for estimate in (body.estimate(look, None, WORLD), rehearsed):
        assert estimate.pose_after is not None
        after = {each.joint: each.angle for each in estimate.pose_after.joints}
        assert {joint: angle for joint, angle in after.items() if "right" in joint} == {
            joint: angle for joint, angle in here.items() if "right" in joint
        }
    stage.authority.revoke()
    await stage.over()


async def test_a_plan_is_rehearsed_by_each_driver_with_what_is_its_own():
    body, whole = apart(), SimulatedBody()
    for each in (body, whole):
        each.see(WORLD)
    items = [
        EstimateItem(behavior=behavior, times=(PlannedTime(sync="start", at=float(number)),))
        for number, behavior in enumerate((Gaze(id="g", target="far-left"), Pointing(id="p", target="near-right")))
    ]
    told, alone = body.rehearse(items, WORLD), whole.rehearse(items, WORLD)

    assert [(one.behavior, one.phases, one.feasible) for one in told] == [
        (one.behavior, one.phases, one.feasible) for one in alone
    ]


async def test_what_nobody_can_do_is_refused_and_speech_says_how_to_get_a_voice():
    body = composed([of("head")])
    speech = body.estimate(Speech(id="s", text="hello"), None, WORLD)

    assert body.capabilities.types == tuple(
        name for name in body.capabilities.types if name not in ("speech", "pointing", "gesture", "faceLexeme")
    )
    assert (speech.feasible, speech.warning) == (False, "BEHAVIOR_TYPE_NOT_SUPPORTED")
    assert "--voice silent" in str(speech.fault)
    with pytest.raises(BehaviorRefused):
        await performed(body, Pointing(id="p", target="near-right"))


async def test_an_arm_that_is_not_there_is_not_used():
    body = composed([of("head", "right_arm")])
    body.see(WORLD)
    left = body.estimate(Gesture(id="g", lexeme="BEAT", mode="LEFT_HAND"), None, WORLD)

    assert not left.feasible
    assert "is to have only head, right_arm here, and this takes left_arm" in str(left.fault)
    assert body.estimate(Gesture(id="g", lexeme="BEAT", mode="RIGHT_HAND"), None, WORLD).feasible
    state = body.state()
    assert state.left_arm is None
    assert state.right_arm is not None
    assert not any("left" in each.joint for each in state.pose.joints)


async def test_the_rays_are_of_whom_they_belong_to():
    state = composed([of("voice"), of("left_arm")]).state()

    assert state.gaze is None
    assert state.left_arm is not None


@pytest.mark.parametrize(
    ("one", "other", "reason"),
    [
        (
            ("head", "voice"),
            ("voice",),
            "A and B both have the part 'voice' (say whose it is, by the parts that the other is to have)",
        ),
        (ALL, ALL, "A and B both have the part 'head'"),
    ],
)
async def test_a_part_that_two_have_is_refused_by_name(one: tuple[str, ...], other: tuple[str, ...], reason: str):
    with pytest.raises(InputRefused) as refused:
        composed([of(*one, name="A"), of(*other, name="B")])

    assert reason in str(refused.value)


async def test_a_joint_that_two_have_is_refused_by_name():
    twin = SimulatedBody()
    twin.capabilities = Capabilities(
        body="twin", types=(), parts=("neck",), joints=(replace(twin.capabilities.joints[0], part="neck"),)
    )
    with pytest.raises(InputRefused, match=f"both have the joint '{twin.capabilities.joints[0].joint}'"):
        composed([of("head", "torso", "face", "left_arm", "right_arm", name="A"), Member("B", twin, ("neck",))])


async def test_home_takes_every_driver_home_or_only_whose_parts_are_named():
    body = apart()
    body.see(WORLD)
    home = body.state().pose
    for behavior in (Gaze(id="g", target="far-left"), Pointing(id="p", target="near-right")):
        stream = body.perform(behavior, _authority(behavior))
        async for progress in stream:
            if isinstance(progress, Reached) and progress.sync == "stroke":
                break
    await body.home(("head",))
    by_part = _moved(home, body.state().pose)
    await body.home()

    assert not any(joint.startswith("neck") for joint in by_part)
    assert not _moved(home, body.state().pose)


async def test_the_lips_move_with_the_voice_of_another_driver_and_faults_of_each_are_told():
    class Lips(SimulatedBody):
        shapes: tuple[MouthShape, ...] = ()

        def move_lips(self, shapes: object) -> None:
            self.shapes = tuple(shapes)  # type: ignore[arg-type]

    face, voice = Lips(), SimulatedBody()
    body = ComposedBody([Member("face", face, ("face",)), Member("voice", voice, ("voice",))])
    told: list[Fault] = []
    body.on_fault = told.append
    voice.on_lips((MouthShape(1.0, 0.5),))
    voice.on_fault(Fault(reason="no sound"))
    face.on_fault(Fault(reason="no screen"))
    over: list[str] = []
    body.on_recovery = over.append
    voice.on_recovery("it sounds again")

    assert face.shapes == (MouthShape(1.0, 0.5),)
    assert [fault.reason for fault in told] == ["no sound", "no screen"]
    assert over == ["it sounds again"]


def _told(estimate: Estimate) -> tuple[object, ...]:
    """An estimate, whatever the order of the joints in its poses, which are rounded."""
    poses = [
        pose and {each.joint: round(each.angle, 9) for each in pose.joints}
        for pose in (estimate.pose_after, estimate.pose_end)
    ]
    return replace(estimate, pose_after=None, pose_end=None), *poses


def _authority(behavior: BlockBehavior) -> MovementAuthority:
    return MovementAuthority(behavior, "end")


def _moved(one: BodyPose, other: BodyPose) -> set[str]:
    before: dict[str, JointAngle] = {each.joint: each for each in one.joints}
    return {each.joint for each in other.joints if abs(each.angle - before[each.joint].angle) > 0.01}


async def test_a_smile_goes_to_the_driver_with_the_face():
    body = split()
    estimate = body.estimate(FaceLexeme(id="f", lexeme="SMILE"), None, WORLD)

    assert estimate.parts == ("face",)


# -- faults ---------------------------------------------------------------------------------------------------------


async def test_a_fault_goes_to_the_driver_whose_part_it_is() -> None:
    head, arms = of("head", "face"), of("left_arm", "right_arm")
    body = composed([head, arms])
    body.switch_faults((BodyFault(kind="slow", part="right_arm", amount=2.0), BodyFault(kind="stall", part="head")))

    assert [fault.kind for fault in arms.body.faults] == ["slow"]
    assert [fault.kind for fault in head.body.faults] == ["stall"]
    assert {fault.kind for fault in body.faults} == {"slow", "stall"}


async def test_a_fault_that_nobody_can_play_changes_nothing() -> None:
    body = composed([of("head", "face"), of("voice")])
    body.switch_faults((BodyFault(kind="slow", part="head", amount=2.0),))
    before = body.faults
    with pytest.raises(InputRefused, match="no driver of this body can play 'slow'"):
        body.switch_faults((BodyFault(kind="slow", part="left_arm", amount=2.0),))

    assert body.faults == before


# -- alive ----------------------------------------------------------------------------------------------------------


async def test_each_driver_moves_by_itself_what_it_has_here_and_no_more() -> None:
    """Two whole torsos, of which one is to have the face and the other the rest: each blinks, and one is seen."""
    face = Member("face", SimulatedBody(alive=True), ("face",))
    rest = Member("rest", SimulatedBody(alive=True), ("head", "torso", "left_arm", "right_arm", "voice"))
    body = ComposedBody([face, rest])
    body.move_lips([MouthShape(0.0, 0.8), MouthShape(60.0, 0.0)])
    await asyncio.sleep(1.0)
    own = {limit.joint for limit in rest.body.capabilities.joints if limit.part != "face"}
    idle = body.idle()
    expected = {joint: angle for joint, angle in face.body.idle().added.items() if joint not in own}
    expected |= {joint: angle for joint, angle in rest.body.idle().added.items() if joint in own}

    assert idle.added == expected
    assert idle.added["jaw"] > 0.0
    assert idle.quick_at == min(face.body.idle().quick_at, rest.body.idle().quick_at)


@pytest.mark.parametrize("names", [("A", "B"), ("simulated", "simulated")], ids=["two names", "one name"])
async def test_a_fault_without_a_part_is_played_once_by_each_driver_that_can(names: tuple[str, str]) -> None:
    """What counts is the driver, not how it was asked for: a body may be made of one kind of driver twice."""
    head, arms = of("head", "face", name=names[0]), of("left_arm", "right_arm", name=names[1])
    body, beside = composed([head, arms]), BodyFault(kind="miscalibrated", amount=4.0)
    body.switch_faults((beside, BodyFault(kind="slow", part="right_arm", amount=2.0)))

    assert head.body.faults == (beside,)
    assert [fault.kind for fault in arms.body.faults] == ["miscalibrated", "slow"]
    seen, believed = body.seen(), body.state()
    assert seen is not None
    assert seen.gaze is not None
    assert believed.gaze is not None
    cosine = sum(a * b for a, b in zip(seen.gaze.axis, believed.gaze.axis, strict=True))
    alone = SimulatedBody()
    alone.switch_faults((beside,))
    told, state = alone.seen(), alone.state()
    assert told is not None
    assert told.gaze is not None
    assert state.gaze is not None
    assert cosine == pytest.approx(sum(a * b for a, b in zip(told.gaze.axis, state.gaze.axis, strict=True)))
