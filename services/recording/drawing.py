"""Pictures of scenes from above: a sheet of them (PNG, PDF or SVG), or a film (GIF, and MP4 where there is ffmpeg).

Needs matplotlib, the extra `study`; imported only when pictures are wanted. No pyplot, so no state.
"""

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from engage_hri.schemas.body import Ray
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity
from engage_hri.services.recording.above import PictureEdges, frame, outline, seen, together
from engage_hri.services.recording.scenes import SceneSnapshot

if TYPE_CHECKING:
    from numpy.typing import NDArray

ROBOT, PERSON, GAZE, POINT = "#0072B2", "#D55E00", "#56B4E9", "#CC79A7"
"""Colors that color-blind people can tell apart (Okabe and Ito)."""
REACH = 0.9
"""Metres that a ray is drawn if it meets nothing."""
COLUMNS = 4


def sheet(scenes: Sequence[SceneSnapshot], format: str = "png") -> bytes:
    """Draw scenes beside one another, with the times and what is said."""
    rows = math.ceil(len(scenes) / COLUMNS)
    figure, in_view = Figure(figsize=(3.6 * COLUMNS, 4.4 * rows), layout="constrained"), _frame(scenes)
    axes = figure.subplots(rows, COLUMNS, squeeze=False)
    for number, place in enumerate(axes.flat):
        if number < len(scenes):
            draw(place, scenes[number], in_view)
        else:
            place.set_axis_off()
    file = io.BytesIO()
    figure.savefig(file, format=format, dpi=80)
    return file.getvalue()


def pictures(scenes: Sequence[SceneSnapshot]) -> list["NDArray[np.uint8]"]:
    """Draw each scene as an array of 560 x 400 x 3 (height, width, colors), 0..255."""
    figure = Figure(figsize=(4.0, 5.6), dpi=100)
    canvas, in_view = FigureCanvasAgg(figure), _frame(scenes)
    drawn = []
    for scene in scenes:
        figure.clear()
        draw(figure.add_axes((0.02, 0.02, 0.96, 0.86)), scene, in_view)
        canvas.draw()  # type: ignore[no-untyped-call]
        seen = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        drawn.append(seen[:, :, :3].copy())
    return drawn


def _frame(scenes: Sequence[SceneSnapshot]) -> PictureEdges:
    """Frame of all of these scenes, so that it stands still from one to the next."""
    return together(
        frame(scene.world.entities, [each.position for each in scene.world.people]) for scene in scenes if scene.world
    )


def draw(axes: Axes, scene: SceneSnapshot, in_view: PictureEdges) -> None:
    """Draw a scene from above, as the map of the window has it. in_view: what is in the picture."""
    axes.set_xlim(in_view.left, in_view.right)
    axes.set_ylim(in_view.bottom, in_view.top)
    axes.set_aspect("equal")
    axes.set_axis_off()
    for entity in scene.world.entities if scene.world else ():
        _entity(axes, entity)
    if scene.body is not None:
        _ray(axes, scene, scene.body.gaze, scene.body.looking_at, GAZE)
        for target in scene.doing.get((scene.robot, "point"), ())[:1]:
            _ray(axes, scene, _pointing(scene, target), target, POINT)
    axes.add_patch(Circle(seen(*_face(scene)), 0.09, color=ROBOT, zorder=3))
    for (actor, action), targets in scene.doing.items():
        if actor != scene.robot and action in ("look", "point") and targets:
            start, end = _place(scene, actor), _place(scene, targets[0])
            if start is not None and end is not None:
                color = GAZE if action == "look" else POINT
                _line(axes, start, end, color=color, linewidth=1.5, linestyle="--")
    marks = [f"{actor} {action}s" for actor, action in scene.doing if action in ("speak", "nod", "shake")]
    lines = [f"{int(scene.at) // 60}:{scene.at % 60:04.1f}  {', '.join(marks)}"]
    if scene.caption:
        lines.append(f"“{_short(scene.caption)}”")
    if scene.events:
        lines.append(", ".join(f"{one.kind.replace('_', ' ')} {one.state}" for one in scene.events[-2:]))
    axes.set_title("\n".join(lines), fontsize=7, loc="left", parse_math=False)


def _entity(axes: Axes, entity: Entity) -> None:
    place = seen(*entity.position[:2])
    if entity.kind == "person":
        axes.add_patch(Circle(place, 0.09, color=PERSON, zorder=3))
        axes.annotate(
            entity.id, place, ha="center", va="center", fontsize=6, color="white", zorder=4, parse_math=False
        )
        return
    if entity.kind == "hand":
        axes.add_patch(Circle(place, 0.03, color=PERSON, alpha=0.6, zorder=3))
        return
    color = entity.color if entity.color in _NAMED else "0.6"
    look = {"facecolor": "0.93", "edgecolor": "0.7", "zorder": 0} if entity.kind == "surface" else {
        "facecolor": color, "edgecolor": "black", "alpha": 0.8, "zorder": 1,
    }  # fmt: skip
    if entity.footprint:
        axes.add_patch(Polygon([seen(*corner) for corner in outline(entity)], closed=True, **look))
    else:
        axes.add_patch(Circle(place, entity.radius or 0.03, **look))


_NAMED = ("red", "green", "blue", "yellow", "orange", "purple", "pink", "brown", "black", "white", "gray", "grey")


def _pointing(scene: SceneSnapshot, target: str) -> Ray | None:
    """The forearm that points at the target: the one in whose direction it lies best, from the hand on."""
    place = scene.world.entity(target) if scene.world else None
    arms = (scene.body.left_arm, scene.body.right_arm) if scene.body else ()
    hands = [Ray(origin=arm.tip, axis=arm.axis) for arm in arms if arm is not None and arm.tip is not None]
    if place is None or not hands:
        return None

    def cosine(ray: Ray) -> float:
        way = [to - start for to, start in zip(place.position, ray.origin, strict=True)]
        return sum(one * other for one, other in zip(way, ray.axis, strict=True)) / (math.hypot(*way) or 1.0)

    return max(hands, key=cosine)


def _ray(axes: Axes, scene: SceneSnapshot, ray: Ray | None, target: str, color: str) -> None:
    if ray is None:
        return
    start, end = ray.origin, _place(scene, target)
    length = REACH if end is None else max(0.05, math.hypot(end[0] - start[0], end[1] - start[1]))
    flat = math.hypot(ray.axis[0], ray.axis[1]) or 1.0
    x, y = start[0] + ray.axis[0] / flat * length, start[1] + ray.axis[1] / flat * length
    _line(axes, (start[0], start[1]), (x, y), color=color, linewidth=2.0)


def _line(axes: Axes, start: tuple[float, float], end: tuple[float, float], **look: Any) -> None:
    axes.plot(*zip(seen(*start), seen(*end), strict=True), zorder=2, **look)


def _face(scene: SceneSnapshot) -> tuple[float, float]:
    """Place of the robot's face, where its looks begin."""
    gaze = scene.body.gaze if scene.body is not None else None
    return (0.0, 0.0) if gaze is None else (gaze.origin[0], gaze.origin[1])


def _place(scene: SceneSnapshot, id: str) -> tuple[float, float] | None:
    if id == scene.robot:
        return _face(scene)
    found = scene.world.entity(id) if scene.world and id else None
    return None if found is None else (found.position[0], found.position[1])


def _short(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."


def write_film(path: Path, scenes: Sequence[SceneSnapshot], rate: float) -> None:
    """Write a film. path: `.gif`, or `.mp4`, which needs ffmpeg. Raises ImportError: no Pillow, or no ffmpeg."""
    drawn = pictures(scenes)
    if path.suffix == ".mp4":
        import imageio_ffmpeg

        height, width, _ = drawn[0].shape
        writer = imageio_ffmpeg.write_frames(str(path), (width, height), fps=rate, macro_block_size=2)
        writer.send(None)
        for picture in drawn:
            writer.send(np.ascontiguousarray(picture))
        writer.close()
        return
    from PIL import Image

    images = [Image.fromarray(picture) for picture in drawn]
    images[0].save(path, save_all=True, append_images=images[1:], duration=round(1000 / rate), loop=0)


def times_of_film(duration: Seconds, rate: float, speed: float, until: Seconds | None = None) -> list[Seconds]:
    """Times of the pictures of a film, `rate` a second, so many times as fast as it was."""
    end = duration if until is None else min(until, duration)
    return [number * speed / rate for number in range(int(end * rate / speed) + 1)]
