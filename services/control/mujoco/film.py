"""Films of a body: what it looked like while it moved, drawn afterwards. Time is that of its frames.

Drawing a picture takes some tenths of a second without a GPU, so nothing is drawn while the body moves.
"""

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager
from importlib.util import find_spec
from itertools import pairwise
from math import ceil, cos, radians, sin
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from msgspec import Struct

from engage_hri.schemas.body import Ray
from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.units import Degrees, Meters, Seconds, Vector
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import BodyState
from engage_hri.services.control.mujoco.pictures import (
    FROM_ABOVE,
    FROM_THE_SIDE,
    OVER_THE_SHOULDER,
    Beam,
    Camera,
    Cone,
    Picture,
    View,
)  # fmt: skip
from engage_hri.services.control.mujoco.pulse import Pulse
from engage_hri.services.control.mujoco.settings import MujocoSettings
from engage_hri.services.runtime.installation import packages_command

if TYPE_CHECKING:
    from PIL import ImageDraw

RATE = 12.0
"""Pictures a second."""
SEEN = 0.01
"""Share of its way by which a part of the face is moved at least where a new picture shows it: half a millimetre."""
VIEWS = {"side": FROM_THE_SIDE, "shoulder": OVER_THE_SHOULDER, "above": FROM_ABOVE}
FARTHEST: Meters = 1.3
"""Length of a gaze that ends nowhere."""
TABLE_TOP: Meters = 0.72
EYE: Meters = 0.017
"""Half the height of an open eye."""
BROWS, MOUTH = 0.118, 0.035
"""Heights at rest in the frame of the head, metres."""
FORMATS = (".mp4", ".webp", ".gif", ".png")


class Stroke(Struct, frozen=True):
    """A part of the face. y, z: its middle in the frame of the head. tilt: its outer end up. height: of an eye."""

    y: Meters
    z: Meters
    tilt: Degrees = 0.0
    height: Meters = 0.0


class Frame(Struct, frozen=True, kw_only=True):
    """A body at an instant. qpos, mocap: state of its model. pose: of its face. caption: what is said."""

    at: Seconds
    qpos: Any
    mocap: Any
    pose: Mapping[str, float] = {}
    drawn: tuple[Cone | Beam, ...] = ()
    caption: str = ""


class Film:
    """Frames of one model as they come. `write` draws them. interval: from one picture to the next, seconds."""

    def __init__(self, model: mujoco.MjModel, rate: float = RATE) -> None:
        self._model = model
        self.interval = 1.0 / rate
        self.frames: list[Frame] = []

    def write(self, path: Path, *, view: View = FROM_THE_SIDE, size: tuple[int, int] = (720, 540)) -> None:
        """Draw the film into a file: `.mp4` (needs ffmpeg), `.webp` or `.gif`, which most browsers play,
        or `.png`, a sheet of pictures.

        Raises InputRefused: an unknown ending, or no ffmpeg. RunFailed: this machine cannot draw.
        """
        check(path)
        if not self.frames:
            return
        camera = Camera(self._model, *size)
        try:
            frames = self.frames if path.suffix != ".png" else _chosen(self.frames, 12)
            pictures = (self.picture(camera, frame, view) for frame in frames)
            if path.suffix == ".mp4":
                _write_mp4(path, frames, pictures, self.interval)
            elif path.suffix == ".png":
                _write_sheet(path, frames, list(pictures))
            else:
                _write_animation(path, frames, list(pictures), self.interval)
        finally:
            camera.close()

    def picture(self, camera: Camera, frame: Frame, view: View = FROM_THE_SIDE) -> Picture:
        """Draw one frame."""
        data = mujoco.MjData(self._model)
        data.qpos[:] = frame.qpos
        if self._model.nmocap:
            data.mocap_pos[:] = frame.mocap
        if frame.pose:
            show_face(self._model, frame.pose)
        mujoco.mj_forward(self._model, data)
        return camera.picture(data, frame.drawn, view)


@asynccontextmanager
async def filming(
    model: mujoco.MjModel, settings: MujocoSettings, frame: Callable[[], Frame], pulse: Pulse
) -> AsyncIterator[None]:
    """Film what happens meanwhile, if the settings ask for that; the film is drawn at the end.

    frame: what there is to be seen now. Raises InputRefused: no film of this name can be made.
    RunFailed: this machine cannot draw.
    """
    film = None
    if settings.film:
        check(Path(settings.film))
        film = Film(model, settings.rate)
    try:
        async with filmed(film, frame):
            yield
    finally:
        pulse.stop()
        if film is not None:
            film.write(Path(settings.film), view=VIEWS[settings.view], size=settings.size)


@asynccontextmanager
async def filmed(film: Film | None, frame: Callable[[], Frame]) -> AsyncIterator[None]:
    """Film what happens meanwhile: a picture at its time, if it shows anything new.

    The clock of the film is its own. Motors stand while a voice, lips or lids move, and the physics with them.
    film: None: nothing is filmed. frame: what there is to be seen now.
    """
    if film is None:
        yield
        return
    filming = asyncio.create_task(_film(film, frame), name="film")
    try:
        yield
    finally:
        filming.cancel()
        await asyncio.gather(filming, return_exceptions=True)


async def _film(film: Film, frame: Callable[[], Frame]) -> None:
    loop = asyncio.get_running_loop()
    began, number = loop.time(), 0
    while True:
        new = frame()
        if not film.frames or _differ(film.frames[-1], new):
            film.frames.append(new)
        number = max(number, int((loop.time() - began) / film.interval)) + 1
        await asyncio.sleep(began + number * film.interval - loop.time())


def _differ(one: Frame, other: Frame) -> bool:
    """True if two frames do not look the same."""
    if one.caption != other.caption or one.drawn != other.drawn:
        return True
    if any(abs(angle - other.pose[joint]) > SEEN for joint, angle in one.pose.items()):
        return True
    return not (np.array_equal(one.qpos, other.qpos) and np.array_equal(one.mocap, other.mocap))


def check(path: Path) -> None:
    """Raise InputRefused if no film of this name can be written here."""
    if path.suffix not in FORMATS:
        raise InputRefused(
            Fault(reason=f"a film {path.name!r}", advice=f"name it {', '.join(FORMATS)}", service="control")
        )
    if path.suffix == ".mp4" and find_spec("imageio_ffmpeg") is None:
        advice = f"{packages_command('imageio-ffmpeg')}; or name the film .webp or .gif"
        raise InputRefused(Fault(reason="no ffmpeg for an .mp4", where=str(path), advice=advice, service="control"))


def show_face(model: mujoco.MjModel, pose: Mapping[str, float]) -> None:
    """Change the shapes of a model's face to an expression."""
    for name, stroke in strokes(pose).items():
        geom = model.geom(name)
        geom.pos[1:] = (stroke.y, stroke.z)
        if stroke.height:
            geom.size[2] = stroke.height
        else:
            geom.quat[:] = turned(name, stroke)


def _captioned(picture: Picture, frame: Frame, time: Seconds) -> Picture:
    """Add what is said, and the time since the film began."""
    from PIL import Image, ImageDraw, ImageFont

    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(18)
    _text(draw, (12, 8), f"{time:5.2f} s", font)
    if frame.caption:
        width = draw.textlength(frame.caption, font=font)
        _text(draw, ((picture.shape[1] - width) / 2, picture.shape[0] - 34), frame.caption, font)
    return np.asarray(image)


def _text(draw: "ImageDraw.ImageDraw", at: tuple[float, float], text: str, font: Any) -> None:
    draw.text(at, text, font=font, fill=(255, 255, 255), stroke_width=2, stroke_fill=(20, 24, 32))


def _chosen(frames: Sequence[Frame], count: int) -> list[Frame]:
    """Choose so many frames at equal distances."""
    if len(frames) <= count:
        return list(frames)
    return [frames[round(number * (len(frames) - 1) / (count - 1))] for number in range(count)]


def _timed(frames: Sequence[Frame], pictures: Sequence[Picture]) -> Iterator[Picture]:
    """Caption each picture with the time of its frame."""
    for frame, picture in zip(frames, pictures, strict=True):
        yield _captioned(picture, frame, frame.at - frames[0].at)


def _write_sheet(path: Path, frames: Sequence[Frame], pictures: Sequence[Picture]) -> None:
    from PIL import Image

    columns = min(4, len(pictures))
    height, width, _ = pictures[0].shape
    sheet = Image.new("RGB", (columns * width // 2, ceil(len(pictures) / columns) * height // 2))
    for number, picture in enumerate(_timed(frames, pictures)):
        small = Image.fromarray(picture).resize((width // 2, height // 2))
        sheet.paste(small, (number % columns * width // 2, number // columns * height // 2))
    sheet.save(path)


def _write_animation(path: Path, frames: Sequence[Frame], pictures: Sequence[Picture], last: Seconds) -> None:
    from PIL import Image

    images = [Image.fromarray(picture) for picture in _timed(frames, pictures)]
    spans = [round(1000 * (later.at - frame.at)) for frame, later in pairwise(frames)]
    durations = [*spans, round(1000 * last)]
    images[0].save(path, save_all=True, append_images=images[1:], duration=durations, loop=0)


def _write_mp4(path: Path, frames: Sequence[Frame], pictures: Iterator[Picture], interval: Seconds) -> None:
    """Hand the pictures to ffmpeg, each for as long as it lasted: a body that stands is shown on, with the time."""
    from imageio_ffmpeg import write_frames

    shown, writer = 0, None
    try:
        for number, (frame, picture) in enumerate(zip(frames, pictures, strict=True)):
            if writer is None:
                height, width, _ = picture.shape
                writer = write_frames(str(path), (width, height), fps=1 / interval, macro_block_size=2)
                writer.send(None)
            until = frames[number + 1].at if number + 1 < len(frames) else frame.at + interval
            while shown < round((until - frames[0].at) / interval):
                writer.send(np.ascontiguousarray(_captioned(picture, frame, shown * interval)))
                shown += 1
        if writer is not None:
            writer.close()
            path.stat()
    except OSError as error:  # also of a file that is not there: ffmpeg says nothing
        raise RunFailed(
            Fault(reason="ffmpeg could not write the film", where=str(path), service="control")
        ) from error


def framed(
    at: Seconds, data: mujoco.MjData, state: BodyState, said: str, world: World, targets: Mapping[str, str],
    pose: Mapping[str, float] | None = None,
) -> Frame:  # fmt: skip
    """A frame of a body. said: by others. targets: what an arm points at now, by the part. pose: of its face."""
    drawn: list[Cone | Beam] = []
    if state.gaze is not None:
        drawn.append(Cone(state.gaze, _length(state.gaze, _place(world, state.looking_at))))
    for part, ray in (("left_arm", state.left_arm), ("right_arm", state.right_arm)):
        if part in targets and ray is not None and ray.tip is not None:
            tip = Ray(origin=ray.tip, axis=ray.axis, tip=ray.tip)
            drawn.append(Beam(tip, _length(tip, _place(world, targets[part]))))
    return Frame(
        at=at, qpos=data.qpos.copy(), mocap=data.mocap_pos.copy(), pose=pose or {}, drawn=tuple(drawn),
        caption=state.speaking or said,
    )  # fmt: skip


def _place(world: World, entity: str) -> Vector | None:
    found = world.entity(entity) if entity else None
    return None if found is None else found.position


def _length(ray: Ray, target: Vector | None) -> Meters:
    """Length of a ray: to its target, or to the table."""
    if target is not None:
        return math.dist(ray.origin, target)
    down = -ray.axis[2]
    return min(FARTHEST, (ray.origin[2] - TABLE_TOP) / down) if down > 1e-3 else FARTHEST


def strokes(pose: Mapping[str, float]) -> dict[str, Stroke]:
    """The parts of the face by the names of their shapes in the model."""
    found: dict[str, Stroke] = {}
    parted, open_by = 0.004 * pose["lips"], 0.016 * pose["jaw"]
    for side, sign in (("left", 1), ("right", -1)):
        lid, brow, corner = pose[f"{side}_lid"], pose[f"{side}_brow"], pose[f"{side}_mouth_corner"]
        found[f"{side}_eye"] = Stroke(sign * 0.030, 0.088, height=EYE * max(0.08, min(1.3, 1.0 - lid)))
        found[f"{side}_brow"] = Stroke(sign * 0.030, BROWS + 0.009 * brow, tilt=-25.0 * pose["brow_slant"])
        height = MOUTH + 0.003 * corner + parted / 2
        found[f"{side}_mouth"] = Stroke(sign * 0.0125, height, tilt=32.0 * corner)
    found["jaw"] = Stroke(0.0, MOUTH - parted / 2 - open_by)
    return found


def turned(name: str, stroke: Stroke) -> tuple[float, float, float, float]:
    """Quaternion of a part that lies across the face."""
    tilt = stroke.tilt if not name.startswith("right") else -stroke.tilt
    half = radians(90.0 + tilt) / 2
    return (cos(half), sin(half), 0.0, 0.0)
