"""Running the contract suite on a body in this process, by pytest, and collecting what every law found.

Nothing of the folder and the environment takes part: no configuration, no conftest.py, no other plugin.
"""

import asyncio
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from inspect import getdoc
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.testing.asked import BEHAVIORS, WORLD, behaviors_in
from engage_hri.services.control.testing.contract import BodyContract
from engage_hri.services.control.testing.findings import findings_of
from engage_hri.services.control.testing.first import FirstLook, look
from engage_hri.services.control.testing.laws import Finding, named
from engage_hri.services.control.testing.motions import unused
from engage_hri.services.control.testing.playing import playable, played
from engage_hri.services.control.testing.plugin import virtual_loop
from engage_hri.services.control.testing.render import Printed
from engage_hri.services.control.testing.report import BodyReport, CheckedLaw, Stated, told_once
from engage_hri.services.control.testing.suite import PLUGIN, Suite, unchecked
from engage_hri.services.runtime.virtual_time import Deadlock, TimeRanOut

Make = Callable[[], Body]
_judged: list[type[BodyContract]] = []
"""The class that the file of the running check takes."""


def check(make: Make, stated: Stated, *, driver: str, law: str = "", printed: Printed | None = None) -> BodyReport:
    """Check a body against the contract.

    make: makes it, in a running event loop. driver: its name, for the report. law: only laws whose names have these
    words; empty: all. printed: is told of each law as it is judged.

    Ctrl-C ends it with what was judged so far; while it is only looked at, with KeyboardInterrupt.

    Raises InputRefused if there is no such law, EngageError if the body cannot be had.
    """
    since = time.monotonic()
    seen = _looked_at(make, stated, driver)
    report = _reported(seen, stated, driver)
    if not seen.is_there:
        return replace(report, seconds=time.monotonic() - since)
    collected = _Collected(law.lower().replace("`", ""), report, printed)
    suite = _suite(make, stated, seen)
    with _judging(suite) as arguments:
        code = pytest.main(arguments, plugins=[collected])
    if code == pytest.ExitCode.NO_TESTS_COLLECTED:
        raise InputRefused(Fault(reason=f"no law has {law!r} in its name", advice="without it all names are printed"))
    if code not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED, pytest.ExitCode.INTERRUPTED):
        raise RuntimeError(f"pytest ended with {code!r}")
    laws, causes = told_once(collected.laws(), seen.causes)
    return replace(
        report, laws=laws, causes=causes, not_tried=tuple(collected.not_tried()), seconds=time.monotonic() - since,
        is_stopped=code == pytest.ExitCode.INTERRUPTED, fastest=suite.fastest or {},
        notes=(*(suite.notes or ()), *unused(seen.capabilities.joints, suite.fastest or {})),
    )  # fmt: skip


def judged() -> type[BodyContract]:
    """The suite of the running check."""
    return _judged[-1]


def _suite(make: Make, stated: Stated, seen: FirstLook) -> type[BodyContract]:
    settings = {
        "make": lambda self: make(),
        "faults": lambda self: played(make, playable(seen.capabilities)),
        "tolerance": stated.tolerance,
        "noise": stated.noise,
        "accuracy": stated.accuracy,
        "age": 0.005 if stated.real_time else 0.001,
        "world": stated.world or WORLD,
        "behaviors": _behaviors(stated),
        "unable": seen.unable,
        "notes": {},
        "fastest": {},
    }
    suite = type("TestBody", (BodyContract,), settings)
    return pytest.mark.real_time(suite) if stated.real_time else suite


def _behaviors(stated: Stated) -> tuple[BlockBehavior, ...]:
    return BEHAVIORS if stated.world is None else behaviors_in(stated.world)


# -- what it is ---------------------------------------------------------------------------------------------------


def _looked_at(make: Make, stated: Stated, driver: str) -> FirstLook:
    """Connect the body once, and see what it is. Raises InputRefused."""
    with asyncio.Runner(loop_factory=None if stated.real_time else virtual_loop) as runner:
        try:
            return runner.run(look(make, stated.world or WORLD, _behaviors(stated), stated.noise))
        except (Deadlock, TimeRanOut, TimeoutError) as error:
            advice = "a body with a clock of its own (hardware, a daemon, a socket) is checked with --real-time"
            reason = f"it waits for what never comes: {error}"
            raise InputRefused(Fault(reason=reason, where=f"body {driver}", advice=advice)) from error


def _reported(seen: FirstLook, stated: Stated, driver: str) -> BodyReport:
    return BodyReport(
        driver=driver, capabilities=seen.capabilities, stated=stated, asked=tuple(map(named, seen.asked)),
        not_asked=seen.not_asked, unknown=tuple(unchecked(seen.capabilities, _behaviors(stated))),
        estimate=seen.estimate, causes=seen.causes,
    )  # fmt: skip


# -- how pytest runs it -------------------------------------------------------------------------------------------


@contextmanager
def _judging(suite: type[BodyContract]) -> Iterator[list[str]]:
    """Lay a test file in a folder of its own, and give the arguments by which pytest runs it and nothing else."""
    kept = {name: os.environ.pop(name, None) for name in ("PYTEST_ADDOPTS", "PYTEST_PLUGINS")}
    kept["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = os.environ.get("PYTEST_DISABLE_PLUGIN_AUTOLOAD")
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    written = sys.dont_write_bytecode
    _judged.append(suite)
    try:
        with TemporaryDirectory(prefix="engage-check-body-") as folder:
            name = Path(folder).name.replace("-", "_")  # another one each time: Python keeps modules by their names
            file, settings = Path(folder) / f"test_{name}.py", Path(folder) / "pytest.ini"
            file.write_text(f"from {__name__} import judged\n\nTestBody = judged()\n", encoding="utf-8")
            settings.write_text("[pytest]\nasyncio_default_fixture_loop_scope = function\n", encoding="utf-8")
            without = [
                f"no:{plugin}" for plugin in ("cacheprovider", "terminal", "logging", "faulthandler", "warnings")
            ]
            loaded = ["pytest_asyncio.plugin", PLUGIN]
            options = [option for name in (*without, *loaded) for option in ("-p", name)]
            yield [str(file), "-c", str(settings), "--rootdir", folder, "--import-mode=importlib", *options]
    finally:
        _judged.pop()
        sys.dont_write_bytecode = written
        for name, value in kept.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


class _Tried:
    """Trials of one law, and what has come of them so far."""

    def __init__(self, law: Any, topic: str) -> None:
        says, _, usually = (getdoc(law) or "").partition("\n\n")
        self.says, self.usually = " ".join(says.split()), " ".join(usually.removeprefix("Usually ").split())
        self.topic = topic
        self.trials = self.passed = 0
        self.seconds = 0.0
        self.findings: dict[Finding, None] = {}
        self.reasons: dict[str, None] = {}

    def law(self, name: str) -> CheckedLaw:
        """Judge the law by them. name: of the law, in words."""
        return CheckedLaw(
            law=name, topic=self.topic, says=self.says, usually=self.usually, trials=self.trials,
            verdict="broken" if self.findings else "holds" if self.passed else "does not apply",
            findings=tuple(self.findings), reasons=tuple(self.reasons),
            seconds=self.seconds,
        )  # fmt: skip


class _Collected:
    """A plugin of pytest that keeps what each law found."""

    def __init__(self, words: str, report: BodyReport, printed: Printed | None) -> None:
        self._words, self._report, self._printed = words, report, printed
        self._tried: dict[str, _Tried] = {}
        self._asked: Counter[str] = Counter()
        """Trials of all laws that were asked for, in their order."""

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Keep the laws that were asked for, by topic and in the order in which they are written."""
        kept = [item for item in items if self._words in _words(item)]
        order = {topic: number for number, topic in enumerate(TOPICS)}
        items[:] = sorted(kept, key=lambda item: order[_topic(item)])
        self._asked = Counter(map(_words, items))
        if items and self._printed is not None:
            self._printed.begin(self._report)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Function, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Take the findings from the exception itself."""
        report = yield
        tried = self._tried.setdefault(_words(item), _Tried(item.function, _topic(item)))
        tried.seconds += report.duration
        if call.excinfo is not None and report.skipped:
            tried.reasons[str(call.excinfo.value)] = None
        elif call.excinfo is not None:
            found = findings_of(call.excinfo.value) or [
                Finding(expected="no error", measured=str(call.excinfo.value))
            ]
            tried.findings |= dict.fromkeys(found)
        if call.when == "call":
            tried.passed += report.passed
        if call.when == "teardown":
            tried.trials += 1
            if self._printed is not None and tried.trials == self._asked[_words(item)]:
                self._printed.judge(tried.law(_words(item)), [cause.what for cause in self._report.causes])
        return report

    def laws(self) -> Iterator[CheckedLaw]:
        """List the laws with what was found."""
        return (tried.law(name) for name, tried in self._tried.items() if tried.trials)

    def not_tried(self) -> Iterator[str]:
        """Names of the laws that were asked for, and that none of their trials has come to an end of."""
        return (name for name in self._asked if name not in self._tried or not self._tried[name].trials)


TOPICS = tuple(base.topic for base in BodyContract.__mro__ if issubclass(base, Suite) and "topic" in vars(base))
"""Topics of the laws, in the order in which the contract names them."""


def _words(item: pytest.Item) -> str:
    """Name of a law, in words."""
    name = getattr(item, "originalname", None) or item.name
    return name.removeprefix("test_").replace("_", " ")


def _topic(item: pytest.Item) -> str:
    name = getattr(item, "originalname", "")
    return next(base.topic for base in BodyContract.__mro__ if issubclass(base, Suite) and name in vars(base))
