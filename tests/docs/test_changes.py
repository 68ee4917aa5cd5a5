"""The files of docs/changes: `towncrier` makes the next section of the changelog of them."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def draft(root: Path) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "towncrier", "build", "--draft", "--version", "9.9.9", "--date", "2000-01-01"]
    return subprocess.run([*command, "--dir", root], capture_output=True, text=True, check=False)


def test_what_is_there_makes_a_page() -> None:
    drafted = draft(ROOT)

    assert drafted.returncode == 0, drafted.stderr
    assert drafted.stdout.startswith("## 9.9.9, 2000-01-01\n")


def test_breaking_changes_come_first_and_an_unknown_kind_is_named(tmp_path: Path) -> None:
    changes = tmp_path / "docs" / "changes"
    changes.mkdir(parents=True)
    (tmp_path / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text())
    (changes / "12.new").write_text("Robots can sing.\n")
    (changes / "+names.breaking").write_text("A key is called otherwise.\n")

    page = draft(tmp_path).stdout
    (changes / "13.nice").write_text("A kind that there is not.\n")
    refused = draft(tmp_path)

    assert "### Breaking\n\n- A key is called otherwise.\n\n### New\n\n- Robots can sing. (#12)\n" in page
    assert (refused.returncode, "13.nice" in refused.stdout + refused.stderr) == (1, True)


def test_a_release_adds_a_section_above_the_last(tmp_path: Path) -> None:
    changes = tmp_path / "docs" / "changes"
    changes.mkdir(parents=True)
    (tmp_path / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text())
    before = (ROOT / "CHANGELOG.md").read_text()
    (tmp_path / "CHANGELOG.md").write_text(before)
    (changes / "12.new").write_text("Robots can sing.\n")
    command = [sys.executable, "-m", "towncrier", "build", "--keep", "--version", "9.9.9", "--dir", tmp_path]

    subprocess.run(command, capture_output=True, check=True)

    titles = [line for line in (tmp_path / "CHANGELOG.md").read_text().splitlines() if line.startswith("## ")]
    assert titles[0].startswith("## 9.9.9, ")
    assert titles[1:] == [line for line in before.splitlines() if line.startswith("## ")]
