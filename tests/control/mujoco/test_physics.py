# ruff: noqa: E402
"""The model against the kinematics, inverse kinematics against finite differences, and physics that rests."""

import asyncio
import math
from pathlib import Path

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="needs the extra `mujoco`")

from engage_hri.schemas.behaviors import Gaze, Pointing
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import InputRefused
from engage_hri.services.control.config import Variability
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.mujoco.body import MujocoBody
from engage_hri.services.control.mujoco.ik import Chain
from engage_hri.services.control.mujoco.model import MOTORS, scene
from engage_hri.services.control.mujoco.physics import Physics
from engage_hri.services.control.mujoco.robot import Place, read
from engage_hri.services.control.testing import WORLD, Stage, performed, times
from engage_hri.services.runtime.steps import finished
from engage_hri.services.tangram.table import tangram_table

NEAR_ALREADY = (
    BodyFault(kind="displaced", part="right_shoulder_pitch", amount=20.0),
    BodyFault(kind="displaced", part="right_elbow", amount=95.0),
)


def model() -> object:
    return mujoco.MjModel.from_xml_string(scene(tangram_table()))


def test_the_model_has_eyes_and_hands_where_the_kinematics_has_them():
    physics, chance = Physics(model(), MOTORS, kinematics.LIMIT, at=0.0), np.random.default_rng(0)
    for _ in range(20):
        angles = {j: float(chance.uniform(kinematics.LIMIT[j].low, kinematics.LIMIT[j].high)) for j in MOTORS}
        physics.place(angles)
        pose = {**kinematics.HOME, **angles}
        eyes = physics.data.site("eyes")
        assert eyes.xpos == pytest.approx(kinematics.gaze(pose).origin, abs=1e-9)
        assert eyes.xmat.reshape(3, 3)[:, 0] == pytest.approx(kinematics.gaze(pose).axis, abs=1e-9)
        for side in ("left", "right"):
            arm = kinematics.arm(pose, side)
            assert physics.data.site(f"{side}_elbow").xpos == pytest.approx(arm.origin, abs=1e-9)
            assert physics.data.site(f"{side}_hand").xpos == pytest.approx(arm.tip, abs=1e-9)


@pytest.mark.parametrize("limb", ["head", "arm"])
def test_the_jacobian_is_that_of_finite_differences(limb: str):
    chance, built = np.random.default_rng(1), model()
    if limb == "head":
        chain = Chain(built, ("neck_yaw", "neck_pitch", "neck_roll"), Place(body="head", at=(0.05, 0.0, 0.07)))
    else:
        joints = tuple(f"left_{name}" for name in ("shoulder_yaw", "shoulder_pitch", "elbow"))
        elbow, hand = Place(body="left_forearm"), Place(body="left_forearm", at=(0.0, 0.0, -0.25))
        chain = Chain(built, joints, elbow, hand)
    target, step = np.array((0.5, 0.1, 0.73)), 1e-6
    for _ in range(10):
        q = chance.uniform(chain._low, chain._high)
        # So near to target and floor that all terms count.
        where = {"floor": 5.0, "distance": 5.0} if limb == "arm" else {"floor": -9.0, "distance": 0.0}
        chain._place_at(q)
        if (chain._axis()[1] @ (target - chain._axis()[0])) < 0.05:
            continue
        _, exact = chain._errors(target, **where)
        for number in range(len(q)):
            moved = []
            for sign in (1, -1):
                other = q.copy()
                other[number] += sign * step
                chain._place_at(other)
                moved.append(chain._errors(target, **where)[0])
            assert exact[:, number] == pytest.approx((moved[0] - moved[1]) / (2 * step), abs=1e-4)


def test_inverse_kinematics_agrees_with_the_closed_form():
    built = model()
    chain = Chain(built, ("neck_yaw", "neck_pitch"), Place(body="head", at=(0.05, 0.0, 0.07)))
    for entity in WORLD.entities:
        found = finished(chain.aiming(built.qpos0, entity.position, {"neck_yaw": 0.0, "neck_pitch": 0.0}))
        assert tuple(found.angles.values()) == pytest.approx(
            kinematics.neck_angles(entity.position, kinematics.HOME), abs=2e-3
        )


async def test_the_plan_and_the_joints_agree_within_the_stated_error_while_it_is_healthy():
    """Figs 4.5 to 4.7 stand on this: what is planned is what is measured, as long as nothing is wrong."""
    body, worst = MujocoBody(), {"head": 0.0, "right_arm": 0.0}
    body.see(WORLD)

    def look(at: float) -> None:
        plan, measured = body.planned(), body.bench.measured
        for joint, angle in measured.items():
            part = kinematics.LIMIT[joint].part
            if part in worst:
                worst[part] = max(worst[part], abs(math.degrees(angle - plan[joint])))

    body.pulse.on_step = look
    await performed(body, Gaze(id="g", target="near-right"))
    await performed(body, Pointing(id="p", target="near-right", mode="RIGHT_HAND"))

    assert 0.1 < worst["head"] < 4.0
    assert 0.1 < worst["right_arm"] < 6.0


async def test_it_does_the_same_again():
    runs = []
    for _ in range(2):
        body = MujocoBody()
        body.see(WORLD)
        body.switch_faults([BodyFault(kind="slow", amount=3.0), BodyFault(kind="noisy")])
        at = times(await performed(body, Pointing(id="p", target="near-right", mode="RIGHT_HAND")))
        runs.append([seconds - at["start"] for seconds in at.values()])

    assert runs[0] == pytest.approx(runs[1], abs=1e-9)


async def test_where_nothing_moves_nothing_is_computed():
    body, steps = MujocoBody(), []
    body.see(WORLD)
    await asyncio.sleep(5.0)
    body.pulse.on_step = steps.append
    await asyncio.sleep(3600.0)
    assert steps == []
    stage = Stage(body, Gaze(id="g", target="human"), "end")
    await stage.over()
    assert steps


async def test_an_arm_that_is_near_already_comes_early():
    """Fig. 4.7: closer than the body believes. It is measured where it is, and nobody waits for the plan."""
    took = []
    for faults in ((), NEAR_ALREADY):
        body = MujocoBody()
        body.see(WORLD)
        behavior = Pointing(id="p", target="near-right", mode="RIGHT_HAND")
        body.switch_faults(faults)
        await asyncio.sleep(2.0)
        estimate = body.estimate(behavior, None, WORLD)
        at = times(await performed(body, behavior))
        took.append(at["stroke"] - at["start"] - sum(phase.natural for phase in estimate.phases[:3]))

    assert took[0] == pytest.approx(0.0, abs=0.05)
    assert took[1] < -0.05


async def test_deviations_of_the_simulated_torso_that_physics_does_not_know_are_refused():
    with pytest.raises(InputRefused, match="this body cannot play 'overheated'"):
        MujocoBody(deviations=Variability(overheated=("head",)))


def test_a_description_that_is_wrong_says_where(tmp_path: Path):
    file = tmp_path / "robot.toml"
    for text, said in (
        ('name = "r"\nmodel = "none.xml"', "no model"),
        ('name = "r"\nmodel = "no-such-package:a.urdf"', "no package"),
        ('name = "r"\nmodel = "a.xml"\nlegs = 2', "legs"),
        (
            'name = "r"\nmodel = "a.xml"\n[torso]\njoints = ["a"]\n[head]\njoints = ["a"]\neyes = {body = "b"}',
            "two parts",
        ),
    ):
        file.write_text(text, encoding="utf-8")
        with pytest.raises(InputRefused, match=said):
            read(file)
