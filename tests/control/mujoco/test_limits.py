"""No joint of the torso with physics is driven faster than it says, whatever comes over its motors and goes again."""

import asyncio
import math
from random import Random

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs the extra `mujoco`")

from engage_hri.schemas.body_faults import BodyFault
from engage_hri.services.control.figure.kinematics import LIMIT
from engage_hri.services.control.mujoco.body import MujocoBody
from engage_hri.services.control.mujoco.commands import Commands
from engage_hri.services.control.mujoco.faults import OURS
from engage_hri.services.control.testing import WORLD, Stage
from engage_hri.services.control.testing.truth import ARMS, LOOKS

PARTS = ("head", "torso", "left_arm", "right_arm")
SETTLED = 0.06
"""Seconds after a contact or a switched fault in which the physics, and no command, may jerk a joint."""


class Gauge:
    """Looks at the joints of the physics after each step: what they do, not what the body says of it.

    fastest, sharpest: greatest speed and acceleration of each joint, as shares of those that the body tells.
    """

    def __init__(self, body: MujocoBody) -> None:
        self._body, self._physics = body, body.bench.physics
        limits = {limit.joint: limit for limit in body.capabilities.joints}
        self._speeds = np.array([limits[joint].speed for joint in self._physics.joints])
        self._accelerations = np.array([limits[joint].acceleration for joint in self._physics.joints])
        self.fastest, self.sharpest = np.zeros(len(self._speeds)), np.zeros(len(self._speeds))
        self._last: tuple[float, np.ndarray] | None = None
        self.jerked_at = -math.inf
        body.pulse.on_step = self._look

    def _look(self, at: float) -> None:
        speeds = self._physics.speeds.copy()
        self.fastest = np.maximum(self.fastest, np.abs(speeds) / self._speeds)
        if self._physics.contacts():
            self.jerked_at = at
        if self._last is not None and self._last[0] < at and self.jerked_at + SETTLED < at:
            sharp = np.abs(speeds - self._last[1]) / (at - self._last[0]) / self._accelerations
            sick = {fault.part for fault in self._body.faults}
            whole = [sick.isdisjoint(("", LIMIT[joint].part)) for joint in self._physics.joints]
            self.sharpest = np.maximum(self.sharpest, np.where(whole, sharp, 0.0))
        self._last = at, speeds


@pytest.mark.parametrize(("part", "strength"), [("left_arm", None), ("right_arm", 0.0), ("right_elbow", 0.0)])
async def test_a_part_that_has_sagged_comes_back_within_its_limits(part: str, strength: float | None):
    body = MujocoBody()
    body.see(WORLD)
    body.switch_faults([BodyFault(kind="weak", part=part, amount=strength)])
    await asyncio.sleep(4.0)
    sagged = max(abs(body.bench.measured[joint] - body.planned()[joint]) for joint in body.bench.measured)
    assert sagged > math.radians(25.0)
    gauge = Gauge(body)
    body.switch_faults([])
    await asyncio.sleep(2.5)

    assert gauge.fastest.max() <= 1.0
    assert gauge.fastest.max() > 0.1
    assert gauge.sharpest.max() <= 1.0
    assert body.state().moving is False
    await body.home()


@pytest.mark.parametrize("seed", range(5))
async def test_no_joint_exceeds_its_limits_while_faults_come_and_go(seed: int):
    chance, body, stages = Random(seed), MujocoBody(), list[Stage]()
    body.see(WORLD)
    gauge = Gauge(body)
    for number in range(20):
        if chance.random() < 0.6:
            kinds = [chance.choice(list(OURS)) for _ in range(chance.choice((0, 0, 1, 1, 2)))]
            faults = [BodyFault(kind=kind, part=chance.choice(PARTS) if OURS[kind].on else "") for kind in kinds]
            body.switch_faults(faults)
            gauge.jerked_at = asyncio.get_running_loop().time()
        else:
            make = chance.choice(chance.choice((LOOKS, ARMS)))
            stages.append(Stage(body, make(f"{number}", chance, [each.id for each in WORLD.entities]), "end"))
        await asyncio.sleep(chance.choice((0.0, chance.uniform(0.0, 0.5), chance.uniform(0.0, 2.0))))
    body.switch_faults([])
    await asyncio.gather(*(stage.task for stage in stages), return_exceptions=True)
    await body.home()

    assert gauge.fastest.max() <= 1.0, gauge.fastest
    assert gauge.sharpest.max() <= 1.0, gauge.sharpest


@pytest.mark.parametrize("seed", range(10))
def test_a_command_comes_back_to_a_plan_that_moves_within_speed_and_acceleration(seed: int):
    """Its joint lets go, follows what it is told, and stands again, at random."""
    chance = np.random.default_rng(seed)
    speeds, accelerations, step, reach = np.array([2.0, 5.0]), np.array([20.0, 60.0]), 0.005, np.array([0.05, 0.1])
    commands, joint, last = Commands(speeds, accelerations), np.zeros(2), np.zeros(2)
    phase, swing = chance.uniform(0.0, 6.0, 2), np.minimum(0.4 * speeds, np.sqrt(0.3 * accelerations))
    lag = chance.uniform(0.5, 2.0)
    for number in range(800):
        stands = lag < number * step < lag + 1.0
        plan = swing * (np.sin(phase + number * step) - np.sin(phase))
        before = commands.at
        now, rate = commands.advance(plan, step, joint, np.zeros(2), reach)
        assert (np.abs(now - joint) <= reach + 1e-9).all() or not stands
        assert (np.abs(rate) <= speeds + 1e-9).all()
        if not stands and (now == before).all() and number > 1:
            assert (np.abs(rate - last) <= accelerations * step * 1.001 + 1e-9).all(), number
        last = rate
        joint = joint if stands else now + rate * step

    assert commands.at == pytest.approx(plan, abs=1e-9)


async def test_encoders_are_good_again_when_their_noise_is_switched_off():
    body = MujocoBody()
    body.switch_faults([BodyFault(kind="noisy", amount=5.0)])
    await asyncio.sleep(0.5)
    body.switch_faults([])

    physics = body.bench.physics
    assert (physics.measured == physics.angles).all()
