"""The wheel beside hostile neighbours: a package of the index and a folder of the application called as ours are."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
HOLDS = ("pyproject.toml", "README.md", "LICENSE", "engage_hri", "schemas", "services")


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the wheel installs, and over it what others install under the names of our folders."""
    place = tmp_path_factory.mktemp("wheel")
    source, site = place / "source", place / "site"
    source.mkdir()
    for name in HOLDS:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, source / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(ROOT / name, source / name)
    options = ("--no-deps", "--no-build-isolation", "--quiet", "--wheel-dir", place)
    command = (sys.executable, "-m", "pip", "wheel", *options, source)
    subprocess.run(command, check=True, capture_output=True, env={**os.environ, "PIP_NO_INDEX": "1"})
    (wheel,) = place.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    for name in ("services", "schemas"):
        (site / name).mkdir()
        (site / name / "__init__.py").touch()
        (site / name / "cli.py").write_text("raise SystemExit('not ours')")
    return site


def run(installed: Path, folder: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    """A Python that finds what is installed, in a folder of an application with a package of the same name."""
    (folder / "services").mkdir(exist_ok=True)
    (folder / "services" / "__init__.py").touch()
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    return subprocess.run(
        (sys.executable, *arguments), cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def test_the_wheel_installs_one_importable_name_and_no_links(installed: Path) -> None:
    names = {path.name for path in installed.iterdir() if not path.name.endswith(".dist-info")}

    assert names - {"services", "schemas"} == {"engage_hri"}
    assert not any(path.is_symlink() for path in installed.rglob("*"))
    assert (installed / "engage_hri/py.typed").is_file()
    assert list((installed / "engage_hri/schemas/exported").glob("*.json"))
    for page in ("services/console/web/page", "services/console/stage"):
        assert {path.name for path in (installed / "engage_hri" / page).iterdir()} == {
            path.name for path in (ROOT / page).iterdir()
        }


def test_programs_find_ours_beside_packages_of_the_same_name(installed: Path, tmp_path: Path) -> None:
    code = (
        "import engage_hri, services, schemas; from engage_hri import connect, Body, stream; "
        "print(engage_hri.__file__, services.__file__, connect.__module__)"
    )
    ended = run(installed, tmp_path, "-c", code)

    ours, theirs, module = ended.stdout.split()
    assert ours == str(installed / "engage_hri/__init__.py")
    assert theirs == str(tmp_path / "services/__init__.py")
    assert module.startswith("engage_hri.services.client.robot")


def test_a_robot_runs_from_it(installed: Path, tmp_path: Path) -> None:
    """With nothing of ours beside it that the wheel does not hold."""
    (tmp_path / "ask.json").write_text('{"id": "b", "behaviors": [{"type": "wait", "id": "w", "duration": 0.1}]}')

    ended = run(installed, tmp_path, "-P", "-m", "engage_hri", "play", "ask.json", "--embedded", "--virtual-time")

    assert ended.returncode == 0, ended.stderr
    assert "block b: done" in ended.stdout


DRIVER = '''
from msgspec.structs import replace

from engage_hri.services.control.torso.body import SimulatedBody


class Head(SimulatedBody):
    """A head on a trunk, without arms."""

    def __init__(self):
        super().__init__()
        joints = tuple(each for each in self.capabilities.joints if each.part in ("head", "torso"))
        types = ("gaze", "gazeShift", "head")
        self.capabilities = replace(
            self.capabilities, body="head", types=types, parts=("head", "torso"), joints=joints, reach=0.0
        )

    def state(self):
        return replace(super().state(), left_arm=None, right_arm=None)


class Liar(Head):
    def estimate(self, behavior, pose, world):
        told = super().estimate(behavior, pose, world)
        return replace(told, pose_end=told.pose_after)
'''
TESTS = """
import asyncio

import pytest

from driver import Head, Liar
from engage_hri.services.control.testing import BodyContract


class TestHead(BodyContract):
    def make(self):
        return Head()

    async def test_a_law_of_its_own(self, body):
        await asyncio.sleep(1000.0)  # no test waits for that: the clock is virtual

        assert body.capabilities.body == "head"


class TestLiar(BodyContract):
    seeds = 1

    def make(self):
        return Liar()


@pytest.mark.asyncio
async def test_what_is_no_body_has_the_loop_that_it_had():
    assert type(asyncio.get_running_loop()).__module__.startswith("asyncio.")
"""


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A driver's own repository, somewhere."""
    (tmp_path / "driver.py").write_text(DRIVER)
    (tmp_path / "test_driver.py").write_text(TESTS)
    (tmp_path / "pytest.ini").write_text("[pytest]\naddopts = --strict-markers -p no:hypothesispytest\n")
    (tmp_path / "conftest.py").write_text('pytest_plugins = ["engage_hri.services.control.testing.plugin"]\n')
    return tmp_path


def test_a_driver_runs_the_contract_suite_from_its_own_repository(installed: Path, repository: Path) -> None:
    ended = run(installed, repository, "-m", "pytest", "-q", "-p", "no:cacheprovider")
    failed = re.findall(r"^FAILED (.*?)(?: - .*)?$", ended.stdout, re.MULTILINE)

    assert failed == ["test_driver.py::TestLiar::test_ends_where_it_said"], ended.stdout
    assert "gaze at near-right, end: expected where `pose_end` said: neck_" in ended.stdout
    assert ended.returncode == 1


def test_without_its_plugin_the_suite_says_what_is_missing(installed: Path, repository: Path) -> None:
    (repository / "conftest.py").unlink()

    ended = run(installed, repository, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "TestHead and home")

    assert (
        'the suite needs its plugin: pytest_plugins = ["engage_hri.services.control.testing.plugin"]' in ended.stdout
    )


def test_a_body_is_checked_from_its_own_repository(installed: Path, repository: Path) -> None:
    ended = run(installed, repository, "-P", "-m", "engage_hri", "check-body", "driver.py:Liar", "--law", "end")

    assert ended.returncode == 1, ended.stderr
    assert "head (driver.py:Liar), held to the contract of bodies in virtual time" in ended.stdout
    assert re.search(r"1 law is broken, \d laws hold", ended.stdout)


def test_the_suite_costs_nothing_where_nobody_names_it(installed: Path, tmp_path: Path) -> None:
    test = "assert not [one for one in sys.modules if one.startswith('engage')]"
    test = f"import sys\n\n\ndef test_others():\n    {test}\n"
    (tmp_path / "test_others.py").write_text(test)

    ended = run(installed, tmp_path, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_others.py")

    assert ended.returncode == 0, ended.stdout


def test_every_python_that_it_promises_is_tried_before_it_is_released() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    promised = re.findall(r":: Python :: (3\.\d+)", "\n".join(project["classifiers"]))
    tried = re.search(r"python: \[(.*)\]", (ROOT / ".github/workflows/ci.yml").read_text())

    assert tried is not None
    assert re.findall(r"3\.\d+", tried[1]) == promised
    assert project["requires-python"] == f">={promised[0]}"
