"""Pictures of scenes: what is on them, and that they are files that others open."""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engage_hri.services.recording.drawing import pictures, sheet, times_of_film, write_film
from engage_hri.services.recording.reading import Recording
from engage_hri.services.recording.scenes import scenes, spread


def test_scenes_show_who_looks_where_and_what_is_said(task: Recording) -> None:
    found = list(scenes(task, [0.0, 3.0, 8.0]))

    assert found[0].at == 0.0
    assert ("human", "look") in found[1].doing
    assert found[2].world is not None
    assert found[2].world.entity("human") is not None
    assert [scene.at for scene in found] == [0.0, 3.0, 8.0]


def test_a_sheet_and_films_are_pictures_that_change(task: Recording, tmp_path: Path) -> None:
    chosen = list(scenes(task, spread(task.duration, 6)))

    with Image.open(io.BytesIO(sheet(chosen))) as image:
        assert image.format == "PNG"
        assert image.size[0] > image.size[1]
    drawn = pictures(chosen)
    assert {picture.shape for picture in drawn} == {(400, 480, 3)}
    assert len({picture.tobytes() for picture in drawn}) == len(drawn)
    assert all(np.ptp(picture) > 200 for picture in drawn)

    write_film(tmp_path / "a.gif", chosen, 5.0)
    with Image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == 6  # type: ignore[attr-defined]


def test_a_film_is_mp4_where_there_is_ffmpeg(task: Recording, tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    write_film(tmp_path / "a.mp4", list(scenes(task, [1.0, 2.0, 3.0, 4.0, 5.0])), 5.0)

    frames = ffmpeg.read_frames(str(tmp_path / "a.mp4"))
    facts = next(frames)
    frames.close()
    assert facts["source_size"] == (480, 400)
    assert facts["fps"] == 5.0


def test_times_of_a_film_follow_its_rate_and_speed() -> None:
    assert times_of_film(1.0, 4.0, 1.0) == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert times_of_film(10.0, 1.0, 5.0) == [0.0, 5.0, 10.0]
    assert times_of_film(10.0, 1.0, 1.0, until=2.0) == [0.0, 1.0, 2.0]
    assert spread(8.0, 4) == [1.0, 3.0, 5.0, 7.0]
