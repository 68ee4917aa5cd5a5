"""`engage calibrate eyes`, `pieces` and `colors`, by films that were drawn with a known truth."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.perception.eyes.placing import FLAT, UPRIGHT
from engage_hri.services.perception.pieces.colors import read_palette
from engage_hri.services.runtime.configuration import read
from tests.cli.command import engage
from tests.perception.eyes.drawing import Picture
from tests.perception.eyes.test_placing import shown
from tests.perception.pieces.tables import EYE, PAINT, STARTS, TABLE, WOOD, drawn

AIM = ("--set", "pieces.place=[0.05, 0.0, 1.17]", "--set", "pieces.tilt=-38")


def film(folder: Path, pictures: list[Picture]) -> str:
    folder.mkdir()
    for number, picture in enumerate(pictures):
        cv2.imwrite(str(folder / f"{number:02}.png"), picture[:, :, ::-1])
    return f"film:{folder}"


def test_a_camera_is_placed_and_its_settings_are_read(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    eye, rng, out = EYE._replace(down=35, left=4, lean=-2, field=66), np.random.default_rng(3), tmp_path / "it.toml"
    pictures = []
    for seed in range(9):
        slant = cv2.Rodrigues(rng.uniform(-0.6, 0.6, 3))[0]
        level = cv2.Rodrigues(np.array([0.0, math.radians(35), 0.0]))[0]
        ahead = np.array([math.cos(math.radians(35)), 0.0, -math.sin(math.radians(35))])
        middle = eye.at + ahead * rng.uniform(0.45, 0.8) + rng.normal(0, 0.04, 3)
        pictures.append(shown(eye, middle, level @ UPRIGHT @ slant, seed))
    pictures += [shown(eye, np.array([0.6, 0.0, 0.72]), FLAT, seed) for seed in range(20, 26)]
    path = film(tmp_path / "film", pictures)

    told = engage(capsys)(
        "calibrate", "pieces", "--from", path, "--at", "0.6", "0.0", "0.72", "--out", str(out)
    )  # fmt: skip

    assert told.code == 0, told.err
    found = read(RobotConfig, out).pieces
    assert found.field_of_view == pytest.approx(66, abs=0.5)
    assert found.place == pytest.approx(eye.at, abs=0.01)
    assert (found.tilt, found.pan, found.roll) == pytest.approx((-35, 4, -2), abs=0.5)
    assert "pixels beside" in told.out


def test_the_sheet_is_written(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    told = engage(capsys)("calibrate", "eyes", "--sheet", str(tmp_path / "sheet.svg"))

    assert told.code == 0
    assert (tmp_path / "sheet.svg").read_text().startswith("<svg")


def test_colors_are_learned_and_a_piece_that_is_not_there_is_told(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    out = tmp_path / "colors.toml"
    whole = film(tmp_path / "whole", [drawn(STARTS, seed=3)])
    lacks = film(tmp_path / "lacks", [drawn({id: at for id, at in STARTS.items() if id != "red-square"}, seed=3)])

    told = engage(capsys)("calibrate", "colors", "--from", whole, "--out", str(out), *AIM)
    palette = read_palette(str(out), TABLE)
    refused = engage(capsys)("calibrate", "colors", "--from", lacks, "--out", str(out), *AIM)

    assert told.code == 0, told.err
    lit = np.divide(palette["table"], WOOD)  # warm light: there is an eighth less blue in all of it
    for color, paint in PAINT.items():
        assert palette[color] == pytest.approx(paint * lit, rel=0.08, abs=2), color
    assert (refused.code, "not seen where they begin: red-square" in refused.err) == (3, True)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("eyes",), "it is not said where the sheet lies"),
        (("eyes", "--at", "0.6", "0", "0.7", "--from", "page"), "no pictures from 'page'"),
        (("pieces", "--seat", "--at", "1.2", "0", "1.2"), "--seat is for eyes"),
        (("pieces", "--at", "0.6", "0", "0.7", "--from", "film:nowhere"), "there is no such file"),
    ],
)
def test_what_cannot_be_measured_is_said(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...], reason: str, tmp_path: Path
):
    told = engage(capsys)("calibrate", *words, "--out", str(tmp_path / "out.toml"))

    assert told.code == 2
    assert reason in told.err


def test_an_empty_film_shows_no_sheet(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    path = film(tmp_path / "film", [drawn({}, seed=1)])
    told = engage(capsys)(
        "calibrate", "eyes", "--from", path, "--at", "0.6", "0", "0.7", "--out", str(tmp_path / "out.toml")
    )  # fmt: skip

    assert (told.code, "no sheet was seen" in told.err) == (3, True)
