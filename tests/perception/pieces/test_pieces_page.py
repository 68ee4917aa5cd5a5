"""docs/pieces.md: what it shows is right. No camera is here, so its commands are read, and not run."""

import re
import shlex
from itertools import pairwise
from pathlib import Path
from typing import get_args, get_type_hints

from engage_hri.services.commandline.bodies.calibrate import Options
from engage_hri.services.commandline.shell.roster import group
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.perception.pieces.colors import task_table
from engage_hri.services.perception.pieces.config import PiecesConfig
from engage_hri.services.runtime.configuration import read
from tests.perception.pieces.tables import TABLE

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "pieces.md").read_text(encoding="utf-8")


def shown(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


def test_its_commands_have_settings_that_there_are():
    lines = [line for block in shown("sh") for line in block.strip().splitlines()]
    calibrated = get_args(get_type_hints(Options)["what"])
    for line in lines:
        program, command, what, *words = shlex.split(line)
        assert program in (".venv/bin/engage", ".venv/bin/python")
        if command == "run":
            assert group(what) == ("pieces",)
        elif command == "calibrate":
            assert what in calibrated
        settings = [value for option, value in pairwise(words) if option == "--set"]
        pieces = read(RobotConfig, settings=settings).pieces
        assert (pieces.place, pieces.tilt, pieces.field_of_view) == ((0.05, 0.0, 1.17), -38, 70)
    for setting in re.findall(r"`pieces\.(\w+)", PAGE):
        assert setting in PiecesConfig.__struct_fields__


def test_its_task_is_one(tmp_path: Path):
    [file] = shown("toml")
    path = tmp_path / "task.toml"
    path.write_text(file)
    table = task_table(str(path))

    [piece] = table.pieces
    assert (table.surface.footprint, table.thickness) == (TABLE.surface.footprint, TABLE.thickness)
    assert piece.footprint == TABLE.piece("blue-square").footprint
    assert piece.start == TABLE.piece("blue-square").start


def test_its_source_is_one():
    [code] = shown("python")
    names: dict[str, type] = {}
    exec(code, names)
    source = names["TableWithSensors"](None)

    assert [[piece.id for piece in told.pieces] for told in source.look()] == [["blue-square"]] * 10
