"""Films of a body: what it looked like while it moved, drawn afterwards. Time is that of its frames.

Drawing a picture takes some tenths of a second without a GPU, so nothing is drawn while the body moves.
"""

import asyncio
import shutil
import subprocess
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from itertools import pairwise
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from msgspec import Struct

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.mujoco import face
from engage_hri.services.control.mujoco.pictures import FROM_THE_SIDE, Beam, Camera, Cone, Picture, View
from engage_hri.services.runtime.installation import packages_command

if TYPE_CHECKING:
    from PIL import ImageDraw

RATE = 12.0
"""Pictures a second."""
SEEN = 0.01
"""Share of its way by which a part of the face is moved at least where a new picture shows it: half a millimetre."""
FORMATS = (".mp4", ".webp", ".gif", ".png")


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

    def take(self, frame: Frame) -> None:
        self.frames.append(frame)

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
            pictures = self._pictures(camera, frames, view)
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

    def _pictures(self, camera: Camera, frames: Sequence[Frame], view: View) -> Iterator[Picture]:
        return (self.picture(camera, frame, view) for frame in frames)


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
            film.take(new)
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
    if path.suffix == ".mp4" and _ffmpeg() is None:
        advice = f"install ffmpeg, or {packages_command('imageio-ffmpeg')}; or name the film .webp or .gif"
        raise InputRefused(
            Fault(reason="no program ffmpeg for an .mp4", where=str(path), advice=advice, service="control")
        )


def _ffmpeg() -> str | None:
    """The program ffmpeg of this machine, or else that of the package imageio-ffmpeg; None: neither is there."""
    if (program := shutil.which("ffmpeg")) is not None:
        return program
    try:
        from imageio_ffmpeg import get_ffmpeg_exe
    except ImportError:
        return None
    try:
        return str(get_ffmpeg_exe())
    except RuntimeError:  # the package was built without it
        return None


def show_face(model: mujoco.MjModel, pose: Mapping[str, float]) -> None:
    """Change the shapes of a model's face to an expression."""
    for name, stroke in face.strokes(pose).items():
        geom = model.geom(name)
        geom.pos[1:] = (stroke.y, stroke.z)
        if stroke.height:
            geom.size[2] = stroke.height
        else:
            geom.quat[:] = face.turned(name, stroke)


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
    """Hand the pictures to ffmpeg, each for as long as it lasted."""
    program: subprocess.Popen[bytes] | None = None
    shown = 0
    for number, (frame, picture) in enumerate(zip(frames, pictures, strict=True)):
        if program is None:
            height, width, _ = picture.shape
            program = subprocess.Popen(
                [_ffmpeg() or "ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
                 "-s", f"{width}x{height}", "-r", f"{1 / interval:g}", "-i", "-", "-pix_fmt", "yuv420p", str(path)],
                stdin=subprocess.PIPE,
            )  # fmt: skip
        until = frames[number + 1].at if number + 1 < len(frames) else frame.at + interval
        assert program.stdin is not None
        while shown < round((until - frames[0].at) / interval):  # a body that stands is shown on, with the time
            with suppress(BrokenPipeError):  # what it has ended with is told below
                program.stdin.write(_captioned(picture, frame, shown * interval).tobytes())
            shown += 1
    if program is not None:
        program.communicate()
        if program.returncode:
            raise RunFailed(Fault(reason="ffmpeg could not write the film", where=str(path), service="control"))
