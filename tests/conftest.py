"""Every async test runs on the virtual clock unless it asks for real time, and fails if it leaves a task behind.

Property tests try the same examples each time. To search for new ones: `pytest --hypothesis-profile=search`.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping

import pytest
import pytest_asyncio
from hypothesis import settings

from services.memory_bus import MemoryHub
from services.virtual_time import VirtualTimeLoop

settings.register_profile("same", derandomize=True, database=None)
settings.register_profile("search", parent=settings.get_profile("default"))
settings.load_profile("same")

LONGEST_TEST = 24 * 3600.0
"""Virtual seconds; then a test waits for something that never comes."""


def virtual_loop() -> asyncio.AbstractEventLoop:
    return VirtualTimeLoop(limit=LONGEST_TEST)


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "real_time: runs on the wall clock (real sockets and processes)")
    config.addinivalue_line("markers", "each_bus: runs twice: virtual time (memory bus) and wall clock (Zenoh)")


def pytest_asyncio_loop_factories(
    config: pytest.Config, item: pytest.Item
) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    if item.get_closest_marker("each_bus"):
        return {"memory": virtual_loop, "zenoh": asyncio.SelectorEventLoop}
    if item.get_closest_marker("real_time"):
        return {"real": asyncio.SelectorEventLoop}
    return {"virtual": virtual_loop}


@pytest.fixture(autouse=True)
def _every_task_has_an_owner(request: pytest.FixtureRequest) -> None:
    if asyncio.iscoroutinefunction(getattr(request, "function", None)):
        request.getfixturevalue("no_task_left_behind")


@pytest_asyncio.fixture
async def no_task_left_behind() -> AsyncIterator[None]:
    before = asyncio.all_tasks()
    yield
    await asyncio.sleep(0)
    left = [task.get_name() for task in asyncio.all_tasks() - before - {asyncio.current_task()} if not task.done()]
    assert not left, f"tasks left behind: {left}"


@pytest_asyncio.fixture
async def hub() -> AsyncIterator[MemoryHub]:
    async with MemoryHub() as hub:
        yield hub
