# ruff: noqa: E402
"""Encoders that are wrong: people see where the physics has eyes and hands, and measuring that corrects the body."""

import asyncio
import math
from functools import partial
from pathlib import Path

import pytest

mujoco = pytest.importorskip("mujoco", reason="needs the extra `mujoco`")

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Pointing
from engage_hri.schemas.body import RobotSeen, RobotState
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import InputRefused
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.calibrating import Fit, SimulatedEyes, fit, marks, measured
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.mujoco.body import MujocoBody
from engage_hri.services.control.testing import WORLD, Stage
from tests.control.directing import robot

ICUB = Path(__file__).parent / "robots" / "icub.toml"
POINT = Pointing(id="p", target="near-right", mode="RIGHT_HAND")
SITES = {"gaze": "eyes", "left_arm": "left_hand", "right_arm": "right_hand"}


@pytest.mark.parametrize(
    "fault", [BodyFault(kind="miscalibrated", amount=6.0), BodyFault(kind="noisy", part="right_arm", amount=2.0)]
)
async def test_people_see_eyes_and_hands_where_the_physics_has_them(fault: BodyFault):
    body = MujocoBody()
    body.see(WORLD)
    assert body.seen() is None
    body.switch_faults([fault])
    stage = Stage(body, POINT, "stroke")
    await asyncio.sleep(2.0)
    seen, believed, data = body.seen(), body.state(), mujoco.MjData(body.bench.model)
    data.qpos[:] = body.bench.physics.data.qpos
    mujoco.mj_kinematics(body.bench.model, data)
    assert seen is not None
    for name, site in SITES.items():
        ray = getattr(seen, name)
        place = ray.origin if name == "gaze" else ray.tip
        assert place == pytest.approx(data.site(site).xpos, abs=1e-9)
    assert seen.gaze.axis == pytest.approx(data.site("eyes").xmat.reshape(3, 3)[:, 0], abs=1e-9)
    assert believed.right_arm is not None
    assert math.dist(seen.right_arm.axis, believed.right_arm.axis) > math.radians(0.1)
    body.switch_faults([])
    await asyncio.sleep(1.0)

    assert body.seen() is None
    stage.authority.revoke()
    await stage.over()


async def test_the_bus_tells_what_people_see(hub: MemoryHub):
    body = MujocoBody()
    body.switch_faults([BodyFault(kind="miscalibrated", part="right_elbow", amount=8.0)])
    async with robot(hub, body=body) as client:
        with client.bus.subscribe(keys.ROBOT_SEEN) as inbox:
            client.perform(POINT, "stroke")
            await asyncio.sleep(3.0)
            received = None
            while len(inbox):
                received = await inbox.next()
        state = client.of(RobotState)[-1]

    assert received is not None
    assert isinstance(received.message, RobotSeen)
    assert received.message.right_arm is not None
    assert isinstance(state, RobotState)
    assert state.right_arm is not None
    assert math.dist(received.message.right_arm.axis, state.right_arm.axis) == pytest.approx(math.radians(8), rel=0.1)


async def fitted(body: Body, rows: tuple[float, ...], part: str, *, seed: int = 0) -> Fit:
    found = await measured(body, marks(rows, ()), [part], SimulatedEyes(body, 0.002, seed), lambda told: None)
    joints = [limit.joint for limit in body.capabilities.joints if limit.part == part]
    return fit(part, found, partial(body.ray_at, part), joints)


async def test_what_is_measured_corrects_the_encoders():
    body = MujocoBody()
    body.switch_faults([BodyFault(kind="miscalibrated", part="right_shoulder_yaw", amount=6.0)])
    found = await fitted(body, (0.45,), "right_arm")
    assert found.before[0] > 4.0
    assert found.offsets["right_shoulder_yaw"] == pytest.approx(6.0, abs=0.5)
    body.calibrate({joint: math.radians(offset) for joint, offset in found.offsets.items()})
    again = await fitted(body, (0.6,), "right_arm", seed=1)

    assert again.before[0] < 0.8
    body.switch_faults([])
    assert (await fitted(body, (0.6,), "right_arm")).before[0] > 4.0
    body.calibrate({})
    assert body.seen() is None
    with pytest.raises(InputRefused, match="no joint tail"):
        body.calibrate({"tail": 0.1})


async def test_a_described_robot_is_seen_and_corrected_as_well():
    pytest.importorskip("icub_models", reason="needs the package icub-models, which has the model")
    from engage_hri.services.control.mujoco.described import DescribedBody

    body = DescribedBody(ICUB)
    assert body.seen() is None
    body.switch_faults([BodyFault(kind="miscalibrated", part="l_elbow", amount=6.0)])
    seen, believed = body.seen(), body.state()
    assert seen is not None
    assert seen.left_arm is not None
    assert believed.left_arm is not None
    turned = sum(a * b for a, b in zip(seen.left_arm.axis, believed.left_arm.axis, strict=True))
    assert math.degrees(math.acos(turned)) == pytest.approx(6.0, abs=0.1)
    found = await fitted(body, (0.4,), "left_arm")
    assert found.before[0] > 4.0
    body.calibrate({joint: math.radians(offset) for joint, offset in found.offsets.items()})
    again = await fitted(body, (0.4,), "left_arm", seed=1)

    assert again.before[0] < 0.8
