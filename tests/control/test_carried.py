"""What a trunk carries is of the driver of that trunk: composed in another way, points would be untrue."""

import asyncio
import math
from itertools import product

import pytest

from engage_hri.schemas.behaviors import Gaze, Pointing, PostureShift
from engage_hri.schemas.faults import InputRefused
from engage_hri.services.control.bases.composed import Member, composed
from engage_hri.services.control.bases.driver_guard import GuardedBody
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.testing import WORLD, Stage, performed
from engage_hri.services.control.torso.body import SimulatedBody
from tests.control.test_composed import of

ON_THE_TRUNK = ("head", "left_arm", "right_arm")
OWNERS = list(product(("A", "B", ""), repeat=3))
"""Whose each of these parts is; empty: nobody's."""


def owned(trunk: str, owners: tuple[str, ...]) -> list[Member]:
    """Two drivers of whole torsos with these parts; what is left of the second is its voice."""
    parts = {"torso": trunk, **dict(zip(ON_THE_TRUNK, owners, strict=True))}
    return [
        of(*(part for part in parts if parts[part] == name), "voice" if name == "B" else "face", name=name)
        for name in "AB"
    ]


@pytest.mark.parametrize("owners", OWNERS, ids=["".join(each or "-" for each in owners) for owners in OWNERS])
async def test_what_the_trunk_carries_is_of_its_driver_or_refused_and_then_each_point_is_true(
    owners: tuple[str, ...],
):
    """Of every way to share a trunk and what stands on it. The joints of the whole say where eyes and hands are."""
    composed(owned("", owners))
    if "B" in owners:
        with pytest.raises(InputRefused, match=r"_?\w+ of B stands on torso of A.*or leave torso out"):
            composed(owned("A", owners))
        return
    body = composed(owned("A", owners))
    body.see(WORLD)
    await performed(body, PostureShift(id="lean", lexeme="LEAN_FORWARD"))
    for part, owner in zip(ON_THE_TRUNK, owners, strict=True):
        target, hand = "far-left" if part == "left_arm" else "near-right", f"{part[:-4].upper()}_HAND"
        look = Gaze(id="g", target=target) if part == "head" else Pointing(id="p", target=target, mode=hand)  # type: ignore[arg-type]
        if not owner:
            assert not body.estimate(look, None, WORLD).feasible
            continue
        stage = Stage(body, look, "stroke")
        await asyncio.sleep(3.0)
        assert "stroke" in stage.passed
        told = {**kinematics.HOME, **{each.joint: each.angle for each in body.state().pose.joints}}
        entity = WORLD.entity(target)
        assert entity is not None
        ray = kinematics.gaze(told) if part == "head" else kinematics.arm(told, part[:-4])  # type: ignore[arg-type]
        way = [there - here for there, here in zip(entity.position, ray.origin, strict=True)]
        assert sum(a * b for a, b in zip(way, ray.axis, strict=True)) / math.hypot(*way) > math.cos(math.radians(0.1))
        stage.authority.revoke()
        await stage.over()


async def test_what_a_guarded_driver_carries_counts_as_well():
    guarded = GuardedBody("mine", SimulatedBody())
    with pytest.raises(InputRefused, match="head of other stands on torso of mine"):
        composed([Member("mine", guarded, ("torso",)), of("head", name="other")])


async def test_a_driver_of_a_trunk_that_says_so_carries_the_head_of_one_that_says_nothing():
    class Trunk(SimulatedBody):
        carries = {"torso": ("head",)}  # noqa: RUF012

    class Head(SimulatedBody):
        carries = {}  # noqa: RUF012

    members = [Member("trunk", Trunk(), ("torso",)), Member("eyes", Head(), ("head",))]
    with pytest.raises(InputRefused, match="head of eyes stands on torso of trunk"):
        composed(members)
    assert composed([Member("trunk", Trunk(), ("torso",)), Member("arm", Head(), ("left_arm",))])
