"""A miscalibrated body: people see where it really points, measurements correct it, and what is stated is true.

The oracle has forward kinematics of its own: matrices in homogeneous coordinates, of nothing but the lengths that
services/control/figure/kinematics.py states.
"""

import asyncio
import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from random import Random

import numpy as np
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Pointing
from engage_hri.schemas.body import (
    Capabilities,
    EstimateBehaviors,
    EstimateItem,
    Estimates,
    Ray,
    RobotSeen,
    RobotState,
)
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import Robot
from engage_hri.services.control.calibrating import OTHER_ROWS, Fit, SimulatedEyes, fit, marks, measured
from engage_hri.services.control.config import ControlConfig, Miscalibrated, Variability
from engage_hri.services.control.contract.calibration import Calibration, calibrated, read, written
from engage_hri.services.control.service import embody
from engage_hri.services.control.testing import WORLD, Stage, performed, times
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.runtime.service import running
from tests.control.directing import robot
from tests.random_cases import share_of

PARTS = ("head", "left_arm", "right_arm")
OFF = {
    "right_shoulder_yaw": 4.0, "right_shoulder_pitch": -2.0, "right_elbow": 3.0, "left_shoulder_yaw": -3.0,
    "neck_yaw": 2.0, "neck_pitch": -1.5,
}  # fmt: skip
Angles = Mapping[str, float]


def turn(axis: int, angle: float) -> np.ndarray:
    one, other = [each for each in range(3) if each != axis]
    sign = -1.0 if axis == 1 else 1.0
    matrix = np.eye(4)
    matrix[one, one] = matrix[other, other] = math.cos(angle)
    matrix[other, one], matrix[one, other] = sign * math.sin(angle), -sign * math.sin(angle)
    return matrix


def move(x: float, y: float, z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = (x, y, z)
    return matrix


def trunk(angles: Angles) -> np.ndarray:
    return move(0, 0, 0.60) @ turn(2, angles["torso_turn"]) @ turn(1, angles["torso_lean"])


def true_ray(angles: Angles, part: str) -> tuple[np.ndarray, np.ndarray]:
    """Origin and axis of a gaze or a forearm. Angles in radians."""
    if part == "head":
        neck = move(0, 0, 0.50) @ turn(2, angles["neck_yaw"]) @ turn(1, -angles["neck_pitch"])
        eyes = trunk(angles) @ neck @ turn(0, -angles["neck_roll"]) @ move(0.05, 0, 0.07)
        return eyes[:3, 3], eyes[:3, 0]
    side, y = part.removesuffix("_arm"), 0.20 if part == "left_arm" else -0.20
    shoulder = move(0, y, 0.35) @ turn(2, angles[f"{side}_shoulder_yaw"])
    elbow = trunk(angles) @ shoulder @ turn(1, -angles[f"{side}_shoulder_pitch"]) @ move(0, 0, -0.20)
    forearm = elbow @ turn(1, -angles[f"{side}_elbow"])
    return elbow[:3, 3], -forearm[:3, 2]


def degrees_beside(origin: np.ndarray, axis: np.ndarray, place: tuple[float, float, float]) -> float:
    way = np.subtract(place, origin)
    return math.degrees(math.acos(max(-1.0, min(1.0, float(axis @ way) / float(np.linalg.norm(way))))))


def told(body: SimulatedBody) -> dict[str, float]:
    return {each.joint: each.angle for each in body.state().pose.joints}


def body_off(off: Mapping[str, float] = OFF) -> SimulatedBody:
    faults = tuple(Miscalibrated(part=joint, angle=angle) for joint, angle in off.items())
    body = SimulatedBody(deviations=Variability(miscalibrated=faults))
    body.see(WORLD)
    return body


def real(body: SimulatedBody, off: Mapping[str, float], corrected: Mapping[str, float] = {}) -> dict[str, float]:
    """The true joint angles: what the body tells, which it has corrected, and what is off."""
    return {
        joint: angle + math.radians(off.get(joint, 0.0) - corrected.get(joint, 0.0))
        for joint, angle in told(body).items()
    }


def agree(ray: Ray | None, other: tuple[np.ndarray, np.ndarray]) -> bool:
    return (
        ray is not None
        and np.allclose(ray.origin, other[0], atol=1e-9)
        and np.allclose(ray.axis, other[1], atol=1e-9)
    )


# -- the fault ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
async def test_what_people_see_is_the_body_with_its_true_angles(seed: int) -> None:
    chance = Random(seed)
    off = {joint: chance.uniform(-6.0, 6.0) for joint in (*OFF, "torso_turn", "torso_lean", "neck_roll")}
    body = body_off(off)
    stages = [Stage(body, behavior, "stroke") for behavior in behaviors()]
    for _ in range(20):
        await asyncio.sleep(0.1)
        seen = body.seen()
        assert seen is not None
        for part, ray in (("head", seen.gaze), ("left_arm", seen.left_arm), ("right_arm", seen.right_arm)):
            assert agree(ray, true_ray(real(body, off), part)), part
        state = body.state()
        for part, ray in (("head", state.gaze), ("left_arm", state.left_arm), ("right_arm", state.right_arm)):
            assert agree(ray, true_ray(told(body), part)), part
    for stage in stages:
        stage.authority.extend("end")
        await stage.over()


def behaviors() -> list[BlockBehavior]:
    return [
        Gaze(id="g", target="human"),
        Pointing(id="r", target="near-right", mode="RIGHT_HAND"),
        Pointing(id="l", target="far-left", mode="LEFT_HAND"),
    ]


async def test_it_says_what_its_joints_measure_and_is_beside() -> None:
    body, healthy = body_off(), SimulatedBody()
    healthy.see(WORLD)
    point = Pointing(id="p", target="near-right", mode="RIGHT_HAND")
    assert healthy.seen() is None
    assert body.estimate(point, None, WORLD) == healthy.estimate(point, None, WORLD)
    one, other = [times(await performed(each, point)) for each in (body, healthy)]
    assert one["end"] - one["start"] == pytest.approx(other["end"] - other["start"])

    stage = Stage(body, point, "stroke")
    await asyncio.sleep(5.0)
    assert stage.waits_at == ["stroke_end"]
    target = (0.45, -0.25, 0.73)
    assert degrees_beside(*true_ray(told(body), "right_arm"), target) < 1e-4
    assert 3.0 < degrees_beside(*true_ray(real(body, OFF), "right_arm"), target) < 6.0
    stage.authority.extend("end")
    await stage.over()


async def test_the_bus_tells_what_people_see_for_as_long_as_it_differs(hub: MemoryHub) -> None:
    async with robot(hub) as client, Robot.on(hub.join("guard", "operator")) as guard:
        with client.bus.subscribe(keys.ROBOT_SEEN) as inbox:
            await asyncio.sleep(3.0)
            assert len(inbox) == 0
            await guard.switch_faults([BodyFault(kind="miscalibrated", part="right_arm", amount=5.0)])
            client.perform(Pointing(id="p", target="near-right", mode="RIGHT_HAND"), "stroke")
            await asyncio.sleep(5.0)
            await guard.switch_faults()
            await asyncio.sleep(5.0)
            seen = []
            while len(inbox):
                received = await inbox.next()
                assert received is not None
                seen.append(received.message)
        state = client.of(RobotState)[-1]

    assert all(isinstance(each, RobotSeen) for each in seen)
    *beside, last = seen
    assert len(beside) > 20
    assert beside[-1].right_arm is not None
    assert isinstance(state, RobotState)
    assert state.right_arm is not None
    assert math.dist(beside[-1].right_arm.axis, state.right_arm.axis) > math.radians(5.0)
    assert (last.gaze, last.left_arm, last.right_arm) == (None, None, None)


# -- measuring and fitting ----------------------------------------------------------------------------------------


async def fits(body: SimulatedBody, world: World, spread: float, seed: int = 0) -> list[Fit]:
    found = await measured(body, world, PARTS, SimulatedEyes(body, spread, seed), pytest.fail)
    own = {part: [each for each in found if each.part == part] for part in PARTS}
    return [fit(part, own[part], partial(body.ray_at, part), joints(body, part)) for part in PARTS]


def joints(body: SimulatedBody, part: str) -> list[str]:
    return [limit.joint for limit in body.capabilities.joints if limit.part == part]


async def true_errors(
    body: SimulatedBody, off: Mapping[str, float], corrected: Mapping[str, float], world: World
) -> dict[str, list[float]]:
    """Degrees by which looks and points at all of a world really are beside, by part."""
    body.see(world)
    beside: dict[str, list[float]] = {part: [] for part in PARTS}
    for part in PARTS:
        for mark in world.objects:
            hand = f"{part.removesuffix('_arm').upper()}_HAND"
            behavior = Gaze(id="g", target=mark.id) if part == "head" else Pointing(id="p", target=mark.id, mode=hand)
            if not body.estimate(behavior, None, world).feasible:
                continue
            stage = Stage(body, behavior, "stroke")
            await asyncio.sleep(5.0)
            ray = true_ray(real(body, off, corrected), part)
            beside[part].append(degrees_beside(*ray, mark.position))
            stage.authority.extend("end")
            await stage.over()
    return beside


@pytest.mark.parametrize("seed", range(share_of(4)))
async def test_a_corrected_body_points_right_and_within_what_is_stated(seed: int) -> None:
    """At places where nothing was measured, by forward kinematics of the test's own."""
    chance = Random(seed)
    off = {joint: chance.uniform(-6.0, 6.0) for joint in OFF}
    body = body_off(off)
    before = await true_errors(body, off, {}, marks(OTHER_ROWS))
    found = await fits(body, marks(), 0.003, seed)
    corrected = {joint: offset for each in found for joint, offset in each.offsets.items()}
    body.calibrate(Calibration(offsets=corrected).radians)
    after = await true_errors(body, off, corrected, marks(OTHER_ROWS))

    stated = {each.part: each.error for each in found}
    assert max(max(each) for each in before.values()) > 3.0
    for part in PARTS:
        assert len(after[part]) >= 10
        assert max(after[part]) < stated[part] < 1.2
        (one,) = [each for each in found if each.part == part]
        assert one.after[0] < 0.6  # 3 mm at half a metre


async def test_exact_measurements_leave_nothing() -> None:
    body = body_off()
    found = await fits(body, marks(), 0.0)
    corrected = {joint: offset for each in found for joint, offset in each.offsets.items()}

    for joint in ("right_shoulder_yaw", "left_shoulder_yaw", "neck_yaw", "neck_pitch"):
        assert corrected[joint] == pytest.approx(OFF[joint], abs=0.01)
    assert all(each.after[1] < 0.05 for each in found)
    assert {each.error for each in found} == {0.1}


async def test_as_many_as_are_said_lie_within_the_stated_error() -> None:
    """Of new measurements, made by the same eyes: 19 in 20, over many calibrations."""
    inside: list[bool] = []
    for seed in range(8):
        chance = Random(seed)
        off = {joint: chance.uniform(-5.0, 5.0) for joint in OFF}
        body = body_off(off)
        few = World(entities=tuple(chance.sample(marks().objects, 20)))
        found = await fits(body, few, 0.004, seed)
        body.calibrate(Calibration(offsets={j: o for each in found for j, o in each.offsets.items()}).radians)
        again = await measured(
            body, marks(OTHER_ROWS, ()), PARTS, SimulatedEyes(body, 0.004, seed + 100), pytest.fail
        )
        for each in found:
            own = [one for one in again if one.part == each.part]
            angles = [degrees_beside(np.array(one.said.origin), np.array(one.said.axis), one.seen) for one in own]
            inside += [angle <= each.error for angle in angles]

    assert len(inside) > 300
    assert 0.93 < sum(inside) / len(inside) < 0.995


async def test_few_measurements_are_not_taken_for_good_ones() -> None:
    body = body_off()
    found = await measured(body, marks(), PARTS, SimulatedEyes(body, 0.003), pytest.fail)
    for part in PARTS:
        own, names = [each for each in found if each.part == part], joints(body, part)
        few = [fit(part, own[start::8], partial(body.ray_at, part), names).error for start in range(8)]
        assert sum(few) / 8 > 1.1 * fit(part, own, partial(body.ray_at, part), names).error
    one = await measured(
        body, World(entities=marks().objects[10:11]), ["head"], SimulatedEyes(body, 0.0), pytest.fail
    )
    assert fit("head", one, lambda pose: body.ray_at("head", pose), joints(body, "head")).error == math.inf


async def test_of_a_body_whose_geometry_nobody_knows_the_error_alone_is_stated() -> None:
    body = body_off()
    found = await measured(body, marks(), ["right_arm"], SimulatedEyes(body, 0.0), pytest.fail)
    one = fit("right_arm", found, lambda pose: None, joints(body, "right_arm"))

    assert one.offsets == {}
    assert one.before == one.after
    assert one.before[1] <= one.error


# -- files --------------------------------------------------------------------------------------------------------


def test_a_file_says_what_was_written(tmp_path: Path) -> None:
    said = Calibration(offsets={"neck_yaw": 1.5}, errors={"head": 0.4, "right_arm": 2.0})
    file = tmp_path / "c.toml"
    file.write_text(written(said, "simulated", {"head": ["24 measurements", "at most 0.9"]}))

    assert read(str(file)) == said
    assert "# 24 measurements\n# at most 0.9\nhead = 0.400" in file.read_text()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[errors]\nhand = 3", r"errors\.hand: expected one of head, left_arm, right_arm"),
        ("[errors]\nhead = -1", r"errors\.head is -1"),
        ("[offsets]\nneck_yaw = inf", r"offsets\.neck_yaw is inf: expected degrees"),
        ("[offset]\nneck_yaw = 1", "unknown field `offset`"),
        ("neck_yaw", "c.toml"),
        ("[offsets]\nthird_elbow = 1", "no joint third_elbow.*its joints are torso_turn"),
    ],
)
async def test_a_file_with_a_mistake_is_refused_by_name(tmp_path: Path, text: str, reason: str) -> None:
    file = tmp_path / "c.toml"
    file.write_text(text)

    with pytest.raises(InputRefused, match=reason):
        calibrated(SimulatedBody(), str(file))
    with pytest.raises(InputRefused, match="`engage calibrate body` makes one"):
        read(str(tmp_path / "none.toml"))


class Rigid(SimulatedBody):
    """A body that corrects nothing."""

    calibrate = SimulatedBody.__mro__[2].calibrate  # type: ignore[attr-defined]


async def test_a_body_that_corrects_nothing_refuses_offsets_and_takes_errors(tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    file.write_text("[offsets]\nneck_yaw = 1")
    with pytest.raises(InputRefused, match="does not correct the angle of neck_yaw"):
        calibrated(Rigid(), str(file))
    file.write_text("[errors]\nhead = 1")
    assert calibrated(Rigid(), str(file)).errors == {"head": 1.0}


# -- what is stated -----------------------------------------------------------------------------------------------


async def test_estimates_and_states_say_how_far_they_may_be_beside(hub: MemoryHub, tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    file.write_text("[offsets]\nright_shoulder_yaw = 4\n[errors]\nright_arm = 3\nhead = 1")
    body = body_off({"right_shoulder_yaw": 4.0})

    async def serve(bus, ready):  # type: ignore[no-untyped-def]
        await embody(bus, ready, ControlConfig(calibration=str(file)), body)

    asked = EstimateBehaviors(items=tuple([EstimateItem(behavior=each) for each in behaviors()]))
    async with running(hub, {"control": serve}):
        bus = hub.join("generation")
        bus.publish(keys.WORLD, WORLD)
        await asyncio.sleep(0.1)
        answer = await bus.query(keys.ESTIMATE, asked)
        with bus.subscribe(keys.ROBOT_STATE) as inbox:
            received = await inbox.next()
    assert isinstance(answer, Estimates)
    rays = [each.ray for each in answer.items]
    assert [ray and math.degrees(ray.error) for ray in rays] == pytest.approx([1.0, 3.0, 0.0])
    assert received is not None
    assert isinstance(received.message, RobotState)
    assert received.message.right_arm is not None
    assert received.message.right_arm.error == pytest.approx(math.radians(3.0))
    assert body.seen() is None  # corrected by just what it is off


def test_capabilities_of_a_body_say_which_marks_it_has() -> None:
    assert len({entity.id for entity in marks().entities}) == len(marks().entities) == 24
    assert Capabilities(body="b", types=(), parts=()).faults == ()
    assert all(isinstance(entity, Entity) for entity in marks(OTHER_ROWS).entities)
