"""A body and a client as somebody else might bring them, good and bad."""

import asyncio
from collections.abc import AsyncGenerator

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Speech
from engage_hri.schemas.blocks import Block
from engage_hri.services.bus.interface import Hub
from engage_hri.services.client.robot import connect
from engage_hri.services.control.contract.body import MovementAuthority, Progress, Reached
from engage_hri.services.control.torso.body import SimulatedBody


class CarelessBody(SimulatedBody):
    """Forgets, now and then, that a list may be empty."""

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        now = asyncio.get_running_loop().time()
        yield Reached("start", now, now)
        raise IndexError("list index out of range")


async def good_client(hub: Hub) -> None:
    async with connect(hub=hub, name="guest") as robot:
        block = Block(id="mine", behaviors=(Gaze(id="g", target="human"), Speech(id="s", text="Hello there")))
        await robot.realize(block, timeout=60.0)


async def deaf_client(hub: Hub) -> None:
    await asyncio.get_running_loop().create_future()


async def broken_client(hub: Hub) -> None:
    raise KeyError("mine")
