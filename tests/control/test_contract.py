"""Every body we ship, held to the contract: healthy, by noisy encoders, with parts missing, and with each fault."""

import math
from collections.abc import Callable, Mapping
from functools import partial

from msgspec.structs import replace

from engage_hri.services.control.bases.composed import Member, composed
from engage_hri.services.control.config import Displaced, Slow, Stall, Variability
from engage_hri.services.control.contract.body import Body, BodyState
from engage_hri.services.control.testing import BodyContract, played
from engage_hri.services.control.torso.body import SimulatedBody
from tests.control.liars_by_deed import Noisy
from tests.random_cases import trials

FAULTS = {
    "a slow neck": Variability(slow=(Slow(part="head", factor=3.0),)),
    "a slow arm": Variability(slow=(Slow(part="left_arm", factor=2.0),)),
    "a neck that stalls": Variability(stall=(Stall(part="head", before="stroke"),)),
    "a neck that stalls for a while": Variability(stall=(Stall(part="head", before="stroke", seconds=2.0),)),
    "arms that stall": Variability(
        stall=(Stall(part="left_arm", before="ready"), Stall(part="right_arm", before="stroke"))
    ),
    "a trunk that stalls": Variability(stall=(Stall(part="torso", before="end"),)),
    "a neck elsewhere than it believes": Variability(displaced=(Displaced(joint="neck_yaw", angle=25.0),)),
    "overheated motors": Variability(overheated=("head", "left_arm", "face")),
    "a mute voice that knows it": Variability(mute="refuse"),
    "a mute voice": Variability(mute="silent"),
    "times that scatter": Variability(noise=0.3),
}


class TestSimulatedBody(BodyContract):
    def make(self) -> Body:
        return SimulatedBody()

    def faults(self) -> Mapping[str, Callable[[], Body]]:
        configured = {name: partial(SimulatedBody, deviations=each) for name, each in FAULTS.items()}
        return {**configured, **played(self.make)}


class TestNoisyEncoders(BodyContract):
    seeds = trials()
    noise = math.radians(0.3)

    def make(self) -> Body:
        return Noisy()


class Partial(SimulatedBody):
    """A torso that lacks parts."""

    parts: tuple[str, ...] = ()
    types: tuple[str, ...] = ()

    def __init__(self) -> None:
        super().__init__()
        joints = tuple(each for each in self.capabilities.joints if each.part in self.parts)
        reach = self.capabilities.reach if "pointing" in self.types else 0.0
        self.capabilities = replace(
            self.capabilities, types=self.types, parts=self.parts, joints=joints, reach=reach
        )  # fmt: skip

    def state(self) -> BodyState:
        state, has_arms = super().state(), "right_arm" in self.parts
        return replace(
            state, gaze=state.gaze if "head" in self.parts else None,
            left_arm=state.left_arm if has_arms else None, right_arm=state.right_arm if has_arms else None,
        )  # fmt: skip


class Voice(Partial):
    parts, types = ("voice",), ("speech", "wait")


class Arms(Partial):
    parts, types = ("left_arm", "right_arm"), ("pointing", "gesture")


class TestVoice(BodyContract):
    seeds = trials()

    def make(self) -> Body:
        return Voice()


class TestArms(BodyContract):
    seeds = trials()

    def make(self) -> Body:
        return Arms()


class TestHeadAlone(BodyContract):
    seeds = trials()

    def make(self) -> Body:
        return composed([Member("head", SimulatedBody(), ("head", "face"))])
