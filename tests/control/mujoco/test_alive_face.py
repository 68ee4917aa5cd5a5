"""The face of the torso with physics is a screen: it blinks and stirs there, and its motors know nothing of it."""

import asyncio

import pytest

pytest.importorskip("mujoco", reason="needs the extra `mujoco`")

from engage_hri.services.control.bases.drivers import made
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.mujoco.body import MujocoBody


def body(*, alive: bool) -> MujocoBody:
    found = made(ControlConfig(body="mujoco", alive=alive))
    assert isinstance(found, MujocoBody)
    return found


async def test_it_blinks_as_often_as_people_do_and_no_motor_moves_for_it() -> None:
    living, still = body(alive=True), body(alive=False)
    shut, was, blinks = [], 0.0, 0
    for _ in range(6000):
        await asyncio.sleep(0.01)
        added = living.idle().added
        assert not added.keys() & living.bench.measured.keys()
        shut.append(added.get("left_lid", 0.0))
        blinks += was < 0.5 <= shut[-1]
        was = shut[-1]

    assert 8 <= blinks <= 30
    assert max(shut) == pytest.approx(1.0, abs=0.02)
    angles = [[each.angle for each in each_body.state().pose.joints] for each_body in (living, still)]
    assert angles[0] == pytest.approx(angles[1], abs=1e-12)
    assert not still.idle().added


async def test_a_film_shows_the_blink() -> None:
    living = body(alive=True)
    lids = []
    for _ in range(1500):
        await asyncio.sleep(0.01)
        lids.append(living.frame().pose["left_lid"])

    assert max(lids) == pytest.approx(1.0, abs=0.05)
    assert min(lids) == pytest.approx(0.0, abs=1e-9)
