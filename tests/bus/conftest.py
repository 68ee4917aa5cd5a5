"""Each test of the contract runs on both buses, on Zenoh in three ways: which one, the loop says."""

import asyncio
from collections.abc import AsyncIterator

import pytest_asyncio

from engage_hri.services.runtime.virtual_time import VirtualTimeLoop
from tests.bus.places import GroupLoop, GroupPlace, MemoryPlace, Place, SharedLoop, SharedPlace, ZenohPlace

PLACES = {VirtualTimeLoop: MemoryPlace, SharedLoop: SharedPlace, GroupLoop: GroupPlace}


@pytest_asyncio.fixture
async def place() -> AsyncIterator[Place]:
    loop = asyncio.get_running_loop()
    place: Place = next((its() for kind, its in PLACES.items() if isinstance(loop, kind)), None) or ZenohPlace()
    yield place
    await place.close()
