"""How many random cases are tried, and which files begin first."""

import subprocess
from pathlib import Path

import pytest
from hypothesis import settings

from tests.long_tests import LONG_FILES, is_long
from tests.longest import LONGEST
from tests.random_cases import share_of, trials

ROOT = Path(__file__).parents[1]


@pytest.fixture(params=["same", "long", "search"])
def profile(request: pytest.FixtureRequest):
    before = settings.get_current_profile_name()
    settings.load_profile(request.param)
    yield request.param
    settings.load_profile(before)


def test_a_sixth_is_tried_but_at_least_one_unless_all_are_asked_for(profile: str) -> None:
    told = [share_of(whole) for whole in (1, 6, 7, 300)]

    assert told == ([1, 1, 2, 50] if profile == "same" else [1, 6, 7, 300])
    assert trials() == (1 if profile == "same" else None)


@pytest.mark.parametrize(("goal", "name"), [("test", "same"), ("test-long", "long")])
def test_make_asks_for_a_share_or_for_all(goal: str, name: str) -> None:
    told = subprocess.run(["make", "-n", goal], cwd=ROOT, capture_output=True, text=True, check=True).stdout

    assert [word for word in told.split() if "profile" in word] == [f"--hypothesis-profile={name}"]


def test_make_leaves_out_what_is_long_and_its_rest_is_all_of_that() -> None:
    told = {
        goal: subprocess.run(["make", "-n", goal], cwd=ROOT, capture_output=True, text=True, check=True).stdout
        for goal in ("test", "test-rest", "test-long")
    }

    assert {goal: '-m "not long"' in text for goal, text in told.items()} == {
        "test": True,
        "test-rest": False,
        "test-long": False,
    }
    assert " -m long" in told["test-rest"]
    assert " -m " not in told["test-long"].replace("-m pip", "")


@pytest.mark.parametrize(
    ("file", "marks", "left_out"),
    [
        ("bus/test_processes.py", {"real_time"}, True),
        ("cli/test_smoke.py", {"real_time", "smoke"}, False),
        ("lab/test_units.py", set(), True),
        ("realizer/test_net.py", set(), False),
        ("test_wheel.py", set(), True),
    ],
)
def test_what_is_in_real_time_or_listed_is_long(file: str, marks: set[str], left_out: bool) -> None:
    assert is_long(file, marks) == left_out


def test_the_list_of_long_files_has_what_is_there_each_with_a_reason() -> None:
    assert [name for name in LONG_FILES if not (ROOT / "tests" / name).exists()] == []
    assert all(len(reason.split()) > 3 for reason in LONG_FILES.values())


def test_the_files_that_begin_first_are_there_each_once() -> None:
    assert [name for name in LONGEST if not (ROOT / "tests" / name).is_file()] == []
    assert len(set(LONGEST)) == len(LONGEST)
