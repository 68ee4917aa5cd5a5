"""Running the contract suite on a body in this process, by pytest, and collecting what every law found.

Nothing of the folder and the environment takes part: no configuration, no conftest.py, no other plugin.

Before that each type of behavior is tried once. What breaks there would break each law that needs it, with minutes of
waiting and words of other things. So it is told once, and the laws are judged without it.
"""

import asyncio
import math
import sys
import time
from collections import Counter
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from inspect import getdoc
from itertools import cycle, islice
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Speech, Wait
from engage_hri.schemas.body import Capabilities, Estimate
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.testing.contract import BodyContract
from engage_hri.services.control.testing.findings import (
    NEVER_ENDS,
    NOTHING_MOVES,
    WRONG_UNIT,
    Finding,
    angles,
    cause_of,
    degrees,
    findings_of,
    listed,
    named,
    turned,
)
from engage_hri.services.control.testing.motions import unused
from engage_hri.services.control.testing.plugin import virtual_loop
from engage_hri.services.control.testing.report import (
    BodyReport,
    Cause,
    CheckedLaw,
    Printed,
    Stated,
    by_words,
    told_once,
)
from engage_hri.services.control.testing.stage import LOOK_EVERY, PATIENCE, Connection, Stage
from engage_hri.services.control.testing.suite import (
    BEHAVIORS,
    PLUGIN,
    STILL,
    WORLD,
    Suite,
    behaviors_in,
)
from engage_hri.services.control.testing.truth import Make, playable, played
from engage_hri.services.runtime.virtual_time import Deadlock, TimeRanOut

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
    first = _FirstLook(stated)
    report = _looked_at(first, make, driver)
    if not first.is_there:
        return replace(report, seconds=time.monotonic() - since)
    collected = _Collected(law.lower().replace("`", ""), report, printed)
    suite = _suite(make, report, first)
    with _judging(suite) as arguments:
        code = pytest.main(arguments, plugins=[collected])
    if code == pytest.ExitCode.NO_TESTS_COLLECTED:
        raise InputRefused(Fault(reason=f"no law has {law!r} in its name", advice="without it all names are printed"))
    if code not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED, pytest.ExitCode.INTERRUPTED):
        raise RuntimeError(f"pytest ended with {code!r}")
    laws, causes = told_once(collected.laws(), report.causes)
    return replace(
        report, laws=laws, causes=causes, not_tried=tuple(collected.not_tried()), seconds=time.monotonic() - since,
        is_stopped=code == pytest.ExitCode.INTERRUPTED, fastest=suite.fastest or {},
        notes=(*(suite.notes or ()), *unused(report.capabilities.joints, suite.fastest or {})),
    )  # fmt: skip


def judged() -> type[BodyContract]:
    """The suite of the running check."""
    return _judged[-1]


def _suite(make: Make, report: BodyReport, first: "_FirstLook") -> type[BodyContract]:
    stated = report.stated
    settings = {
        "make": lambda self: make(),
        "faults": lambda self: played(make, playable(report.capabilities)),
        "tolerance": stated.tolerance,
        "noise": stated.noise,
        "accuracy": stated.accuracy,
        "age": 0.005 if stated.real_time else 0.001,
        "world": first.world,
        "behaviors": first.behaviors,
        "unable": first.unable,
        "notes": {},
        "fastest": {},
    }
    suite = type("TestBody", (BodyContract,), settings)
    return pytest.mark.real_time(suite) if stated.real_time else suite


# -- the first look -----------------------------------------------------------------------------------------------

ESTIMATED = 20
"""Estimates whose time is taken."""
BEYOND = 3.0
"""Readings that are so many times beyond the range of a joint have the wrong unit: degrees are 57 times radians."""
SLACK: Seconds = 5.0
"""Seconds that a behavior may take here in addition to three times what it said."""


def _looked_at(first: "_FirstLook", make: Make, driver: str) -> BodyReport:
    """Connect the body once, and see what it is. Raises EngageError."""
    with asyncio.Runner(loop_factory=None if first.stated.real_time else virtual_loop) as runner:
        try:
            return replace(runner.run(first.look(make)), driver=driver)
        except (Deadlock, TimeRanOut, TimeoutError) as error:
            advice = "a body with a clock of its own (hardware, a daemon, a socket) is checked with --real-time"
            reason = f"it waits for what never comes: {error}"
            raise InputRefused(Fault(reason=reason, where=f"body {driver}", advice=advice)) from error


class _FirstLook:
    """First look at a body: what it is, and whether it can be judged at all.

    unable: for types of behaviors that laws are not to ask for, the words of what is wrong with them. is_there: false
    if it cannot be connected, so that no law can be judged.
    """

    def __init__(self, stated: Stated) -> None:
        self.stated = stated
        self.world = stated.world or WORLD
        self.behaviors = BEHAVIORS if stated.world is None else behaviors_in(stated.world)
        self.unable: dict[str, str] = {}
        self.is_there = True
        self._wrong: dict[str, str] = {}
        """What is wrong with behaviors, both in words."""
        self._estimates: dict[str, Estimate] = {}
        """By the ids of the behaviors."""
        self._moved: dict[str, bool] = {}
        """Whether a joint has moved in behaviors that have joints; in words."""
        self._farthest: dict[str, Radians] = {}
        """The farthest from zero that each joint was read."""

    async def look(self, make: Make) -> BodyReport:
        """Connect a body, ask it about the behaviors, and let it perform one of each type. Raises EngageError."""
        body = make()
        connection = Connection(body)
        try:
            await connection.enter()
        except EngageError:
            raise
        except Exception as error:
            self.is_there = False
            able = getattr(body, "capabilities", Capabilities(body="", types=(), parts=()))
            return BodyReport(capabilities=able, stated=self.stated, causes=(Cause(what=cause_of(error)),))
        try:
            return await self._asked_about(body)
        finally:
            await Stage.end_all()
            await connection.leave()

    async def _asked_about(self, body: Body) -> BodyReport:
        able = body.capabilities
        try:
            body.see(self.world)
        except Exception as error:
            self._wrong[""] = cause_of(error)
        for behavior in self.behaviors:
            if type_name(behavior) in able.types:
                self._estimate(body, behavior)
        told = [(each, self._estimates[each.id]) for each in self.behaviors if each.id in self._estimates]
        asked = [behavior for behavior, estimate in told if estimate.feasible]
        took = self._timed(body, asked)
        if asked:
            await self._go_home(body)
        for behavior in {type_name(each): each for each in reversed(asked)}.values():
            if type_name(behavior) not in self.unable:
                await self._try(body, behavior)
        self._find_causes(able, asked)
        known = {type_name(each) for each in self.behaviors}
        causes = [replace(each, behaviors=tuple(filter(None, each.behaviors))) for each in by_words(self._wrong)]
        return BodyReport(
            capabilities=able, stated=self.stated, asked=tuple(map(named, asked)),
            not_asked=tuple(
                f"{named(each)}: {estimate.fault.reason if estimate.fault else 'not feasible'}"
                for each, estimate in told if not estimate.feasible
            ),
            unknown=tuple(kind for kind in able.types if kind not in known), estimate=took, causes=tuple(causes),
        )  # fmt: skip

    def _is_wrong(self, behavior: BlockBehavior, what: str) -> None:
        self._wrong[named(behavior)] = self.unable[type_name(behavior)] = what

    def _estimate(self, body: Body, behavior: BlockBehavior) -> None:
        try:
            self._estimates[behavior.id] = body.estimate(behavior, None, self.world)
        except Exception as error:
            self._is_wrong(behavior, cause_of(error))

    def _timed(self, body: Body, asked: Sequence[BlockBehavior]) -> Seconds:
        times = []
        for behavior in islice(cycle(asked), ESTIMATED):
            since = time.perf_counter()
            self._estimate(body, behavior)
            times.append(time.perf_counter() - since)
        return median(times) if times else 0.0

    async def _go_home(self, body: Body) -> None:
        try:
            async with asyncio.timeout(PATIENCE):
                await body.home()
        except TimeoutError:
            pass  # that is for the laws of `home` to say, and takes nothing from the others
        except Exception as error:
            self._wrong["home"] = cause_of(error)

    async def _try(self, body: Body, behavior: BlockBehavior) -> None:
        """Perform a behavior, and note whether it ends, and whether something moves."""
        takes = sum(phase.natural for phase in self._estimates[behavior.id].phases)
        until = asyncio.get_running_loop().time() + 3.0 * takes + SLACK
        stage = Stage(body, behavior, "end")
        is_moved = False
        try:
            before = angles(body.state().pose)
            while not stage.task.done() and asyncio.get_running_loop().time() < until:
                await asyncio.sleep(LOOK_EVERY)
                now = angles(body.state().pose)
                self._farthest = {each: max(abs(now[each]), self._farthest.get(each, 0.0)) for each in now}
                is_moved = is_moved or turned(now, before) > 5 * STILL + 12.0 * self.stated.noise
            if stage.task.done():
                stage.task.result()
            else:
                self._is_wrong(behavior, f"{NEVER_ENDS}, having passed {listed(stage.passed)}")
        except Exception as error:
            self._is_wrong(behavior, cause_of(error))
        if takes > LOOK_EVERY and not isinstance(behavior, Speech | Wait):
            self._moved[named(behavior)] = is_moved
        await Stage.end_all()

    def _find_causes(self, able: Capabilities, asked: Sequence[BlockBehavior]) -> None:
        """Find what is behind all else that is wrong with joints: that nothing moves, or a wrong unit."""
        if able.joints and not any(self._moved.values()):
            # Those that have ended or failed by themselves, so that their joints are to blame.
            ended = {each for each in self._moved if self._wrong.get(each, "it failed").startswith("it failed")}
            what = f"{NOTHING_MOVES}: none of its joints has turned in {listed(self._moved)}"
            self.unable |= {type_name(each): what for each in asked if named(each) in ended}
            self._wrong |= dict.fromkeys(ended, what)
        for limit in able.joints:
            read = self._farthest.get(limit.joint, 0.0)
            if read > max(math.pi, BEYOND * max(abs(limit.low), abs(limit.high))):
                goes = f"it goes from {degrees(limit.low)} to {degrees(limit.high)}"
                unit = f"{WRONG_UNIT} {limit.joint} was read at {degrees(read)}, and {goes}"
                self.unable = dict.fromkeys(map(type_name, asked), unit)
                self._wrong = dict.fromkeys(map(named, asked), unit)
                return


# -- how pytest runs it -------------------------------------------------------------------------------------------


@contextmanager
def _judging(suite: type[BodyContract]) -> Iterator[list[str]]:
    """Lay a test file in a folder of its own, and give the arguments by which pytest runs it and nothing else."""
    _judged.append(suite)
    with TemporaryDirectory(prefix="engage-check-body-") as folder, pytest.MonkeyPatch.context() as patch:
        for name in ("PYTEST_ADDOPTS", "PYTEST_PLUGINS"):
            patch.delenv(name, raising=False)
        patch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
        patch.setattr(sys, "dont_write_bytecode", sys.dont_write_bytecode)  # pytest sets it
        name = Path(folder).name.replace("-", "_")  # another one each time: Python keeps modules by their names
        file, settings = Path(folder) / f"test_{name}.py", Path(folder) / "pytest.ini"
        file.write_text(f"from {__name__} import judged\n\nTestBody = judged()\n", encoding="utf-8")
        settings.write_text("[pytest]\nasyncio_default_fixture_loop_scope = function\n", encoding="utf-8")
        without = [f"no:{plugin}" for plugin in ("cacheprovider", "terminal", "logging", "faulthandler", "warnings")]
        options = [option for name in (*without, "pytest_asyncio.plugin", PLUGIN) for option in ("-p", name)]
        try:
            yield [str(file), "-c", str(settings), "--rootdir", folder, "--import-mode=importlib", *options]
        finally:
            _judged.pop()


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
