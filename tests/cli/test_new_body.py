"""`engage new-body`: the file that it writes, and what it refuses."""

from pathlib import Path

import pytest

from tests.cli.command import Engage
from tests.test_examples import EXAMPLES


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_it_writes_a_driver_that_keeps_the_contract_and_says_what_is_next(engage: Engage, here: Path) -> None:
    result = engage("new-body")

    assert result.code == 0
    check, up = (line.split() for line in result.out.splitlines() if line.startswith("  engage "))
    assert up == ["engage", "up", "--body", "my_robot.py", "--voice", "silent"]
    checked = engage(*check[1:])
    assert "43 laws hold, none is broken" in checked.out
    assert checked.code == 0


def test_the_example_is_what_it_writes(engage: Engage, here: Path) -> None:
    assert engage("new-body", "--name", "set-point-robot").code == 0

    written, example = (folder / "set_point_robot.py" for folder in (here, EXAMPLES))
    assert written.read_text(encoding="utf-8") == example.read_text(encoding="utf-8")


def test_a_file_that_is_there_stays_as_it_is(engage: Engage, here: Path) -> None:
    (here / "my_robot.py").write_text("precious")

    result = engage("new-body")

    assert result.code == 2
    assert "my_robot.py: the file is there already" in result.err
    assert (here / "my_robot.py").read_text() == "precious"


@pytest.mark.parametrize("name", ["", "My Robot", "../robot", "2d2", "robot-", "a--b"])
def test_a_name_that_is_none_is_refused(engage: Engage, here: Path, name: str) -> None:
    result = engage("new-body", "--name", name)

    assert result.code == 2
    assert "--name" in result.err
    assert not list(here.iterdir())
