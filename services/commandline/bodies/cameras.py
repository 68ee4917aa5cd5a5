"""Measurements of `engage calibrate` by pictures: where a camera stands, how wide it sees, the colors of pieces."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec
import typer

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.units import Vector
from engage_hri.services.commandline.shell.options import Configured
from engage_hri.services.commandline.shell.process import DONE
from engage_hri.services.commandline.shell.result_file import ResultFile
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.perception.attached import AttachedCamera

if TYPE_CHECKING:
    from engage_hri.services.perception.eyes.placing import PlacedCamera

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
    from engage_hri.services.runtime.packages import data_folder

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
