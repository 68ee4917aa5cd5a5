"""Files that the pages name are there, under the name that they say."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
NAME = re.compile(r"`([\w/]+\.(?:py|toml))`")
THEIRS = {
    "FILE.py",
    "engage.toml",
    "mine.py",
    "mine.toml",
    "calibration.toml",
    "colors.toml",
    "eyes.toml",
    "pieces.toml",
    "poor.toml",
    "my_robot.py",
    "my_voice.py",
    "pan_tilt.py",
    "pan_tilt_sdk.py",
    "reachy.py",
    "services/recognition/events/shared_laughter.py",
}
"""Files of whoever reads."""


@pytest.fixture(scope="module")
def files() -> list[str]:
    folders = ("schemas", "services", "engage_hri", "tests", "docs", "examples", "benchmarks")
    found = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".toml")]
    return ["/" + str(path.relative_to(ROOT)) for path in (*found, ROOT / "pyproject.toml")]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_file_that_a_page_names_is_there(page: Path, files: list[str]) -> None:
    named = set(NAME.findall(page.read_text(encoding="utf-8"))) - THEIRS

    missing = sorted(name for name in named if not any(path.endswith(f"/{name}") for path in files))
    assert not missing
