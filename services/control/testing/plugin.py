"""The plugin of pytest for the contract suite: the virtual clock, and the marker `real_time`.

It is loaded by who names it (`pytest_plugins`, or `-p`), and touches no test but those of the suite. It has no
asserts that pytest could tell more of, and may be imported before pytest loads it: PYTEST_DONT_REWRITE.
"""

import asyncio
from collections.abc import Callable, Generator, Mapping

import pytest

from engage_hri.services.runtime.virtual_time import VirtualTimeLoop

LONGEST_TEST = 24 * 3600.0
"""Virtual seconds; then a test waits for something that never comes."""
Factories = Mapping[str, Callable[[], asyncio.AbstractEventLoop]]


def virtual_loop() -> asyncio.AbstractEventLoop:
    """Make a loop whose clock jumps to the next timer."""
    return VirtualTimeLoop(limit=LONGEST_TEST)


def pytest_configure(config: pytest.Config) -> None:
    """Make the marker known."""
    config.addinivalue_line("markers", "real_time: runs on the wall clock (hardware, sockets, processes)")


@pytest.hookimpl(wrapper=True)
def pytest_asyncio_loop_factories(item: pytest.Item) -> Generator[None, Factories | None, Factories]:
    """Choose the loop of the suite's tests. All others keep the one that they have."""
    from engage_hri.services.control.testing.suite import Suite

    theirs = yield
    if not (isinstance(item, pytest.Function) and item.cls is not None and issubclass(item.cls, Suite)):
        return theirs or {"asyncio": asyncio.new_event_loop}
    if item.get_closest_marker("real_time"):
        return {"real": asyncio.SelectorEventLoop}
    return {"virtual": virtual_loop}
