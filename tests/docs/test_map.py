"""The map of the tests, tests/README.md: every file that it names is there, and nothing is missing on it."""

import re
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
MAP = (TESTS / "README.md").read_text(encoding="utf-8")
NAMED = set(re.findall(r"`((?:[\w-]+/)*[\w.-]+\.(?:py|toml|rng)|[\w-]+/)`", MAP))


def section(title: str) -> str:
    return MAP.partition(f"\n## {title}\n")[2].partition("\n## ")[0]


def test_what_the_map_names_is_there() -> None:
    assert len(NAMED) > 80
    assert sorted(name for name in NAMED if not (TESTS / name).exists()) == []


def test_every_folder_and_every_file_of_no_folder_is_on_it() -> None:
    folders = {f"{path.parent.relative_to(TESTS)}/" for path in TESTS.glob("*/test_*.py")}
    files = {path.name for path in TESTS.glob("*.py") if path.name != "__init__.py"}

    assert sorted(folders - set(re.findall(r"^\| `(\w+/)` \|", section("By folder"), re.MULTILINE))) == []
    assert sorted(files - NAMED) == []


@pytest.mark.parametrize("mark", ["real_time", "each_bus"])
def test_every_file_with_real_wires_is_on_it(mark: str) -> None:
    marked = {
        str(path.relative_to(TESTS))
        for path in TESTS.glob("*/test_*.py")
        if re.search(rf"(@|= )pytest\.mark\.{mark}\b", path.read_text(encoding="utf-8"))
    }
    rows = "".join(row for row in section("Which time, which wires").splitlines(True) if f"`{mark}`" in row)

    assert marked
    assert sorted(name for name in marked if f"`{name}`" not in rows) == []


def test_every_oracle_that_is_a_file_is_on_it() -> None:
    oracles = {path for path in TESTS.rglob("*.py") if re.search(r"oracle|recomputed|_table$", path.stem)}
    named = {str(path.relative_to(TESTS)) for path in oracles if not path.stem.startswith("test_")}

    assert named
    assert sorted(name for name in named if name not in section("Oracles")) == []
