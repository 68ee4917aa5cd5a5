"""A skip that `skips.toml` does not expect makes the run red, wherever it happens."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.long_share import may_have_long
from tests.skips import DESK, LISTED, amiss, listed

ROOT = Path(__file__).parents[1]
EXPECTED = {"there is no browser": {DESK: 2}, "needs root(, .*)?": {DESK: 3, "weekly": 3}, "no voice": {"most": 4}}
CONFTEST = """\
from pathlib import Path
from tests.skips import Skips

def pytest_configure(config):
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Skips(Path("skips.toml")))
"""
FEW = 'platforms = ["desk", "ci"]\n[[skip]]\nreason = "no cat"\ndesk = 1\n'


@pytest.mark.parametrize(
    ("where", "whole", "skipped", "words"),
    [
        (DESK, True, [], []),
        (DESK, True, ["there is no browser"] * 2, []),
        (DESK, True, ["there is no browser"] * 3, ["3 skipped, of which tests/skips.toml expects 2 on `desk`"]),
        (DESK, False, ["there is no browser"] * 3, ["3 skipped, of which tests/skips.toml expects 2 on `desk`"]),
        ("weekly", False, ["there is no browser"], ["1 skipped, of which tests/skips.toml expects 0 on `weekly`"]),
        ("weekly", True, ["needs root", "needs root, and more", "needs root"], []),
        ("weekly", True, ["needs root"], ["only 1 skipped, tests/skips.toml still has 3 for `weekly`"]),
        ("weekly", False, ["needs root"], []),
        ("ci", True, ["no voice"], []),
        ("ci", True, ["no voice"] * 5, ["5 skipped, of which tests/skips.toml expects 4 on `ci`"]),
        ("ci", True, ["needs root"], ["1 skipped, of which tests/skips.toml expects 0 on `ci`"]),
        (DESK, False, ["no time"], ["1 skipped, which tests/skips.toml does not expect anywhere: no time"]),
    ],
)
def test_what_is_amiss_is_told_with_its_number_and_reason(where: str, whole: bool, skipped, words) -> None:
    told = list(amiss(skipped, EXPECTED, where, whole=whole))

    assert [re.split(": (?:needs|there|no voice)", line)[0] for line in told] == words


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('platforms = ["desk"]\n[[skip]]\nreason = "a"\nhome = 1\n', "'a': home is none of desk"),
        ('platforms = ["desk"]\n' + 2 * '[[skip]]\nreason = "a"\ndesk = 1\n', "'a' is listed twice"),
    ],
)
def test_a_list_that_is_wrong_is_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        listed(text)


def test_what_is_listed_is_expected_at_a_desk_too() -> None:
    assert [reason for reason, numbers in listed(LISTED.read_text()).items() if not {DESK, "most"} & {*numbers}] == []


def pytest_in(folder: Path, *arguments: str, **environment: str) -> tuple[int, str]:
    done = subprocess.run(
        (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments), cwd=folder, text=True,
        capture_output=True, env={**os.environ, "PYTHONPATH": str(ROOT), **environment}, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A suite of one test that passes, with this conftest, and a list on which "no cat" stands once, for a desk."""
    (tmp_path / "pytest.ini").write_text("[pytest]\ntestpaths = .\n")
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "skips.toml").write_text(FEW)
    (tmp_path / "test_one.py").write_text("def test_one(): pass\n")
    return tmp_path


SKIPS = {
    "a mark": 'import pytest\n@pytest.mark.skipif(True, reason="{}")\ndef test_two(): pass\n',
    "a fixture": 'import pytest\n@pytest.fixture\ndef it(): pytest.skip("{}")\ndef test_two(it): pass\n',
    "its body": 'import pytest\ndef test_two(): pytest.skip("{}")\n',
    "a whole file": 'import pytest\npytest.importorskip("nothing_of_that_name", reason="{}")\n',
}


@pytest.mark.parametrize("workers", [("-n", "0"), ("-n", "2")], ids=["alone", "on workers"])
@pytest.mark.parametrize("how", SKIPS)
def test_a_run_with_a_skip_that_is_not_listed_is_red_however_it_skips(folder: Path, how: str, workers) -> None:
    (folder / "test_two.py").write_text(SKIPS[how].format("no dog"))

    code, told = pytest_in(folder, *workers)

    assert code == 1
    assert "SKIPS: 1 skipped, which tests/skips.toml does not expect anywhere: no dog" in told


def test_a_run_with_a_skip_that_is_listed_for_its_platform_is_green_and_elsewhere_red(folder: Path) -> None:
    (folder / "test_two.py").write_text(SKIPS["a mark"].format("no cat"))

    assert [pytest_in(folder, ENGAGE_PLATFORM=platform)[0] for platform in (DESK, "ci")] == [0, 1]


def test_a_skip_that_no_longer_happens_makes_the_whole_run_red_but_no_part_of_it(folder: Path) -> None:
    (folder / "skips.toml").write_text(FEW.replace("desk = 1", "desk = 1\nci = 1"))

    code, told = pytest_in(folder, ENGAGE_PLATFORM="ci")
    parts = [pytest_in(folder, part, ENGAGE_PLATFORM="ci")[0] for part in ("test_one.py", "-kone")]

    assert (code, parts) == (1, [0, 0])
    assert "SKIPS: only 0 skipped, tests/skips.toml still has 1 for `ci`: no cat" in told


def test_a_machine_of_ci_without_chromium_is_red(tmp_path: Path) -> None:
    code, told = pytest_in(ROOT, "tests/console/test_page.py", PATH=str(tmp_path), ENGAGE_PLATFORM="ci")

    assert code == 1
    assert "expects 0 on `ci`: there is no Chromium on this machine" in told


def test_what_is_always_skipped_in_ci_is_in_a_file_that_its_second_run_loads() -> None:
    """`.ci/run` asks for the long share alone, and files without a long test are not loaded then."""
    always = re.compile("|".join(reason for reason, numbers in listed(LISTED.read_text()).items() if "ci" in numbers))
    reason = re.compile(r'(?:reason=|skip\(|skipif\(.*)f?"(.*?)"')
    files = {path: reason.findall(path.read_text("utf-8")) for path in LISTED.parent.rglob("test_*.py")}
    found = [path for path, told in files.items() if any(map(always.fullmatch, told))]

    assert found
    assert [path.name for path in found if not may_have_long(path)] == []
