"""Each test of the contract runs on both buses: which one, the loop's clock says."""

import asyncio
from collections.abc import AsyncIterator

import pytest_asyncio

from engage_hri.services.runtime.virtual_time import VirtualTimeLoop
from tests.bus.places import MemoryPlace, Place, ZenohPlace


@pytest_asyncio.fixture
async def place() -> AsyncIterator[Place]:
    virtual = isinstance(asyncio.get_running_loop(), VirtualTimeLoop)
    place: Place = MemoryPlace() if virtual else ZenohPlace()
    yield place
    await place.close()
