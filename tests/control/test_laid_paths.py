"""Paths that are laid once: the same as laid anew, and never that of a body or an entity that has moved since."""

import asyncio
import math
from collections.abc import Iterator

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Pointing
from engage_hri.schemas.body import BodyPose, Estimate
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.contract.body import MovementAuthority
from engage_hri.services.control.figure import laid_paths
from engage_hri.services.control.torso.body import SimulatedBody

ASKED: list[BlockBehavior] = [Gaze(id="look", target="ball"), Pointing(id="point", target="ball", mode="RIGHT_HAND")]


def world(y: float) -> World:
    return World(entities=(Entity(id="ball", kind="object", position=(0.6, y, 0.8)),))


async def perform(body: SimulatedBody, behavior: BlockBehavior) -> None:
    async for _ in body.perform(behavior, MovementAuthority(behavior, "end")):
        pass


@pytest.fixture(autouse=True)
def none_laid() -> Iterator[None]:
    laid_paths._laid.cache_clear()
    yield
    laid_paths._laid.cache_clear()


def laid() -> int:
    return laid_paths._laid.cache_info().misses


def anew(body: SimulatedBody, behavior: BlockBehavior, pose: BodyPose | None, seen: World) -> Estimate:
    laid_paths._laid.cache_clear()
    return body.estimate(behavior, pose, seen)


@pytest.mark.parametrize("behavior", ASKED, ids=lambda each: each.id)
async def test_the_same_question_lays_no_path_again(behavior: BlockBehavior) -> None:
    body = SimulatedBody()
    first = body.estimate(behavior, None, world(-0.2))
    count = laid()

    assert first.feasible
    assert count > 0
    assert body.estimate(behavior, None, world(-0.2)) == first
    assert laid() == count


@pytest.mark.parametrize("behavior", ASKED, ids=lambda each: each.id)
async def test_an_entity_that_has_moved_is_another_question(behavior: BlockBehavior) -> None:
    body = SimulatedBody()
    before = body.estimate(behavior, None, world(-0.2))
    after = body.estimate(behavior, None, world(-0.3))

    assert after != before
    assert after == anew(body, behavior, None, world(-0.3))


@pytest.mark.parametrize("behavior", ASKED, ids=lambda each: each.id)
async def test_a_body_that_has_moved_is_another_question(behavior: BlockBehavior) -> None:
    body = SimulatedBody()
    before = body.estimate(behavior, None, world(-0.2))
    there = before.pose_after
    assert there is not None
    after = body.estimate(behavior, there, world(-0.2))

    assert sum(phase.natural for phase in after.phases) < sum(phase.natural for phase in before.phases)
    assert after == anew(body, behavior, there, world(-0.2))


@pytest.mark.parametrize("behavior", ASKED, ids=lambda each: each.id)
async def test_a_body_that_moves_is_another_question_at_each_instant(behavior: BlockBehavior) -> None:
    body = SimulatedBody()
    body.see(world(-0.2))
    moving = asyncio.create_task(perform(body, replace(behavior, id="way")))
    for _ in range(3):
        count = laid()
        await asyncio.sleep(0.1)
        seen = body.estimate(behavior, None, world(-0.2))

        assert laid() > count
        assert seen == anew(body, behavior, None, world(-0.2))
    await moving


async def test_a_body_that_has_moved_by_the_least_bit_is_another_question() -> None:
    body = SimulatedBody()
    here = body.estimate(ASKED[0], None, world(-0.2)).pose_after
    assert here is not None
    count = laid()
    nudged = BodyPose(
        joints=tuple(type(each)(joint=each.joint, angle=math.nextafter(each.angle, 9.0)) for each in here.joints)
    )
    body.estimate(ASKED[0], here, world(-0.2))
    body.estimate(ASKED[0], nudged, world(-0.2))

    assert laid() == count + 2


async def test_a_path_through_the_table_is_refused_each_time() -> None:
    body, low = SimulatedBody(), World(entities=(Entity(id="ball", kind="object", position=(0.6, 0.1, 0.2)),))
    first, count = body.estimate(ASKED[1], None, low), laid()

    assert first.fault is not None
    assert "table" in first.fault.reason
    assert body.estimate(ASKED[1], None, low) == first
    assert laid() == count
