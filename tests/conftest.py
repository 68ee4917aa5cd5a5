"""Every async test runs on the virtual clock unless it asks for real time, and fails if it leaves a task behind.

Property tests try the same examples each time, and of many only a share (`random_cases.py`). To try all of them:
`pytest --hypothesis-profile=long`. To search for new ones: `pytest --hypothesis-profile=search`.
"""

import asyncio
import gc
import logging
import os
import signal
import sys
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from pathlib import Path

import pytest
import pytest_asyncio
from hypothesis import settings

from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.testing.plugin import virtual_loop
from tests.long_share import TESTS, Left, Started, is_long, is_many
from tests.longest import LONGEST
from tests.skips import Skips

pytest.register_assert_rewrite("tests.recognition.event_stories", "tests.generation.head_stories")

# No deadline: how long an example takes on a busy machine says nothing.
settings.register_profile("same", derandomize=True, database=None, deadline=None)
settings.register_profile("long", parent=settings.get_profile("same"))
settings.register_profile("map", parent=settings.get_profile("same"), max_examples=5)
settings.register_profile("search", parent=settings.get_profile("default"), deadline=None)
settings.load_profile("same")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in a shell's background, and all children would inherit it
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Set in many containers. Each worker, and each of some hundred processes of the tests, would compile everything anew.
if os.environ.pop("PYTHONDONTWRITEBYTECODE", ""):
    sys.dont_write_bytecode = False

# Else each worker, and each process that is no `engage`, starts a thread of numpy's for each processor, for nothing.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Commands run within a worker, and `engage record` gives way to all others: so would each later test of that worker.
pytest.MonkeyPatch().setattr(os, "nice", lambda by: by)

pytest_plugins = ["engage_hri.services.control.testing.plugin"]


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """One worker more than processors where tests wait for processes of their own, as the long share does."""
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return processors if config.option.markexpr == "not long" else processors + 1


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "contained: something goes wrong here on purpose, and is contained")
    config.addinivalue_line(
        "markers", "each_bus: runs on each kind of bus (shared=False: not with one session for all)"
    )
    config.addinivalue_line("markers", "long: left to `make test-all` (set by conftest: tests/long_share.py)")
    config.addinivalue_line("markers", "many: left to `make test-long`, being more of the same")
    config.pluginmanager.register(Left(config), "left")
    config.pluginmanager.register(Bugs(), "bugs")
    config.pluginmanager.register(Started(), "started")
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Skips(), "skips")


class FromBehind(pytest.Package):
    """All tests, the last ones first."""

    def collect(self) -> Iterator[pytest.Item | pytest.Collector]:
        return reversed([*super().collect()])


def pytest_collect_directory(path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Have every other worker load the tests from behind: what one has compiled by then, the other only reads."""
    number = int(getattr(parent.config, "workerinput", {}).get("workerid", "gw0").removeprefix("gw"))
    return FromBehind.from_parent(parent, path=path) if number % 2 and path == TESTS else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the long share before `-m` is judged. Long files first: whoever gets the last ends soon after others."""
    cases: Counter[str] = Counter()
    for item in items:
        test = item.nodeid.partition("::")[2]
        marks = {mark.name for mark in item.iter_markers()}
        whole = item.nodeid.partition("[")[0]
        place, cases[whole] = cases[whole], cases[whole] + 1
        if is_long(item.path, test, place=place, real_time="real_time" in marks, each_bus="each_bus" in marks):
            item.add_marker("long")
            if is_many(item.path, test, place=place):
                item.add_marker("many")
    places = {config.rootpath / "tests" / name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: (places.get(item.path, len(places)), item.path))


def pytest_collection_finish(session: pytest.Session) -> None:
    """Leave the tests themselves out of each later search for garbage: half a million objects, which all stay."""
    gc.collect()
    gc.freeze()


def pytest_asyncio_loop_factories(
    config: pytest.Config, item: pytest.Item
) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    if marker := item.get_closest_marker("each_bus"):
        from tests.bus.places import GroupLoop, SharedLoop  # loads Zenoh, and few workers need it

        shared = {"shared": SharedLoop} if marker.kwargs.get("shared", True) else {}
        return {"memory": virtual_loop, "zenoh": asyncio.SelectorEventLoop, "group": GroupLoop, **shared}
    if item.get_closest_marker("real_time"):
        return {"real": asyncio.SelectorEventLoop}
    return {"virtual": virtual_loop}


class Bugs(logging.Handler):
    """What `Bus.containing` has kept from ending a service or a client, and what a loop has kept of its callbacks.

    Contained or not, an exception that nobody has foreseen fails the test, unless it is what the test is about. It is
    a plugin and no fixture, which would cost each of ten thousand tests a millisecond.
    """

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.found: list[str] = []
        self._logs = [logging.getLogger(name) for name in ("engage", "asyncio")]

    def emit(self, record: logging.LogRecord) -> None:
        text = logging.Formatter().format(record)
        # What else a loop tells comes when garbage is collected, perhaps in another test.
        if record.name != "asyncio" or text.startswith("Exception in callback"):
            self.found.append(text)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self) -> None:
        self.found.clear()
        for log in self._logs:
            log.addHandler(self)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_teardown(self, item: pytest.Item) -> Iterator[None]:
        try:
            yield
        finally:
            for log in self._logs:
                log.removeHandler(self)
        expected = item.get_closest_marker("contained") is not None
        assert expected or not self.found, "\n".join(self.found)


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
