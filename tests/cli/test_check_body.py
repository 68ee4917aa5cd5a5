"""`engage check-body`: what it prints of a body that keeps the contract, of one that breaks it, and of none."""

import io
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from unittest.mock import patch

import pytest
from rich.console import Console

from engage_hri.schemas.body import Capabilities, JointLimit
from engage_hri.services.control.testing.check import check
from engage_hri.services.control.testing.report import BodyReport, Printed, Stated
from engage_hri.services.control.torso.body import SimulatedBody
from tests.cli.command import Engage

DRIVERS = '''
import asyncio
from contextlib import asynccontextmanager
from pathlib import Path

from msgspec.structs import replace

from engage_hri.services.control.torso.body import SimulatedBody

print("a driver that prints as it is imported")


class Good(SimulatedBody):
    async def home(self, parts=()):
        print("and in what it does")
        await super().home(parts)


class Hurried(SimulatedBody):
    """Takes twice as long as it says."""

    def estimate(self, behavior, pose, world):
        told = super().estimate(behavior, pose, world)
        return replace(told, phases=tuple(replace(one, natural=one.natural / 2, shortest=0.0) for one in told.phases))


class Idle(SimulatedBody):
    def __init__(self):
        super().__init__()
        self.capabilities = replace(self.capabilities, body="idle", types=("locomotion",), joints=())


class Clumsy(SimulatedBody):
    def perform(self, behavior, authority):
        raise KeyError("joint 7")


class Puzzled(SimulatedBody):
    def estimate(self, behavior, pose, world):
        raise KeyError("x")


class Unplugged(SimulatedBody):
    @asynccontextmanager
    async def connected(self):
        raise OSError("no such port")
        yield


class Numb(SimulatedBody):
    """Does as if it moved, and does not."""

    def state(self):
        return replace(super().state(), pose=self.rest, gaze=None, left_arm=None, right_arm=None)

    @property
    def rest(self):
        self.at_rest = getattr(self, "at_rest", None) or super().state().pose
        return self.at_rest


class Sleeping(SimulatedBody):
    async def perform(self, behavior, authority):
        if type(behavior).__name__ != "Speech":
            await asyncio.get_running_loop().create_future()
        async for progress in super().perform(behavior, authority):
            yield progress


class Faultless(SimulatedBody):
    def __init__(self):
        super().__init__()
        self.capabilities = replace(self.capabilities, faults=())


class Waiting(SimulatedBody):
    async def home(self, parts=()):
        await asyncio.get_running_loop().create_future()


class Leaving(SimulatedBody):
    @asynccontextmanager
    async def connected(self):
        Path("diary").open("a").write("in\\n")
        try:
            yield
        finally:
            Path("diary").open("a").write("out\\n")


class Silent(SimulatedBody):
    def __init__(self):
        super().__init__()
        self.capabilities = replace(self.capabilities, types=("gaze", "locomotion"), reach=0.0)
'''


@pytest.fixture
def drivers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder whose settings of pytest are none of its business, and the file in it."""
    (tmp_path / "pytest.ini").write_text("[pytest]\naddopts = --no-such-option\n")
    (tmp_path / "conftest.py").write_text("raise SystemExit('not ours')\n")
    (tmp_path / "drivers.py").write_text(DRIVERS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTEST_ADDOPTS", "--no-such-option")
    monkeypatch.setenv("COLUMNS", "150")
    return tmp_path / "drivers.py"


def test_a_body_that_keeps_the_contract(engage: Engage, drivers: Path) -> None:
    ended = engage("check-body", "drivers.py:Good")

    assert ended.code == 0, ended.out
    assert "simulated (drivers.py:Good), held to the contract of bodies in virtual time" in ended.out
    assert "neck_yaw              head        -85          85        500" in ended.out
    stated = "estimates within 100 ms; encoders scatter by 0.00 degrees; on target within 1.0 degrees"
    assert f"stated       {stated}" in ended.out
    assert "holds   takes the time that it predicted" in ended.out
    assert "BROKEN" not in ended.out
    assert "holds   with a fault it passes or names the fault" in ended.out
    assert "laws hold, none is broken, 0 laws do not apply. It took" in ended.out
    assert "and in what it does" not in ended.out
    assert ended.err == "a driver that prints as it is imported\nand in what it does\n"


def test_a_broken_law_says_what_was_measured_where_and_what_it_usually_is(engage: Engage, drivers: Path) -> None:
    ended = engage("check-body", "drivers.py:Hurried", "--law", "takes the time")

    assert ended.code == 1
    assert "BROKEN  takes the time that it predicted" in ended.out
    expected, measured = "287 ms from stroke_start, within 100 ms", "574 ms"
    assert f"- gaze at near-right, stroke: expected {expected}; measured {measured}" in ended.out
    assert "more; --json has all" in ended.out
    assert "usually: the estimate is the time of the command: the joints arrive later" in ended.out
    assert "1 law is broken, 0 laws hold, 0 laws do not apply." in ended.out
    assert "Traceback" not in ended.out


def test_what_is_stated_is_allowed_for(engage: Engage, drivers: Path) -> None:
    ended = engage("check-body", "drivers.py:Hurried", "--law", "takes the time", "--tolerance", "0.5")

    assert ended.code == 0, ended.out
    assert "estimates within 500 ms" in ended.out


def test_an_error_of_the_driver_is_told_with_its_place(engage: Engage, drivers: Path) -> None:
    ended = engage("check-body", "drivers.py:Clumsy", "--law", "sync point")

    assert ended.code == 1
    line = 1 + DRIVERS.splitlines().index('        raise KeyError("joint 7")')
    cause = f"its driver breaks: KeyError: 'joint 7' at drivers.py, line {line}: 2 laws could not be judged by that"
    assert cause in " ".join(ended.out.split())
    assert ended.out.count("KeyError") == 1
    assert "usually" not in ended.out


@pytest.mark.parametrize(
    ("driver", "words"),
    [
        ("Puzzled", "its driver breaks: KeyError: 'x' at drivers.py, line"),
        ("Unplugged", "its driver breaks: OSError: no such port at drivers.py, line"),
        ("Numb", "nothing moves: none of its joints has turned in"),
        ("Sleeping", "what is begun never ends, having passed nothing: "),
    ],
)
def test_one_cause_is_told_once_and_takes_no_time(engage: Engage, drivers: Path, driver: str, words: str) -> None:
    ended = engage("check-body", f"drivers.py:{driver}")
    told = " ".join(ended.out.split())

    assert ended.code == 1
    assert told.count(words) == 1, ended.out
    assert "usually" not in told
    assert "Traceback" not in ended.out + ended.err


def test_what_does_not_break_is_judged_all_the_same(engage: Engage, drivers: Path) -> None:
    ended = engage("check-body", "drivers.py:Sleeping", "--json")
    verdicts = {law["law"]: law["verdict"] for law in json.loads(ended.out)["laws"]}

    assert verdicts["a speech tells its words in order"] == "holds"
    assert verdicts["takes the time that it predicted"] == "holds"
    assert verdicts["stands still while it waits"] == "not judged"


def test_a_body_that_can_do_nothing_has_not_passed(engage: Engage, drivers: Path) -> None:
    ended = engage("check-body", "drivers.py:Idle")

    assert ended.code == 1
    assert "not checked  locomotion: the suite has no such behavior" in ended.out
    assert "none; its types are locomotion" in ended.out
    assert "it can do nothing of what it is asked for" in ended.out


def test_a_body_that_never_comes_home_is_told_so_by_one_law(engage: Engage, drivers: Path) -> None:
    ended = engage("check-body", "drivers.py:Waiting", "--law", "home is reached")

    assert ended.code == 1
    assert "expected that `home` returns within 30.0 s; measured it does not" in ended.out


def test_who_plays_no_fault_is_told_where_it_says_how(engage: Engage, drivers: Path) -> None:
    ended = engage("check-body", "drivers.py:Faultless", "--law", "with a fault")

    assert "No fault was played: a test of your own can name some (`faults`, docs/contract.md)." in ended.out
    assert "`faults` names faults" in (Path(__file__).parents[2] / "docs" / "contract.md").read_text()


def test_the_json_has_all(engage: Engage, drivers: Path) -> None:
    ended = engage("check-body", "drivers.py:Hurried", "--law", "predicted", "--json")
    report = json.loads(ended.out)

    assert ended.code == 1
    assert not report["good"]
    assert report["capabilities"]["body"] == "simulated"
    (law,) = report["laws"]
    assert (law["law"], law["verdict"], law["trials"]) == ("takes the time that it predicted", "broken", 1)
    assert len(law["findings"]) > 10
    assert law["findings"][0] == {
        "expected": "287 ms from stroke_start, within 100 ms", "measured": "574 ms",
        "behavior": "gaze at near-right", "sync": "stroke",
        "advice": "it comes 287 ms later than it says: the estimate is to count that in",
    }  # fmt: skip


def test_a_world_of_ones_own_is_looked_at(engage: Engage, drivers: Path) -> None:
    entities = [
        {"id": "cup", "kind": "object", "position": [0.5, 0.2, 0.8]},
        {"id": "box", "kind": "object", "position": [0.5, -0.2, 0.8]},
    ]
    Path("world.json").write_text(json.dumps({"entities": entities}))

    ended = engage("check-body", "drivers.py:Silent", "--world", "world.json")

    assert ended.code == 0, ended.out
    assert "asked for    gaze at cup" in ended.out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("drivers.py:Nobody",), "body drivers.py:Nobody"),
        (("nowhere.py:Mine",), "body nowhere.py:Mine"),
        (("drivers.py:Hurried", "--law", "thermodynamics"), "no law has 'thermodynamics' in its name"),
        (("drivers.py:Good", "--world", "nowhere.json"), "nowhere.json"),
    ],
)
def test_what_cannot_be_checked_is_refused(
    engage: Engage, drivers: Path, arguments: tuple[str, ...], words: str
) -> None:
    ended = engage("check-body", *arguments)

    assert ended.code == 2
    assert words in ended.err
    assert len([line for line in ended.err.splitlines() if line != "a driver that prints as it is imported"]) == 1


def test_without_pytest_it_names_the_extra(engage: Engage, drivers: Path) -> None:
    with patch("engage_hri.services.commandline.bodies.check_body.find_spec", lambda name: None):
        ended = engage("check-body", "drivers.py:Good")

    assert ended.code == 2
    assert "check-body needs pytest and pytest-asyncio" in ended.err
    assert "-m pip install -e" in ended.err


def test_nothing_else_of_the_package_imports_pytest(engage: Engage) -> None:
    root = Path(__file__).parents[2]
    importing = {
        str(path.relative_to(root).parent)
        for folder in ("services", "schemas")
        for path in (root / folder).rglob("*.py")
        if any(line.startswith(("import pytest", "from pytest")) for line in path.read_text().splitlines())
    }

    assert importing == {"services/control/testing"}


@pytest.mark.real_time
@pytest.mark.parametrize(("stop", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_who_is_stopped_leaves_the_robot(drivers: Path, stop: signal.Signals, code: int) -> None:
    os.mkfifo("diary")
    with open(os.open("diary", os.O_RDWR)) as diary:  # for both, so that there is no end of it
        command = (sys.executable, "-m", "engage_hri", "check-body", "drivers.py:Leaving", "--real-time")
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
            told = [next(diary) for _ in range(3)]  # it is described, and then checked
            process.send_signal(stop)

            out, _ = process.communicate(timeout=60.0)
            assert process.returncode == code
        told.append(next(diary))

    assert told == ["in\n", "out\n", "in\n", "out\n"]
    assert "Stopped: 0 laws were judged" in out
    assert "reports every sync point once and in order" in out


def test_a_law_is_told_as_it_is_judged() -> None:
    out, told = io.StringIO(), list[str]()

    class Reading(SimulatedBody):
        @asynccontextmanager
        async def connected(self) -> AsyncIterator[None]:
            told.append(out.getvalue())
            async with super().connected():
                yield

    stated = Stated(tolerance=0.1, noise=0.0, accuracy=0.02)
    check(Reading, stated, driver="reading", law="aborted", printed=Printed(Console(file=out)))

    looked, first, second, *_ = told
    assert looked == ""
    assert "held to the contract" in first
    assert "holds" not in first
    assert second.count("holds   ") == 1


@pytest.mark.parametrize("is_seen", [True, False])
def test_the_speeds_that_joints_were_seen_to_have_are_beside_those_that_the_body_states(is_seen: bool) -> None:
    able = Capabilities(
        body="two", types=(), parts=("neck", "arm"),
        joints=(
            JointLimit(joint="tilt", part="neck", low=-0.5, high=0.5, speed=1.0, acceleration=5.0),
            JointLimit(joint="lift", part="arm", low=0.0, high=2.0, speed=2.0, acceleration=4.0),
        ),
    )  # fmt: skip
    report = BodyReport(
        driver="simulated", capabilities=able, stated=Stated(tolerance=0.1, noise=0.0, accuracy=0.01), asked=(),
        not_asked=(), unknown=(), estimate=0.0, fastest={"tilt": 0.25} if is_seen else {},
    )  # fmt: skip
    out = io.StringIO()
    Printed(Console(file=out, width=120)).end(report)

    lines = [re.split(r"  +", line.strip()) for line in out.getvalue().splitlines()]
    head = next(number for number, line in enumerate(lines) if line[0] == "joint")
    assert ("seen degrees/s" in lines[head]) is is_seen
    assert lines[head + 1 : head + 3] == [
        ["tilt", "neck", "-29", "29", "57", "286", *["14"] * is_seen],
        ["lift", "arm", "0", "115", "115", "229", *["0"] * is_seen],
    ]
