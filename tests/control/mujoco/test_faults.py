"""Faults of the torso with physics: with each the law holds, and none of them is a matter of scripted times."""

import asyncio
import math
from random import Random

import pytest
from msgspec.structs import replace

pytest.importorskip("mujoco", reason="needs the extra `mujoco`")

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, Gesture, Pointing
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import InputRefused
from engage_hri.services.control.contract.body import BehaviorRefused, BodyFailed
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.mujoco.body import MujocoBody
from engage_hri.services.control.mujoco.faults import OURS
from engage_hri.services.control.testing import WORLD, Stage, performed, times
from engage_hri.services.control.testing.truth import ARMS, LOOKS, Witness
from tests.control.watching import Bystander
from tests.random_cases import share_of

POINT = Pointing(id="point", target="near-right", mode="RIGHT_HAND")
LOOK = Gaze(id="look", target="near-right")
BEAT = Gesture(id="beat", lexeme="BEAT", mode="RIGHT_HAND")


def sick(*faults: BodyFault) -> MujocoBody:
    body = MujocoBody()
    body.see(WORLD)
    body.switch_faults(faults)
    return body


async def took(body: MujocoBody, behavior: BlockBehavior) -> float:
    at = times(await performed(body, behavior))
    return at["end"] - at["start"]


async def failure(body: MujocoBody, behavior: BlockBehavior) -> tuple[str, list[str]]:
    """Why a behavior fails, and the points that it had passed."""
    stage = Stage(body, behavior, "end")
    with pytest.raises(BodyFailed) as failed:
        await stage.over()
    return failed.value.fault.reason, stage.passed


async def test_stiff_gears_make_it_late_and_stiffer_ones_later():
    healthy = await took(sick(), POINT)
    by_factor = [await took(sick(BodyFault(kind="slow", amount=factor)), POINT) for factor in (2.0, 4.0)]

    assert healthy + 0.3 < by_factor[0] < by_factor[1] - 0.5


async def test_a_dead_motor_fails_by_the_name_of_its_joint():
    reason, passed = await failure(sick(BodyFault(kind="stalled", part="right_elbow")), POINT)

    assert reason.startswith("right_elbow stands at 11"), reason
    assert reason.endswith("its motor gives no torque")
    assert "stroke" not in passed


async def test_a_weak_motor_gives_its_share_of_torque_and_its_failure_says_so():
    reason, _ = await failure(sick(BodyFault(kind="weak", part="right_elbow", amount=0.05)), POINT)

    assert "its motor gives all it can, 0.4 N m" in reason  # of 8


async def test_a_motor_that_dies_while_it_holds_cannot_pass_what_it_holds_for():
    body = sick()
    stage = Stage(body, POINT, "stroke")
    await asyncio.sleep(4.0)
    assert stage.waits_at == ["stroke_end"]
    body.switch_faults([BodyFault(kind="weak", part="right_arm", amount=0.02)])
    await asyncio.sleep(1.0)
    stage.authority.extend("end")
    with pytest.raises(BodyFailed):
        await stage.over()

    assert stage.passed[-1] == "stroke"


async def test_a_weak_arm_sags():
    body = sick()
    await asyncio.sleep(0.5)
    before = kinematics_of(body)
    body.switch_faults([BodyFault(kind="weak", part="right_arm", amount=0.02)])
    await asyncio.sleep(3.0)

    assert kinematics_of(body) < before - 0.02


def kinematics_of(body: MujocoBody) -> float:
    """Height of the right hand."""
    arm = body.state().right_arm
    assert arm is not None
    assert arm.tip is not None
    return arm.tip[2]


async def test_a_hot_motor_gives_less_and_less_and_then_fails_by_that():
    body = sick(BodyFault(kind="hot", part="right_arm"))
    stage = Stage(body, POINT, "stroke")
    await asyncio.sleep(0.5)
    early = body.bench.physics.temperatures.max()
    await asyncio.sleep(20.0)
    stage.authority.extend("end")
    with pytest.raises(BodyFailed) as failed:
        await stage.over()

    assert "overheated" in failed.value.fault.reason
    assert early < body.bench.physics.temperatures.max() <= 120.0


async def test_a_hot_motor_cools():
    body = sick(BodyFault(kind="hot", part="right_arm", amount=1.0))
    await asyncio.sleep(2.0)
    hot = body.bench.physics.temperatures.max()
    await asyncio.sleep(600.0)
    await body.home()

    assert body.bench.physics.temperatures.max() < 30.0 < hot


@pytest.mark.parametrize(
    ("part", "behavior"), [("right_arm", POINT), ("right_arm", BEAT), ("head", Gaze(id="look", target="far-left"))]
)
async def test_what_stands_in_the_way_is_touched_and_named(part: str, behavior: BlockBehavior):
    reason, passed = await failure(sick(BodyFault(kind="blocked", part=part)), behavior)

    assert f"it is in contact with obstacle {part}" in reason
    assert "stroke" not in passed


async def test_an_arm_runs_into_a_table_that_is_higher_than_it_believes():
    assert await took(sick(), POINT) > 0.0
    reason, passed = await failure(sick(BodyFault(kind="table")), POINT)

    assert "it is in contact with high table" in reason
    assert "stroke" not in passed


async def test_a_healthy_arm_touches_nothing():
    body, touched = sick(), set()
    body.pulse.on_step = lambda at: touched.update(contact.thing for contact in body.bench.physics.contacts())
    for target in ("near-right", "far-left"):
        await took(body, replace(POINT, target=target, mode=None))

    assert touched == set()


async def test_noisy_encoders_are_as_noisy_as_they_are_said_to_be():
    body = sick(BodyFault(kind="noisy", amount=0.3))
    deviations: list[float] = []

    def look(at: float) -> None:
        physics = body.bench.physics
        deviations.extend((physics.measured - physics.angles).tolist())

    body.pulse.on_step = look
    await took(body, POINT)

    spread = math.degrees(math.sqrt(sum(each * each for each in deviations) / len(deviations)))
    assert spread == pytest.approx(0.3, rel=0.1)


async def test_a_miscalibrated_arm_points_beside_and_does_not_know_it():
    body = sick(BodyFault(kind="miscalibrated", part="right_shoulder_yaw", amount=4.0))
    Stage(body, POINT, "stroke")
    await asyncio.sleep(4.0)
    physics = body.bench.physics
    true = {**kinematics.HOME, **dict(zip(physics.joints, physics.angles.tolist(), strict=True))}
    believed = body.state().right_arm
    assert believed is not None
    cosine = sum(a * b for a, b in zip(believed.axis, kinematics.arm(true, "right").axis, strict=True))

    assert math.degrees(math.acos(cosine)) == pytest.approx(4.0, abs=0.5)
    await body.home()


async def test_a_sticky_joint_moves_by_jerks():
    """Told to creep at 3 degrees a second a good joint does, and a sticky one stands, slips and stands again."""
    slips = {}
    for faults in ((), (BodyFault(kind="sticky", part="right_elbow", amount=0.6),)):
        physics = sick(*faults).bench.physics
        number, standing, count = physics.joints.index("right_elbow"), True, 0
        plan = physics.measured.copy()
        for step in range(1, 600):
            plan[number] -= math.radians(3.0) * 0.005
            physics.advance(0.005 * step, plan)
            speed = abs(float(physics.speeds[number]))
            if standing and speed > math.radians(8.0):
                standing, count = False, count + 1
            standing = standing or speed < math.radians(1.0)
        slips[bool(faults)] = count

    assert slips[False] <= 1
    assert slips[True] >= 3


@pytest.mark.parametrize("kind", OURS)
@pytest.mark.parametrize("crowd", [LOOKS, ARMS], ids=["looks", "arms"])
async def test_with_each_fault_no_untrue_point_and_an_end_by_name(kind: str, crowd: tuple):
    chance = Random(f"{kind} {len(crowd)}")
    body = sick()
    await body.home()
    witness = Witness(Bystander(), body)
    body.switch_faults([BodyFault(kind=kind)])
    for number in range(14):
        await asyncio.sleep(chance.choice((0.0, chance.uniform(0.0, 0.5), chance.uniform(0.0, 2.5))))
        behavior = chance.choice(crowd)(f"{number}", chance, [each.id for each in WORLD.entities])
        witness.begin(behavior, chance.choice(("end", *sync_points(behavior))))
    for stage in witness.stages:
        stage.authority.extend("end")
    reasons: list[str] = []
    for stage in witness.stages:
        try:
            await stage.over()
        except BehaviorRefused:
            continue
        except BodyFailed as failed:
            reasons.append(failed.fault.reason)
            assert "end" not in stage.passed
        else:
            assert "end" in stage.passed or stage.authority.revoked

    assert all(reason.split()[0] in kinematics.LIMIT or "out of reach" in reason for reason in reasons), reasons
    # Where nothing is where it seems, only what the encoders tell can be held against a report.
    assert witness.lies == [], witness.lies


def test_each_fault_is_described():
    assert all(kind.does and (kind.usual is None or kind.low <= kind.usual <= kind.high) for kind in OURS.values())


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (BodyFault(kind="drunk"), "cannot play 'drunk'"),
        (BodyFault(kind="slow", part="tail"), "slow of 'tail'"),
        (BodyFault(kind="slow", amount=0.5), "expected 1..20"),
        (BodyFault(kind="stalled", amount=2.0), "takes no amount"),
        (BodyFault(kind="stalled", before="stroke"), "takes no before"),
        (BodyFault(kind="blocked", part="face"), "blocked of 'face'"),
    ],
)
async def test_what_cannot_be_played_is_refused_and_changes_nothing(fault: BodyFault, said: str):
    body = sick(BodyFault(kind="slow"))
    with pytest.raises(InputRefused, match=said):
        body.switch_faults([fault])

    assert body.faults == (BodyFault(kind="slow"),)
    body.switch_faults([])
    assert body.faults == ()


@pytest.mark.parametrize("seed", range(share_of(6)))
@pytest.mark.parametrize("kind", ["slow", "weak", "blocked"])
async def test_looks_and_shifts_over_one_another_tell_their_points_from_the_first_on(kind: str, seed: int):
    """A shift over which a look comes before the joints have let it set out told its end alone."""
    body, chance = MujocoBody(), Random(seed)
    body.see(WORLD)
    stages = []
    async with body.connected():
        body.switch_faults([BodyFault(kind=kind)])
        for number in range(10):
            make, target = chance.choice((Gaze, GazeShift)), chance.choice([each.id for each in WORLD.entities])
            stages.append(Stage(body, make(id=f"{number}", target=target), "end"))
            await asyncio.sleep(chance.choice((0.0, 0.0, 0.05, 0.5, 1.5)))
        await asyncio.gather(*(stage.task for stage in stages), return_exceptions=True)

    assert any(stage.passed for stage in stages)
    for stage in stages:
        assert stage.passed == list(stage.authority.points[: len(stage.passed)])


async def test_a_head_whose_motor_is_weak_falls_no_farther_than_its_range() -> None:
    """It falls onto the end stop of its pitch, which gives way a little."""
    body = MujocoBody()
    body.see(WORLD)
    limit = next(limit for limit in body.capabilities.joints if limit.joint == "neck_pitch")
    body.switch_faults([BodyFault(kind="weak", part="head")])
    stage, lowest = Stage(body, Gaze(id="look", target="near-right"), "end"), 0.0
    for _ in range(400):
        await asyncio.sleep(0.005)
        lowest = min(lowest, next(each.angle for each in body.state().pose.joints if each.joint == "neck_pitch"))
    with pytest.raises(BodyFailed):
        await stage.over()
    assert limit.low <= lowest < limit.low + math.radians(1.0)
