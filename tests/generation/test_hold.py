"""Inhibition with mode `hold`, on a whole robot: the head is still from the instant of the lease."""

import asyncio
import math

import numpy as np
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gaze
from engage_hri.schemas.fragments import Inhibit
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.torso.body import SimulatedBody
from tests.commanding import command
from tests.generation.robots import robot, says

STEP = 0.002
"""Seconds between two looks at the joints."""


@pytest.mark.parametrize("since", [0.1, 0.2, 0.3, 1.0])
async def test_the_head_stops_and_never_turns_back_towards_home(hub: MemoryHub, since: float) -> None:
    loop, body = asyncio.get_running_loop(), SimulatedBody()
    async with robot(hub, body=body) as stage:
        stage.send(says("a", "beginning", "one two three four five six seven eight", Gaze(id="g", target="left")))
        await stage.until("a:g:start")
        await asyncio.sleep(since)
        head = body.moves.tracks["head"]
        there = np.array(head.motion.at(math.inf).q)
        ahead = there - np.array(head.at(loop.time()).q)
        command(stage.bus, keys.INHIBIT, Inhibit(id="l", requester="t", part="gaze", mode="hold", ttl=60.0))
        velocities = []
        for _ in range(int(4.0 / STEP)):
            await asyncio.sleep(STEP)
            velocities.append(np.array(head.at(loop.time()).v))

    speeds = np.linalg.norm(velocities, axis=1)
    assert (np.array(velocities) @ ahead >= -1e-9).all()
    assert (speeds[round(0.2 / STEP) : round(0.5 / STEP)] < 1e-9).all()
    assert np.allclose(head.at(loop.time()).q, there, atol=1e-6)


async def test_a_head_on_its_target_does_not_move_at_all(hub: MemoryHub) -> None:
    loop, body = asyncio.get_running_loop(), SimulatedBody()
    async with robot(hub, body=body) as stage:
        stage.send(says("a", "beginning", "one two three four five six seven eight", Gaze(id="g", target="left")))
        await stage.until("a:g:start")
        await asyncio.sleep(1.0)
        stood = body.moves.tracks["head"].at(loop.time()).q
        command(stage.bus, keys.INHIBIT, Inhibit(id="l", requester="t", part="gaze", mode="hold", ttl=60.0))
        moved = []
        for _ in range(int(6.0 / STEP)):
            await asyncio.sleep(STEP)
            moved.append(float(np.abs(body.moves.tracks["head"].at(loop.time()).q - stood).max()))

    assert max(moved) < 1e-6
