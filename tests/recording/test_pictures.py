"""Pictures of scenes: what is on them, and that they are files that others open."""

import io
import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from msgspec.structs import replace
from PIL import Image

from engage_hri.schemas.world import Entity
from engage_hri.services.console.view import empty
from engage_hri.services.console.web.scene import section as scene_section
from engage_hri.services.recording.above import LEAST, frame, seen, together
from engage_hri.services.recording.drawing import (
    PERSON,
    POINT,
    ROBOT,
    draw,
    pictures,
    sheet,
    times_of_film,
    write_film,
)
from engage_hri.services.recording.reading import Recording
from engage_hri.services.recording.scenes import scenes, spread


def test_scenes_show_who_looks_where_and_what_is_said(task: Recording) -> None:
    found = list(scenes(task, [0.0, 3.0, 8.0]))

    assert found[0].at == 0.0
    assert ("human", "look") in found[1].doing
    assert found[2].world is not None
    assert found[2].world.entity("human") is not None
    assert [scene.at for scene in found] == [0.0, 3.0, 8.0]


def test_pictures_have_the_robot_at_the_top_and_its_left_on_the_right_as_the_map_of_the_window(
    task: Recording,
) -> None:
    (scene,) = scenes(task, [3.0])
    assert scene.world is not None
    axes = Figure().add_subplot()
    draw(axes, scene, LEAST)
    places = {each.get_facecolor(): axes.transData.transform(each.center) for each in axes.patches if _is_head(each)}
    robot, person = places[to_rgba(ROBOT)], places[to_rgba(PERSON)]
    assert robot[1] > person[1] + 50  # pixels, from the bottom up

    section = scene_section(empty(scene.robot, 0.0), scene.world, scene.body, None)
    polygons = [each.get_xy()[:-1] for each in axes.patches if isinstance(each, Polygon)]
    in_map = [
        [(_along(section.above.right, corner), _along(section.above.down, corner)) for corner in thing.outline]
        for thing in section.things
        if thing.outline
    ]
    assert len(polygons) == len(in_map) > 5
    for drawn, shown in zip(polygons, in_map, strict=True):
        assert np.asarray(drawn) == pytest.approx(np.asarray(shown), abs=1e-3)
    pixels = axes.transData.transform([(0.0, 0.0), (0.1, 0.0), (0.0, 0.1)])
    assert pixels[1][0] > pixels[0][0]
    assert pixels[2][1] < pixels[0][1]


def test_the_frame_has_everybody_in_it_and_moves_in_steps() -> None:
    assert frame([], []) == LEAST
    beside = frame([], [(1.2, 0.6, 1.2), (1.2, 0.0, 1.2)])
    assert beside == pytest.approx((-0.62, -0.27, 0.9, 1.5))
    assert frame([], [(1.2, 0.59, 1.2)]) == frame([], [(1.2, 0.56, 1.2)])
    wide = Entity(id="wall", kind="surface", position=(2.0, -1.0, 0.7), footprint=((-0.1, -0.1), (0.1, 0.1)))
    assert together([beside, frame([wide], [])]) == pytest.approx((-1.1, -0.27, 0.9, 2.1))


def _is_head(patch: object) -> bool:
    return isinstance(patch, Circle) and patch.radius == 0.09


def _along(axis: tuple[float, float], place: tuple[float, float]) -> float:
    return axis[0] * place[0] + axis[1] * place[1]


def test_a_sheet_and_films_are_pictures_that_change(task: Recording, tmp_path: Path) -> None:
    chosen = list(scenes(task, spread(task.duration, 6)))

    with Image.open(io.BytesIO(sheet(chosen))) as image:
        assert image.format == "PNG"
        assert image.size[0] > image.size[1]
    drawn = pictures(chosen)
    assert {picture.shape for picture in drawn} == {(560, 400, 3)}
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
    assert facts["source_size"] == (400, 560)
    assert facts["fps"] == 5.0


def test_times_of_a_film_follow_its_rate_and_speed() -> None:
    assert times_of_film(1.0, 4.0, 1.0) == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert times_of_film(10.0, 1.0, 5.0) == [0.0, 5.0, 10.0]
    assert times_of_film(10.0, 1.0, 1.0, until=2.0) == [0.0, 1.0, 2.0]
    assert spread(8.0, 4) == [1.0, 3.0, 5.0, 7.0]


def test_a_robot_that_points_is_drawn_with_a_line_from_its_hand_to_the_target(task: Recording) -> None:
    seen_pointing = 0
    for scene in scenes(task, [number / 2 for number in range(int(2 * task.duration))]):
        axes = Figure().add_subplot()
        draw(axes, scene, LEAST)
        lines = [each for each in axes.lines if to_rgba(each.get_color()) == to_rgba(POINT) and each.get_ls() == "-"]
        targets = scene.doing.get((scene.robot, "point"), ())[:1]
        assert len(lines) == len(targets)
        for line, target in zip(lines, targets, strict=True):
            assert scene.body is not None
            assert scene.world is not None
            (entity,) = [each for each in scene.world.entities if each.id == target]
            hands = [arm.tip for arm in (scene.body.left_arm, scene.body.right_arm) if arm is not None and arm.tip]
            begin, end = np.asarray(line.get_xydata())
            assert min(math.dist(begin, seen(*hand[:2])) for hand in hands) < 1e-9
            assert math.dist(begin, end) == pytest.approx(math.dist(begin, seen(*entity.position[:2])))
            seen_pointing += math.dist(end, seen(*entity.position[:2])) < 0.1
    assert seen_pointing > 0


def test_a_scene_in_which_no_world_has_been_told_yet_is_drawn_without_things(task: Recording) -> None:
    (scene,) = scenes(task, [3.0])
    bare = replace(scene, world=None, doing={(scene.robot, "point"): ("blue-square",)})
    axes = Figure().add_subplot()

    draw(axes, bare, LEAST)

    assert [each.get_facecolor() for each in axes.patches] == [to_rgba(ROBOT)]
    assert not [each for each in axes.lines if to_rgba(each.get_color()) == to_rgba(POINT)]
