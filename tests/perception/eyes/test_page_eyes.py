"""Eyes of pages: whose face it is, where it is, and what is told of who goes, stalls or switches off."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, FaceLandmarks, HeadPose
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.people.perceive import perceive
from engage_hri.services.perception.eyes.camera import SeatCamera
from engage_hri.services.perception.eyes.pages import MOST_PAGES
from tests.perception.eyes.faces import landmarks
from tests.perception.eyes.people import Pose
from tests.perception.eyes.test_eyes import Told, eyes

pytestmark = pytest.mark.usefixtures("exact_face")
RATE = 15
NEAR = (0.1, 0.05, 0.6)
"""Place of a face before a camera of its own."""


@asynccontextmanager
async def pages(hub: MemoryHub, **settings: Any) -> AsyncIterator[tuple[Told, Bus]]:
    """Eyes of pages, and the window that sends what these see."""
    async with eyes(hub, source="page", **settings) as told:
        await asyncio.sleep(1.0)
        yield told, hub.join("console", role="wizard")


async def show(
    window: Bus, person: str, seconds: float, poses: Sequence[Pose] | None = None, *, late: float = 0.05
) -> None:
    """Send what a page's camera sees of those who hold a pose; none: it looks, and sees nobody."""
    begin = window.now()
    for number in range(round(seconds * RATE)):
        at = begin + number / RATE
        await asyncio.sleep(at + late - window.now())
        seen = landmarks([Pose(NEAR)] if poses is None else poses, at, 0.3)
        window.publish(keys.landmarks(person), replace(seen, at=window.stamp(at)))


def off(window: Bus, person: str) -> None:
    window.publish(keys.landmarks(person), FaceLandmarks(at=window.stamp(), width=640, height=480, over=True))


def angle(one: Sequence[float], other: Sequence[float]) -> float:
    cosine = np.dot(one, other) / np.linalg.norm(one) / np.linalg.norm(other)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


async def test_a_face_at_a_page_is_that_of_its_person_at_the_seat(hub: MemoryHub):
    """They sit anywhere before their own camera, and look into it: that is at the robot's eyes, from the seat."""
    looks_back = Pose(NEAR, yaw=-np.degrees(np.arctan2(0.1, 0.6)), pitch=np.degrees(np.arctan2(0.05, 0.608)))
    async with pages(hub) as (told, window), perceive("ann", hub=hub, position=(1.0, 0.5, 1.1)):
        await show(window, "ann", 1.0, [looks_back])

    poses = told.of(HeadPose)
    assert {each.actor for each in poses} == {"ann"}
    assert poses[-1].position == pytest.approx((1.0, 0.5, 1.1), abs=0.05)
    assert angle(poses[-1].direction, np.subtract((0.05, 0.0, 1.17), poses[-1].position)) < 2.0
    assert told.seconds(poses[0]) == pytest.approx(told.seconds(told.of(ActorFound)[-1]) + 4 / RATE, abs=0.02)
    assert all(each.entities[0].position == (1.0, 0.5, 1.1) for each in told.of(World) if each.entities)
    assert told.of(Fault) == []


def test_what_a_camera_of_somebodys_own_sees_is_as_the_robot_would_see_it():
    """Angles and shares of distances are kept: who moves a tenth of the distance aside does so before the robot."""
    eyes, seat = np.array((0.05, 0.0, 1.17)), np.array((1.2, -0.6, 1.3))
    camera = SeatCamera(60.0, (0.05, 0.0, 1.17), (1.2, -0.6, 1.3))
    first, then = np.array([0.1, -0.2, 0.6]), np.array([0.2, -0.1, 0.7])
    assert camera.place(first) == pytest.approx(tuple(seat))
    place = camera.place(then)

    assert angle(np.subtract(place, eyes), seat - eyes) == pytest.approx(angle(then, first))
    assert np.linalg.norm(np.subtract(place, eyes)) / np.linalg.norm(seat - eyes) == pytest.approx(
        np.linalg.norm(then) / np.linalg.norm(first)
    )
    assert angle(camera.direction(-then), np.subtract(eyes, place)) == pytest.approx(0.0, abs=1e-5)
    assert angle(camera.direction(np.array([0.0, 0.0, -1.0])), eyes - seat) == pytest.approx(angle(first, (0, 0, 1)))


async def test_who_is_not_seen_for_two_seconds_has_gone_and_comes_back_as_the_same(hub: MemoryHub):
    async with pages(hub) as (told, window), perceive("ann", hub=hub):
        await show(window, "ann", 1.0)
        left = window.now() - told.begin
        await show(window, "ann", 3.0, [])
        assert [told.seconds(each) - left for each in told.of(ActorLost)] == pytest.approx([0.0], abs=0.1)
        came = window.now() - told.begin
        await show(window, "ann", 1.0)
        assert told.seconds(told.of(ActorFound)[-1]) == pytest.approx(came, abs=0.01)
    assert {each.actor for each in told.of(HeadPose)} == {"ann"}


@pytest.mark.parametrize("stall", [0.3, 1.0])
async def test_a_short_stall_is_nothing(hub: MemoryHub, stall: float):
    async with pages(hub) as (told, window), perceive("ann", hub=hub):
        await show(window, "ann", 1.0)
        await asyncio.sleep(stall)
        await show(window, "ann", 1.0)
        assert told.of(ActorLost) == told.of(Fault) == []
        assert len(told.of(ActorFound)) == 2  # of the seat, and of the face


async def test_a_page_that_tells_nothing_any_more_is_a_fault_and_no_departure(hub: MemoryHub):
    async with pages(hub) as (told, window), perceive("ann", hub=hub):
        await show(window, "ann", 1.0)
        await asyncio.sleep(2.0)
        [fault] = told.of(Fault)
        assert "no picture is looked at any more by the camera of ann" in fault.reason
        await show(window, "ann", 1.0)
        assert told.of(ActorLost) == []
        assert told.seconds(told.of(HeadPose)[-1]) > window.now() - told.begin - 0.2
        assert told.of(HeadPose)[-1].position == pytest.approx((1.2, 0.0, 1.2), abs=0.05)


async def test_a_camera_that_is_switched_off_ends_a_nod_and_nobody_leaves(hub: MemoryHub):
    def nods(at: float) -> Pose:
        return Pose(NEAR, 0, -9 * float(np.sin(2 * np.pi * 1.8 * at)))

    async with pages(hub) as (told, window), perceive("ann", hub=hub):
        await show(window, "ann", 1.0)
        begin = window.now()
        for number in range(20):
            await asyncio.sleep(begin + number / RATE - window.now())
            seen = landmarks([nods(number / RATE)], number / RATE)
            window.publish(keys.landmarks("ann"), replace(seen, at=window.stamp()))
        assert [each.action for each in told.of(ActionBegan)] == ["nod"]
        off(window, "ann")
        await asyncio.sleep(0.1)
        assert [each.action for each in told.of(ActionEnded)] == ["nod"]
        await asyncio.sleep(5.0)
        assert told.of(ActorLost) == told.of(Fault) == []


async def test_who_was_away_before_their_camera_went_off_is_at_their_seat_again(hub: MemoryHub):
    """Nobody looks any more, and the window says that they sit there; who has left the seat is not brought back."""
    async with pages(hub) as (told, window), perceive("ann", hub=hub) as ann:
        await show(window, "ann", 1.0)
        await show(window, "ann", 3.0, [])
        off(window, "ann")
        await asyncio.sleep(0.1)
        assert [type(each) for each in told.messages if isinstance(each, ActorFound | ActorLost)][-2:] == [
            ActorLost, ActorFound,
        ]  # fmt: skip
        await show(window, "ann", 1.0)
        await show(window, "ann", 3.0, [])
        await ann.leave()
        off(window, "ann")
        await asyncio.sleep(0.1)
        assert isinstance([each for each in told.messages if isinstance(each, ActorFound | ActorLost)][-1], ActorLost)


async def test_of_several_in_a_picture_it_is_the_largest_and_then_that_one(hub: MemoryHub):
    near, far, nearer = Pose((-0.1, 0.0, 0.6)), Pose((0.3, 0.0, 1.1)), Pose((0.25, 0.05, 0.45))
    async with pages(hub) as (told, window), perceive("ann", hub=hub, position=(1.2, 0.0, 1.2)):
        await show(window, "ann", 1.0, [far, near])
        await show(window, "ann", 1.0, [nearer, near])
        assert told.of(HeadPose)[-1].position == pytest.approx((1.2, 0.0, 1.2), abs=0.08)
        await show(window, "ann", 1.5, [nearer])
        until = len(told.of(HeadPose))
        await show(window, "ann", 2.0, [nearer])

    assert [type(each) for each in told.messages if isinstance(each, ActorFound | ActorLost)][2:4] == [
        ActorLost, ActorFound,
    ]  # fmt: skip
    assert told.of(HeadPose)[until].position[1] < -0.3  # of who took the place, to the robot's right


async def test_two_at_their_pages_are_two(hub: MemoryHub):
    async with (
        pages(hub) as (told, window),
        perceive("ann", hub=hub, position=(1.2, 0.0, 1.2)),
        perceive("ben", hub=hub, position=(1.2, 0.6, 1.2)),
    ):
        await asyncio.gather(show(window, "ann", 1.0), show(window, "ben", 1.0, [Pose((0.0, 0.0, 0.5))]))

    last = {each.actor: each.position for each in told.of(HeadPose)}
    assert last["ann"] == pytest.approx((1.2, 0.0, 1.2), abs=0.05)
    assert last["ben"] == pytest.approx((1.2, 0.6, 1.2), abs=0.05)


async def test_there_is_an_end_to_how_many_are_followed(hub: MemoryHub):
    async with pages(hub) as (told, window):
        for number in range(MOST_PAGES + 1):
            await show(window, f"p{number}", 0.07)
        await asyncio.sleep(0.1)

    [fault] = told.of(Fault)
    assert f"that of p{MOST_PAGES} is not" in fault.reason


async def test_what_is_old_or_from_the_future_is_nothing_or_now(hub: MemoryHub):
    async with pages(hub) as (told, window), perceive("ann", hub=hub):
        await show(window, "ann", 1.0, late=11.0)
        assert told.of(HeadPose) == []
        await show(window, "ann", 1.0, late=-0.5)
        assert all(told.seconds(each) <= window.now() - told.begin for each in told.of(HeadPose))
