"""How many random cases are tried, which tests are long, and which files begin first."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import settings

from tests.long_share import FIRST_CASES, LONG, LONG_TESTS, SHORT_PROCESSES, SMOKE, is_long, may_have_long
from tests.longest import LONGEST
from tests.random_cases import share_of, trials

ROOT = Path(__file__).parents[1]
TESTS = ROOT / "tests"


@pytest.fixture(params=["same", "long", "search"])
def profile(request: pytest.FixtureRequest):
    before = settings.get_current_profile_name()
    settings.load_profile(request.param)
    yield request.param
    settings.load_profile(before)


def test_a_twelfth_is_tried_but_at_least_one_unless_all_are_asked_for(profile: str) -> None:
    told = [share_of(whole) for whole in (1, 12, 13, 300)]

    assert told == ([1, 1, 2, 25] if profile == "same" else [1, 12, 13, 300])
    assert trials() == (1 if profile == "same" else None)


@pytest.mark.parametrize(
    ("goal", "name", "short"), [("test", "same", True), ("test-all", "same", False), ("test-long", "long", False)]
)
def test_make_asks_for_a_share_or_for_all(goal: str, name: str, short: bool) -> None:
    told = subprocess.run(["make", "-n", goal], cwd=ROOT, capture_output=True, text=True, check=True).stdout

    assert [word for word in told.split() if "profile" in word] == [f"--hypothesis-profile={name}"]
    assert ('-m "not long"' in told) is short


@pytest.mark.parametrize(
    ("name", "real_time", "long"),
    [
        ("bus/test_cuts.py::test_it", True, True),
        ("bus/test_order.py::test_it", False, False),
        ("lab/test_lab.py::test_it", False, True),
        ("test_wheel.py::test_it", False, True),
        ("a.py::test_whole", False, True),
        ("a.py::test_whole[case]", False, True),
        ("a.py::test_whole_part", False, False),
        ("a.py::TestAll::test_it[case]", False, True),
        ("a.py::test_some[raw]", False, True),
        ("a.py::test_some[plain]", False, False),
        (f"{SMOKE}::test_it", True, False),
    ],
)
def test_what_is_in_real_time_or_listed_is_long_but_for_the_smoke(
    monkeypatch: pytest.MonkeyPatch, name: str, real_time: bool, long: bool
) -> None:
    monkeypatch.setitem(LONG_TESTS, "a.py", dict.fromkeys(("test_whole", "TestAll", "test_some[raw]"), ""))
    file, _, test = name.partition("::")

    assert is_long(TESTS / file, test, real_time=real_time) is long


def test_of_many_cases_the_first_are_not_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(FIRST_CASES, "a.py", {"test_many": 2, "TestAll::test_many": 1})

    def long(test: str) -> list[bool]:
        return [is_long(TESTS / "a.py", test, place=place, real_time=False) for place in range(3)]

    assert long("test_many[case]") == [False, False, True]
    assert long("TestAll::test_many[case]") == [False, True, True]
    assert long("test_other[case]") == [False, False, False]


@pytest.mark.parametrize(
    ("test", "long"), [("test_it[memory]", False), ("test_it[zenoh-True]", False), ("test_it[group-True]", True)]
)
def test_the_contract_of_buses_is_long_on_all_but_memory_and_sockets(test: str, *, long: bool) -> None:
    path = TESTS / "bus" / "test_contract.py"

    assert is_long(path, test, real_time=False, each_bus=True) is long
    assert not is_long(path, test, real_time=False)


@pytest.mark.parametrize(
    ("name", "may"),
    [
        ("bus/test_cuts.py", True),
        ("bus/test_contract.py", True),
        ("bus/test_order.py", False),
        ("control/test_composed.py", True),
        ("lab", True),
    ],
)
def test_for_the_long_share_only_files_are_loaded_that_may_have_some_of_it(name: str, may: bool) -> None:
    assert may_have_long(TESTS / name) is may


def test_what_the_long_share_names_is_there_and_has_a_reason() -> None:
    named = {**LONG, **SHORT_PROCESSES}
    tests = [(file, test) for share in (LONG_TESTS, FIRST_CASES) for file, named in share.items() for test in named]

    assert [name for name in (*named, *LONG_TESTS, *FIRST_CASES) if not (TESTS / name).exists()] == []
    assert [each for file, each in tests if not re.search(rf" {each.partition('[')[0]}[(:]", _text(file))] == []
    assert all(named.values())
    assert all(all(each.values()) for share in (LONG_TESTS, FIRST_CASES) for each in share.values())


def _text(file: str) -> str:
    return (TESTS / file).read_text("utf-8")


CONFTEST = """\
import pytest
from tests import long_share

@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    for item in items:
        if item.get_closest_marker("real_time"):
            item.add_marker("long")

def pytest_configure(config):
    for mark in ("real_time", "long"):
        config.addinivalue_line("markers", mark)
    long_share.TESTS = config.rootpath
    config.pluginmanager.register(long_share.Left(config))
    config.pluginmanager.register(long_share.Started())
"""
STARTS = "import pytest, subprocess, sys\n{}def test_it(): subprocess.run([sys.executable, '-c', ''], check=True)\n"


def pytest_in(folder: Path, *arguments: str) -> tuple[int, str]:
    done = subprocess.run(
        (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments), cwd=folder, text=True,
        capture_output=True, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout


@pytest.mark.parametrize("workers", [("-n", "0"), ("-n", "2")], ids=["alone", "on workers"])
def test_a_process_that_nobody_has_marked_is_red_and_what_is_left_out_is_told(tmp_path: Path, workers) -> None:
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_marked.py").write_text(STARTS.format("@pytest.mark.real_time\n"))
    (tmp_path / "test_plain.py").write_text("def test_it(): pass\n")

    assert pytest_in(tmp_path, *workers)[0] == 0
    short, told = pytest_in(tmp_path, *workers, "-m", "not long")
    (tmp_path / "test_plain.py").write_text(STARTS.format(""))
    unmarked, reason = pytest_in(tmp_path, *workers, "-m", "not long")

    assert (short, unmarked) == (0, 1)
    assert "1 tests are left to `make test-all`" in told
    assert "it starts a process: mark it `real_time`" in reason


def test_the_files_that_begin_first_are_there_each_once() -> None:
    assert [name for name in LONGEST if not (ROOT / "tests" / name).is_file()] == []
    assert len(set(LONGEST)) == len(LONGEST)
