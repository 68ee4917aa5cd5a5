"""Estimates of postures alone against full ones: the same but for the phases, whatever the body does meanwhile."""

import asyncio
import random
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    BlockBehavior,
    FaceLexeme,
    Gaze,
    GazeShift,
    Gesture,
    Head,
    Pointing,
    PostureShift,
    Speech,
    Wait,
)
from engage_hri.schemas.body import BodyPose, Estimate, EstimateItem, JointAngle, PlannedTime
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.config import Displaced, Variability
from engage_hri.services.control.contract.body import MovementAuthority
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.runtime.steps import finished
from tests.random_cases import share_of

ROUNDING = 1e-9
"""Degrees by which an estimate of a posture may differ from a full one. Seen: 1e-12."""


def world(chance: random.Random) -> World:
    places = [
        (chance.uniform(0.2, 1.2), chance.uniform(-0.9, 0.9), chance.choice((0.73, 0.75, 0.9, 1.3))) for _ in range(6)
    ]
    return World(
        entities=tuple(
            Entity(id=f"e{number}", kind="object", position=place, radius=0.03) for number, place in enumerate(places)
        )
    )


def pose(chance: random.Random) -> BodyPose:
    """Any angles that the joints have, of some of the joints."""
    limits = [limit for limit in kinematics.JOINTS if limit.part != "face" and chance.random() < 0.9]
    if chance.random() < 0.7:
        limits = [limit for limit in limits if limit.part != "torso"]
    return BodyPose(joints=tuple(JointAngle(each.joint, chance.uniform(each.low, each.high)) for each in limits))


def questions(chance: random.Random, poses: Sequence[BodyPose | None]) -> list[EstimateItem]:
    asked = []
    for number in range(6):
        hand = chance.choice((None, "LEFT_HAND", "RIGHT_HAND", "BOTH_HANDS"))
        behaviors: list[BlockBehavior] = [Gaze(id=f"g{number}", target=f"e{number}")]
        behaviors.append(Pointing(id=f"p{number}", target=f"e{number}", mode=hand))
        asked += [EstimateItem(behavior=each, pose=chance.choice(poses), only="posture") for each in behaviors]
    return asked


def assert_same(brief: Sequence[Estimate], full: Sequence[Estimate]) -> None:
    for one, other in zip(brief, full, strict=True):
        assert one.head_degrees == pytest.approx(other.head_degrees, abs=ROUNDING)
        assert one.arm_degrees == pytest.approx(other.arm_degrees, abs=ROUNDING)
        rest = {"phases": (), "head_degrees": 0.0, "arm_degrees": 0.0}
        assert replace(one, **rest) == replace(other, **rest)


def in_full(body: SimulatedBody, items: Sequence[EstimateItem], seen: World) -> list[Estimate]:
    return [body.estimate(item.behavior, item.pose, seen) for item in items]


@asynccontextmanager
async def performing(body: SimulatedBody, *behaviors: BlockBehavior) -> AsyncIterator[None]:
    async def perform(behavior: BlockBehavior) -> None:
        async for _ in body.perform(behavior, MovementAuthority(behavior, "end")):
            pass

    tasks = [asyncio.create_task(perform(each), name=each.id) for each in behaviors]
    await asyncio.sleep(0)
    yield
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


@pytest.mark.parametrize("seed", range(share_of(6)))
async def test_at_rest_from_any_pose_they_are_the_same(seed: int) -> None:
    chance = random.Random(seed)
    for _ in range(share_of(8, 2)):
        seen, body = world(chance), SimulatedBody()
        poses: list[BodyPose | None] = [None, *(pose(chance) for _ in range(4))]
        for _ in range(3):
            items = questions(chance, poses)
            brief = body.rehearse(items, seen)
            assert_same(brief, in_full(body, items, seen))
            assert not any(each.phases for each in brief)
            poses += [pose for each in brief for pose in (each.pose_after, each.pose_end) if pose is not None]


@pytest.mark.parametrize("seed", range(share_of(3)))
@pytest.mark.parametrize(
    "moving",
    [
        (Gaze(id="m", target="e0"),),
        (GazeShift(id="m", target="e1"),),
        (Pointing(id="m", target="e2"),),
        (PostureShift(id="m", stance="SITTING"), Gaze(id="n", target="e3")),
        (Head(id="m", lexeme="NOD"), GazeShift(id="n", target="e4")),
    ],
    ids=["gaze", "shift", "point", "posture and gaze", "nod and shift"],
)
async def test_while_the_body_moves_they_are_the_same(seed: int, moving: tuple[BlockBehavior, ...]) -> None:
    chance = random.Random(seed)
    seen, body = world(chance), SimulatedBody()
    body.see(seen)
    able = [each for each in moving if body.estimate(each, None, seen).feasible]
    async with performing(body, *able):
        for _ in range(12):
            await asyncio.sleep(chance.choice((0.02, 0.07, 0.13)))
            items = questions(chance, [None, None, pose(chance)])
            assert_same(body.rehearse(items, seen), in_full(body, items, seen))


@pytest.mark.parametrize("joint", ["neck_yaw", "left_shoulder_pitch", "right_elbow", "torso_lean"])
async def test_where_the_body_is_mistaken_of_a_joint_they_are_the_same(joint: str) -> None:
    chance = random.Random(joint)
    body, seen = SimulatedBody((), Variability(displaced=(Displaced(joint=joint, angle=12.0),))), world(chance)

    for _ in range(10):
        items = questions(chance, [None, pose(chance)])
        assert_same(body.rehearse(items, seen), in_full(body, items, seen))


async def test_of_other_behaviors_all_is_told() -> None:
    seen, body = world(random.Random(1)), SimulatedBody()
    behaviors: list[BlockBehavior] = [
        Speech(id="s", text="well well"), Wait(id="w", duration=1.0), GazeShift(id="gs", target="e0"),
        Gesture(id="ge", lexeme="BEAT"), FaceLexeme(id="f", lexeme="SMILE"), Head(id="h", lexeme="NOD"),
        Gaze(id="nothing", target="nobody"),
    ]  # fmt: skip
    items = [EstimateItem(behavior=each, only="posture") for each in behaviors]

    assert list(body.rehearse(items, seen)) == in_full(body, items, seen)


async def test_where_only_degrees_are_asked_neither_poses_nor_rays_are_told() -> None:
    chance = random.Random(9)
    seen, body = world(chance), SimulatedBody()
    items = questions(chance, [None])
    bare = {"ray": None, "pose_after": None, "pose_end": None}

    told = body.rehearse([replace(item, only="degrees") for item in items], seen)

    for one, other in zip(told, body.rehearse(items, seen), strict=True):
        assert one == (replace(other, **bare) if not other.phases else other)
    assert sum(each.ray is None for each in told) > 6


async def test_all_is_answered_as_of_the_instant_of_the_question() -> None:
    chance = random.Random(6)
    seen, body = world(chance), SimulatedBody()
    body.see(seen)
    items = [*questions(chance, [None]), *(replace(each, only="") for each in questions(chance, [None]))]
    at_rest = body.rehearse(items, seen)

    steps = body.rehearse_in_steps(items, seen)
    next(steps)
    async with performing(body, GazeShift(id="away", target="e0"), Pointing(id="show", target="e0")):
        await asyncio.sleep(0.2)
        assert not body.state().moving or body.rehearse(items, seen) != at_rest
        rest = finished(steps)

    assert list(rest) == list(at_rest)


async def test_what_a_subclass_says_counts() -> None:
    class Lame(SimulatedBody):
        def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
            return replace(super().estimate(behavior, pose, world), feasible=not isinstance(behavior, Pointing))

    class Counting(SimulatedBody):
        asked = 0

        def rehearse(
            self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem] = ()
        ) -> Sequence[Estimate]:
            self.asked += 1
            return super().rehearse(items, world, others)

    chance = random.Random(7)
    seen, items, counting = world(chance), questions(chance, [None]), Counting()

    for told in (Lame().rehearse(items, seen), finished(Lame().rehearse_in_steps(items, seen))):
        assert not any(each.feasible for each in told if each.behavior.startswith("p"))
    assert finished(counting.rehearse_in_steps(items, seen)) == SimulatedBody().rehearse(items, seen)
    assert counting.asked == 1


async def test_beside_a_plan_single_motions_are_estimated_too() -> None:
    chance = random.Random(8)
    seen, body = world(chance), SimulatedBody()
    single = questions(chance, [None])
    look = Gaze(id="look", target="e0")
    planned = EstimateItem(behavior=look, times=(PlannedTime(sync="start", at=0.5),))

    told = body.rehearse([single[0], planned, *single[1:]], seen)

    assert_same([told[0], *told[2:]], in_full(body, single, seen))
    assert told[1] == body.rehearse([planned], seen)[0]
