"""The base class of the ordinary robot with encoders that scatter, and a driver that gives the same angles twice."""

import asyncio
from random import Random

import pytest

from engage_hri.schemas.behaviors import Gaze, GazeShift
from engage_hri.schemas.world import World
from engage_hri.services.control.body import Body, Reached
from engage_hri.services.control.testing import WORLD, BodyContract, Stage
from tests.control.test_docs import driver

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
    tolerance, noise, accuracy = 0.15, SCATTER, 2 * SCATTER + 4 * SCATTER

    def make(self) -> Body:
        return Scattering()


class TestTable(BodyContract):
    tolerance = 0.15

    def make(self) -> Body:
        return Table()


@pytest.mark.parametrize("seed", range(20))
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
