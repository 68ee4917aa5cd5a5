"""A body and a client as somebody else might bring them, good and bad."""

import asyncio
from collections.abc import AsyncGenerator

from schemas.behaviors import BlockBehavior, Gaze, Speech
from schemas.blocks import Block
from services.bus import Hub
from services.client import connect
from services.control.body import Authority, Progress, Reached
from services.control.simulated import SimulatedBody


class CarelessBody(SimulatedBody):
    """Forgets, now and then, that a list may be empty."""

    async def perform(self, behavior: BlockBehavior, authority: Authority) -> AsyncGenerator[Progress, None]:
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
