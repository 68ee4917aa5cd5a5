"""How many random cases are tried, and which files begin first."""

import subprocess
from pathlib import Path

import pytest
from hypothesis import settings

from tests.longest import LONGEST
from tests.random_cases import share_of, trials

ROOT = Path(__file__).parents[1]


@pytest.fixture(params=["same", "long", "search"])
def profile(request: pytest.FixtureRequest):
    before = settings.get_current_profile_name()
    settings.load_profile(request.param)
    yield request.param
    settings.load_profile(before)


def test_a_third_is_tried_but_at_least_one_unless_all_are_asked_for(profile: str) -> None:
    told = [share_of(whole) for whole in (1, 3, 4, 300)]

    assert told == ([1, 1, 2, 100] if profile == "same" else [1, 3, 4, 300])
    assert trials() == (1 if profile == "same" else None)


@pytest.mark.parametrize(("goal", "name"), [("test", "same"), ("test-long", "long")])
def test_make_asks_for_a_share_or_for_all(goal: str, name: str) -> None:
    told = subprocess.run(["make", "-n", goal], cwd=ROOT, capture_output=True, text=True, check=True).stdout

    assert [word for word in told.split() if "profile" in word] == [f"--hypothesis-profile={name}"]


def test_the_files_that_begin_first_are_there_each_once() -> None:
    assert [name for name in LONGEST if not (ROOT / "tests" / name).is_file()] == []
    assert len(set(LONGEST)) == len(LONGEST)
