"""A plugin of pytest, `-p tests.mutants.contexts`: which test file runs which line, how long each takes, which fail.

Coverage knows contexts. Here the context is the test file, also in the processes that a test starts: they inherit it
by the environment. It runs in each worker of xdist; the times are written by the process that hears of all.
"""

import json
import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import coverage
import pytest

from tests.mutants.places import SECONDS


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Lines that run from here on are this file's."""
    file = os.environ["ENGAGE_TEST_FILE"] = str(item.path.relative_to(item.config.rootpath))
    if (measured := coverage.Coverage.current()) is not None:
        measured.switch_context(file)
    return (yield)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Of a test with many parameters the first, one in the middle, and the last: a map wants lines, not cases."""
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        cases.setdefault(item.nodeid.partition("[")[0], []).append(item)
    few = {id(each[place]) for each in cases.values() for place in (0, len(each) // 2, -1)}
    config.hook.pytest_deselected(items=[item for item in items if id(item) not in few])
    items[:] = [item for item in items if id(item) in few]


class Times:
    """Seconds of each test file, over all workers, and which of them were red."""

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()
        self.red: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        file = report.nodeid.partition("::")[0]
        self.seconds[file] += report.duration
        if report.failed:
            self.red.add(file)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        path = Path(session.config.rootpath, SECONDS)
        path.parent.mkdir(parents=True, exist_ok=True)
        times = {file: round(time, 3) for file, time in sorted(self.seconds.items())}
        path.write_text(json.dumps({"seconds": times, "red": sorted(self.red)}, indent=0))


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Times(), "times of files")
