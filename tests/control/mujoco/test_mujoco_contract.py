"""The torso with physics, held to the contract of bodies: healthy, and with noisy encoders."""

import pytest

pytest.importorskip("mujoco", reason="needs the extra `mujoco`")

from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.mujoco.body import MujocoBody
from engage_hri.services.control.testing import BodyContract
from tests.random_cases import trials

STATED = 0.05
"""Seconds by which a healthy body may come later than it predicts, at any sync point."""


class TestMujocoBody(BodyContract):
    seeds = trials()
    tolerance = STATED

    def make(self) -> Body:
        return MujocoBody()
