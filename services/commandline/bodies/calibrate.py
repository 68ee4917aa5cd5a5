"""Command `engage calibrate`: measure where a body really looks and points, where a camera stands, or which colors
pieces have, and write what corrects it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec
import typer

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed, raised_as
from engage_hri.schemas.text import utf8
from engage_hri.schemas.units import Vector
from engage_hri.schemas.world import Entity
from engage_hri.services.commandline.shell.options import Configured
from engage_hri.services.commandline.shell.outputs import ResultFile
from engage_hri.services.commandline.shell.process import DONE, run, typed
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.control.calibrating import (
    OTHER_ROWS,
    Eyes,
    Fit,
    Measurement,
    SimulatedEyes,
    fit,
    marks,
    measured,
)
from engage_hri.services.control.contract.body import Body, BodyState
from engage_hri.services.control.contract.calibration import PARTS, WIDEST, Calibration, written
from engage_hri.services.perception.attached import AttachedCamera

if TYPE_CHECKING:
    from engage_hri.services.perception.eyes.placing import PlacedCamera

# -- by pictures --------------------------------------------------------------------------------------------------


HEADS = 30
"""Pictures with one face that are enough."""
FEWEST = 5
"""Pictures of a sheet, or of somebody, below which nothing is worked out."""
ASTRAY = 0.03
"""Metres from its place of the task's beginning from which on a piece is taken for another thing."""


@dataclass(frozen=True, kw_only=True)
class CameraOptions(Configured):
    what: Annotated[
        Literal["body", "eyes", "pieces", "colors"],
        typer.Argument(
            metavar="body|eyes|pieces|colors",
            help="The robot's body; the camera of eyes, or of pieces; or the colors of the pieces.",
        ),
    ]
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Where the result is written.", show_default="calibration, or WHAT.toml"),
    ] = None
    source: Annotated[
        str | None,
        typer.Option(
            "--from", metavar="SOURCE", help="Pictures: camera, or film:PATH.", show_default="the settings'"
        ),
    ] = None
    sheet: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the sheet of markers to print, as SVG; nothing is measured."),
    ] = None
    at: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            metavar="X Y Z", help="Where the sheet lies, its middle, or who sits there has the eyes; metres."
        ),
    ] = None
    upright: Annotated[bool, typer.Option("--upright", help="The sheet stands, facing the robot.")] = False
    seat: Annotated[bool, typer.Option("--seat", help="Somebody sits there; no sheet is needed.")] = False
    task: Annotated[
        str | None, typer.Option(metavar="TASK", help="Whose pieces have these colors: a task's name, or its file.")
    ] = None


def calibrated_camera(options: CameraOptions) -> int:
    """Find where the camera of eyes, or of pieces, stands, and write it as settings."""
    if options.sheet is not None:
        from engage_hri.services.perception.eyes.placing import sheet

        ResultFile(options.sheet).write(sheet().encode())
        print(f"written: {options.sheet}; print it on A4, without scaling")
        return DONE
    if options.at is None:
        advice = "--at X Y Z, in the robot's frame: metres ahead of it, to its left, and up from the floor"
        raise InputRefused(Fault(reason="it is not said where the sheet lies, or who sits there", advice=advice))
    if options.seat and options.what != "eyes":
        raise InputRefused(Fault(reason="--seat is for eyes", advice="engage calibrate eyes --seat --at X Y Z"))
    out = ResultFile(options.out or Path(f"{options.what}.toml"))
    config = options.load()
    camera = config.pieces if options.what == "pieces" else config.eyes
    source = options.source or camera.source
    if options.seat:
        found, pictures = _by_seat(config, source, options.at)
    else:
        found, pictures = _by_sheet(camera, options.what, source, options.at, options.upright)
    settings = {name: _rounded(getattr(found, name)) for name in ("field_of_view", "place", "tilt", "pan", "roll")}
    measured = (
        f"{pictures}; what is seen is {found.beside:.2f} pixels beside, the field within {found.error:.2f} degrees"
    )
    rows = (f"{name} = {msgspec.json.encode(value).decode()}" for name, value in settings.items())
    text = "\n".join([f"[{options.what}]", *rows, ""])
    out.write(f"# engage calibrate {options.what}: {measured}\n{text}".encode())
    print(
        text.strip(),
        measured,
        f"written: {out.path}; it counts with --config {out.path}, or as part of yours",
        sep="\n",
    )
    return DONE


def _by_sheet(
    camera: AttachedCamera, sense: str, source: str, at: Vector, upright: bool
) -> "tuple[PlacedCamera, str]":
    from engage_hri.services.perception.eyes.placing import FLAT, UPRIGHT, SheetFinder, SheetViews, placed_by_sheet

    finder, views, size = SheetFinder(), None, (0, 0)
    print("move the sheet before the camera: slanted, to all sides, nearer and farther; then put it to its place")
    for image, _ in _pictures(camera, sense, source):
        size = (image.shape[1], image.shape[0])
        views = views or SheetViews(size[0])
        if (seen := finder.find(image)) is not None:
            views.feed(seen)
        if views.are_enough and source == "camera":
            break
    if views is None or len(views.laid) < FEWEST:
        reason = "the sheet was not seen to lie still" if views and views.moved else "no sheet was seen"
        raise RunFailed(Fault(reason=reason, where=source, advice="engage calibrate eyes --sheet FILE.svg writes it"))
    found = placed_by_sheet(views.moved, views.laid[-FEWEST:], UPRIGHT if upright else FLAT, at, *size)
    return found, f"{len(views.moved)} pictures of the sheet that is held, {len(views.laid)} in which it lies"


def _by_seat(config: RobotConfig, source: str, at: Vector) -> "tuple[PlacedCamera, str]":
    from engage_hri.services.perception.eyes.camera import StatedCamera
    from engage_hri.services.perception.eyes.head_pose import head
    from engage_hri.services.perception.eyes.looking import settings_of, unpacked
    from engage_hri.services.perception.eyes.placing import placed_by_seat
    from engage_hri.services.perception.eyes.watching import FACES, SourceOrder, opened
    from engage_hri.services.runtime.parcels import data_folder

    eyes = msgspec.structs.replace(config.eyes, source=source)
    order = SourceOrder(source.partition(":")[0], settings_of(eyes, str(data_folder("eyes"))))
    stated, heads, width, focal = StatedCamera(eyes.field_of_view, eyes.place, 0.0, 0.0), [], 0, 0.0
    for landmarks in opened(order, FACES).look():
        width, focal = landmarks.width, stated.focal(landmarks.width)
        if len(landmarks.faces) == 1:
            [points] = unpacked(landmarks.faces)
            if (found := head(points, width, landmarks.height, focal)) is not None:
                heads.append(found)
        if len(heads) == HEADS:
            break
    if len(heads) < FEWEST:
        advice = "one person, alone, looks at the camera"
        raise RunFailed(Fault(reason=f"a single face was seen in {len(heads)} pictures only", advice=advice))
    return placed_by_seat(heads, focal, at, eyes.place, width), f"{len(heads)} pictures of one face"


def learned_colors(options: CameraOptions) -> int:
    """Learn the colors of pieces that lie where their task begins, and write them.

    Raises RunFailed: one is not there.
    """
    from math import dist

    from engage_hri.services.perception.eyes.camera import StatedCamera
    from engage_hri.services.perception.pieces.colors import task_table, written_palette
    from engage_hri.services.perception.pieces.finding import FlatTable, PieceFinder, learned

    config = options.load().pieces
    out = ResultFile(options.out or Path("colors.toml"))
    table = task_table(options.task or config.task)
    image, _ = next(_pictures(config, "pieces", options.source or config.source))
    camera = StatedCamera(config.field_of_view, config.place, config.tilt, config.pan, config.roll)
    flat = FlatTable(table, camera, image.shape[1], image.shape[0])
    palette = learned(image, table, flat)
    found = PieceFinder(table, flat, palette).find(image).pieces
    there = {piece.id: (piece.x, piece.y) for piece in found}
    astray = [
        form.id for form in table.pieces if dist(there.get(form.id, (9, 9)), (form.start.x, form.start.y)) > ASTRAY
    ]
    if astray:
        advice = "lay each where the file of the task says; or pieces.place, tilt or field_of_view is not right"
        raise RunFailed(Fault(reason=f"not seen where they begin: {', '.join(astray)}", advice=advice))
    out.write(written_palette(palette).encode())
    print(f"{len(found)} pieces of {len(palette) - 1} colors")
    print(f"written: {out.path}; it counts with pieces.colors={out.path}")
    return DONE


def _pictures(camera: AttachedCamera, sense: str, source: str) -> Iterator[tuple[Any, float]]:
    from engage_hri.services.perception.pictures import CameraPictures, FilmPictures, PictureSettings

    kind, _, path = source.partition(":")
    if kind not in ("camera", "film"):
        raise InputRefused(
            Fault(reason=f"no pictures from {source!r}", where="--from", advice="camera, or film:PATH")
        )
    settings = PictureSettings(
        path=path, device=camera.device, rate=camera.rate, width=camera.width, height=camera.height
    )
    return (CameraPictures if kind == "camera" else FilmPictures)(settings, sense).taken()


def _rounded(value: Any) -> Any:
    return [round(each, 4) for each in value] if isinstance(value, tuple) else round(value, 3)


FEWEST = 3
"""Measurements of a part below which nothing is fitted."""


# -- a body -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Options(CameraOptions):
    part: Annotated[
        list[str] | None,
        typer.Option(metavar="PART", help="head, left_arm or right_arm; may be repeated.", show_default="all it has"),
    ] = None
    ask: Annotated[bool, typer.Option("--ask", help="Ask on standard input where it really looks or points.")] = False
    measurements: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Measurements made before; nothing moves.", show_default=False)
    ] = None
    record: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the measurements as JSON lines.", show_default=False)
    ] = None
    world: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="JSON of what it looks and points at; without it marks on a table."),
    ] = None
    spread: Annotated[
        float, typer.Option(metavar="METRES", min=0.0, help="How well simulated eyes measure a place.")
    ] = 0.003


class AskedEyes:
    """Eyes of whoever sits at the terminal, and types a place."""

    def __init__(self) -> None:
        self._typed = b""

    async def place(self, part: str, mark: Entity, state: BodyState) -> Vector | None:
        """Ask until a place is typed, or nothing. Raises RunFailed at the end of the input."""
        meant = " ".join(f"{part:.3f}" for part in mark.position)
        while True:
            print(
                f"{part} is on {mark.id} ({meant}). Where really? x y z in metres, or nothing: ", end="", flush=True
            )
            line = await self._line()
            if not line.strip():
                return None
            try:
                x, y, z = (float(each) for each in line.replace(",", " ").split())
            except ValueError:
                print("three numbers, such as", meant)
                continue
            return (x, y, z)

    async def _line(self) -> str:
        while b"\n" not in self._typed:
            more = await typed()
            if not (more or self._typed):
                reason = "standard input has ended before all places were typed"
                raise RunFailed(Fault(reason=reason, where="--ask"))
            self._typed += more or b"\n"
        line, _, self._typed = self._typed.partition(b"\n")
        return line.decode(errors="replace")


def main(options: Options) -> int:
    if options.what != "body":
        made = learned_colors if options.what == "colors" else calibrated_camera
        return made(options)
    config = options.load()
    parts = tuple(options.part or PARTS)
    if unknown := [part for part in parts if part not in PARTS]:
        raise InputRefused(
            Fault(reason=f"no part {unknown[0]!r}", where="--part", advice=f"known: {', '.join(PARTS)}")
        )
    known = None if options.measurements is None else read_measurements(options.measurements)
    out, record = (
        ResultFile(options.out or Path("calibration.toml")),
        None if options.record is None else ResultFile(options.record),
    )
    run(_calibrate(options, config, parts, known, out, record), virtual_time=not options.ask)
    return DONE


async def _calibrate(
    options: Options,
    config: RobotConfig,
    parts: Sequence[str],
    known: Sequence[Measurement] | None,
    out: ResultFile,
    record: ResultFile | None,
) -> None:
    from engage_hri.services.control.bases.drivers import made
    from engage_hri.services.simulation.still import load_world

    body = made(config.control)
    parts = [part for part in parts if part in body.capabilities.parts]
    world = marks() if options.world is None else load_world(options.world)
    eyes = _eyes(options, body)
    if known is None:
        if eyes is None:
            advice = "--ask somebody who sees it, or give the --measurements"
            raise InputRefused(Fault(reason="nobody sees where this body points", where="calibrate", advice=advice))
        async with body.connected():
            found = await measured(body, world, parts, eyes, print)
            fits = _fits(body, parts, found)
            checked = await _checked(body, fits, options) if isinstance(eyes, SimulatedEyes) else {}
    else:
        found, checked = list(known), {}
        fits = _fits(body, parts, found)
    if record is not None:
        record.write(b"".join(msgspec.json.encode(each) + b"\n" for each in found))
    if not fits:
        raise RunFailed(
            Fault(
                reason=f"no part was measured {FEWEST} times or more",
                where=str(options.measurements or options.world or "marks"),
            )
        )
    offsets = {joint: offset for each in fits for joint, offset in each.offsets.items()}
    errors = {each.part: min(each.error, WIDEST) for each in fits}
    told = {each.part: [*said(each), *checked.get(each.part, ())] for each in fits}
    out.write(written(Calibration(offsets=offsets, errors=errors), body.capabilities.body, told).encode())
    for part, lines in told.items():
        print("\n    ".join((f"{part}: {lines[0]}", *lines[1:], f"within {errors[part]:.2f} degrees 19 times in 20")))
    print(f"written: {out.path}; it counts with control.calibration={out.path}")


def _eyes(options: Options, body: Body) -> Eyes | None:
    if options.ask:
        return AskedEyes()
    return SimulatedEyes(body, options.spread) if body.capabilities.faults else None


def _fits(body: Body, parts: Sequence[str], found: Sequence[Measurement]) -> list[Fit]:
    fits = []
    for part in parts:
        own = [each for each in found if each.part == part]
        joints = [limit.joint for limit in body.capabilities.joints if limit.part == part]
        if len(own) >= FEWEST:
            fits.append(fit(part, own, lambda pose, part=part: body.ray_at(part, pose), joints))  # type: ignore[misc]
    return fits


async def _checked(body: Body, fits: Sequence[Fit], options: Options) -> dict[str, list[str]]:
    """Correct the body, have it look and point at other marks, and say by part how far beside that is."""
    corrected = Calibration(offsets={joint: offset for each in fits for joint, offset in each.offsets.items()})
    body.calibrate(corrected.radians)
    parts = [each.part for each in fits]
    again = await measured(body, marks(OTHER_ROWS), parts, SimulatedEyes(body, options.spread, seed=1), print)
    told = {}
    for part in parts:
        own = [each for each in again if each.part == part]
        if own:
            root, most = fit(part, own, lambda pose: None, ()).before
            told[part] = [f"at {len(own)} other marks {root:.2f}, at most {most:.2f}"]
    return told


def said(fit: Fit) -> list[str]:
    """A fit in words: what is beside, and what remains with the offsets."""
    (root, most), (root_after, most_after) = fit.before, fit.after
    offsets = ", ".join(f"{joint} {offset:+.2f}" for joint, offset in fit.offsets.items())
    before = f"{fit.number} measurements, {root:.2f} degrees beside, at most {most:.2f}"
    return [before, f"with {offsets}: {root_after:.2f}, at most {most_after:.2f}"] if offsets else [before]


def read_measurements(path: Path) -> list[Measurement]:
    """Read measurements, a JSON object in each line. Raises InputRefused with the line."""
    with raised_as(InputRefused, OSError, path):
        text = utf8(path.read_bytes(), str(path))
    found = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip():
            try:
                found.append(msgspec.json.decode(line, type=Measurement))
            except msgspec.DecodeError as error:
                raise InputRefused(Fault(reason=str(error), where=str(path), line=number)) from error
    return found
