"""The base class of the ordinary robot with encoders that scatter, and a driver that gives the same angles twice."""

import asyncio
import math
from random import Random

import pytest

from engage_hri.schemas.behaviors import Gaze, GazeShift
from engage_hri.schemas.units import Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.deadlines import LATE
from engage_hri.services.control.contract.body import Body, BodyFailed, MovementAuthority, Reached, TakenOver
from engage_hri.services.control.testing import WORLD, BodyContract, Stage
from tests.control.test_docs import driver
from tests.random_cases import share_of, trials
from tests.standing_still import stand_still

SCATTER = 0.0052
"""Radians: 0.3 degrees, a standard deviation."""


class Scattering(driver().PanTilt):  # type: ignore[misc]
    """Its encoders scatter. The motors are the ones of the page."""

    near = 4 * SCATTER

    def __init__(self) -> None:
        super().__init__()
        self.chance = Random(1)

    def angles(self) -> dict[str, float]:
        return {joint: angle + self.chance.gauss(0.0, SCATTER) for joint, angle in super().angles().items()}


class Table(driver().PanTilt):  # type: ignore[misc]
    """It has its angles in a table, and gives the very same ones for the same target in the same place."""

    def aim(self, behavior: object, world: World) -> dict[str, float]:
        known: dict[object, dict[str, float]] = self.__dict__.setdefault("known", {})
        target = world.entity(getattr(behavior, "target", ""))
        return known.setdefault(target, super().aim(behavior, world))


class TestScattering(BodyContract):
    seeds = trials()
    tolerance, noise, accuracy = 0.15, SCATTER, 2 * SCATTER + 4 * SCATTER

    def make(self) -> Body:
        return Scattering()


class TestTable(BodyContract):
    seeds = trials()
    tolerance = 0.15

    def make(self) -> Body:
        return Table()


@pytest.mark.parametrize("seed", range(share_of(20)))
async def test_the_end_of_a_look_is_told_when_the_head_is_back(seed: int) -> None:
    body = Scattering()
    body.chance = Random(seed)
    async with body.connected():
        body.see(WORLD)
        stage = Stage(body, Gaze(id="g", target="far-left"), "end")
        await stage.over()
        now = asyncio.get_running_loop().time()
        (end,) = [each for each in stage.progress if isinstance(each, Reached) and each.sync == "end"]

    assert now - end.at < 0.05


async def test_a_shift_that_is_broken_off_is_not_told_to_its_end_since_another_went_to_the_same_place() -> None:
    body = Table()
    async with body.connected():
        body.see(WORLD)
        first = Stage(body, GazeShift(id="a", target="far-left"), "end")
        await asyncio.sleep(0.05)
        second = Stage(body, GazeShift(id="b", target="far-left"), "end")
        await asyncio.gather(first.over(), second.over())

    assert (first.passed, second.passed) == (["start"], ["start", "end"])


class Sagging(driver().PanTilt):  # type: ignore[misc]
    """While `sags` its tilt hangs down; with `is_dead` its motors take no command."""

    sags, is_dead = 0.0, False

    def angles(self) -> dict[str, float]:
        measured = dict(super().angles())
        return {**measured, "tilt": measured["tilt"] - self.sags}

    def go(self, goal: dict[str, float], seconds: float) -> None:
        if not self.is_dead:
            self.sags = 0.0
            super().go(goal, seconds)


def beside(body: Body, target: Vector) -> float:
    """Degrees between the axis of the eyes, as the joints have it, and the way to a place."""
    angles = {it.joint: it.angle for it in body.state().pose.joints}
    pan, tilt = angles["pan"], angles["tilt"]
    axis = math.cos(tilt) * math.cos(pan), math.cos(tilt) * math.sin(pan), math.sin(tilt)
    way = [there - here for there, here in zip(target, type(body).eyes, strict=True)]  # type: ignore[attr-defined]
    share = sum(one * other for one, other in zip(axis, way, strict=True)) / math.hypot(*way)
    return math.degrees(math.acos(min(1.0, share)))


def walked(y: float) -> World:
    """The world with a person who has walked aside."""
    return World(entities=(Entity(id="human", kind="person", position=(1.3, y, 1.2)),))


async def test_what_has_given_way_at_a_hold_goes_back_before_the_next_point() -> None:
    body, target = Sagging(), WORLD.entity("near-right")
    assert target is not None
    async with body.connected():
        body.see(WORLD)
        stage = Stage(body, Gaze(id="g", target="near-right"), "start")
        for number, sync in enumerate(("stroke", "relax"), 1):
            await stage.holding(number)
            body.sags = 0.5
            assert beside(body, target.position) > 20.0
            stage.authority.extend(sync)
            await stage.until(lambda sync=sync: sync in stage.passed)  # type: ignore[misc]
            assert beside(body, target.position) < 1.0
        stage.authority.extend("end")
        await stage.over()


async def test_a_dead_motor_is_told_by_home_and_a_later_behavior_ends_it() -> None:
    body = Sagging()
    async with body.connected():
        body.see(WORLD)
        await Stage(body, GazeShift(id="g", target="far-left"), "end").over()
        body.is_dead = True
        with pytest.raises(BodyFailed, match=r"short of its goal .* to go to its home"):
            await body.home()
        body.is_dead = False
        home = asyncio.create_task(body.home())
        await asyncio.sleep(0.1)
        look = Stage(body, Gaze(id="l", target="near-right"), "end")
        with pytest.raises(TakenOver, match="another behavior has taken head on the way home"):
            await home
        await look.over()


@pytest.mark.parametrize("behavior", [Gaze(id="g", target="human"), GazeShift(id="s", target="human")])
@pytest.mark.parametrize("speed", [0.2, 0.8])
async def test_the_eyes_follow_who_walks_and_say_so_only_while_they_are_there(behavior: Gaze, speed: float) -> None:
    """Whoever walks at 0.8 m/s 1.3 m away is 35 degrees further each second; it looks 20 times a second."""
    body = driver().PanTilt()
    async with body.connected():
        body.see(walked(0.0))
        stage = Stage(body, behavior, "stroke" if isinstance(behavior, Gaze) else "end")
        await asyncio.sleep(1.5)
        offs, told = [], 0
        for step in range(120):
            y = 0.6 * math.sin(speed / 0.6 * step * 0.05)
            body.see(walked(y))
            await asyncio.sleep(0.05)
            offs.append(beside(body, (1.3, y, 1.2)))
            if body.state().looking_at == "human":
                told += 1
                assert offs[-1] <= math.degrees(body.capabilities.gaze_half_angle) + 0.1
        stage.authority.revoke()
        await stage.over()

    assert max(offs) < 10.0
    assert told > 90


class Delayed(driver().PanTilt):  # type: ignore[misc]
    """Its measurements come over a network: after a standstill the old ones stand until new ones are read."""

    unread_until = 0.0

    def angles(self) -> dict[str, float]:
        is_old = asyncio.get_running_loop().time() < self.unread_until
        return {"pan": 0.0, "tilt": 0.0} if is_old else dict(super().angles())


@pytest.mark.parametrize(("read_after", "is_stuck"), [(0.5 * LATE, False), (2.0 * LATE, True)])
async def test_motors_that_moved_while_the_process_stood_still_are_not_stuck(
    read_after: float, is_stuck: bool
) -> None:
    body = Delayed()
    async with body.connected():
        body.see(WORLD)
        body.unread_until = 10.0 + read_after
        stage = Stage(body, Gaze(id="g", target="far-left"), "end")
        await asyncio.sleep(0.1)
        asyncio.get_running_loop().call_soon(stand_still, 10.0)
        if is_stuck:
            with pytest.raises(BodyFailed, match="short of its goal"):
                await stage.over()
        else:
            await stage.over()
            assert stage.passed[-1] == "end"


async def test_a_shift_beneath_a_look_ends_at_the_instant_asked_for() -> None:
    body, loop = driver().PanTilt(), asyncio.get_running_loop()
    async with body.connected():
        body.see(WORLD)
        look = Stage(body, Gaze(id="g", target="human"), "stroke")
        await asyncio.sleep(1.5)
        shift, asked = GazeShift(id="s", target="near-right"), loop.time() + 2.0
        passed = [each async for each in body.perform(shift, MovementAuthority(shift, "end", {"end": asked}))]
        look.authority.revoke()
        await look.over()

    assert [(each.sync, each.at) for each in passed if isinstance(each, Reached)] == [
        ("start", pytest.approx(asked - 2.0)), ("end", pytest.approx(asked)),
    ]  # fmt: skip
