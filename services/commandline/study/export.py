"""Command `engage export`: a recording as annotations for ELAN or Praat, as a table, or as pictures of the scene."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import quote

import typer

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.commandline.shell.process import DONE
from engage_hri.services.commandline.shell.recording_file import opened
from engage_hri.services.commandline.shell.sources import STDIN
from engage_hri.services.runtime.installation import extra_command, packages_command

if TYPE_CHECKING:
    from engage_hri.services.recording import annotations
    from engage_hri.services.recording.reading import Recording

ENDINGS = {
    "elan": ".eaf", "textgrid": ".TextGrid", "csv": ".csv", "sheet": ".png", "film": ".mp4", "lines": ".jsonl",
    "settings": ".settings.toml",
}  # fmt: skip
RATE = 10.0
"""Pictures a second of a film."""
PICTURES = 16
"""Pictures on a sheet."""


@dataclass(frozen=True, kw_only=True)
class Options:
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording of `engage record`.", show_default=False)]
    elan: Annotated[bool, typer.Option("--elan", help="Tiers for ELAN, FILE.eaf.")] = False
    textgrid: Annotated[bool, typer.Option("--textgrid", help="Tiers for Praat, FILE.TextGrid.")] = False
    csv: Annotated[bool, typer.Option("--csv", help="Tiers as a table, FILE.csv.")] = False
    lines: Annotated[bool, typer.Option("--lines", help="The lines of `engage watch --json`, FILE.jsonl.")] = False
    settings: Annotated[
        bool, typer.Option("--settings", help="Settings of the services, FILE.settings.toml, as for --config.")
    ] = False
    sheet: Annotated[bool, typer.Option("--sheet", help="Pictures of the scene from above, FILE.png.")] = False
    film: Annotated[bool, typer.Option("--film", help="A film of it, FILE.mp4, or FILE.gif without ffmpeg.")] = False
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Another name for the one file.", show_default=False)
    ] = None
    speed: Annotated[float, typer.Option(metavar="X", min=0.1, max=100, help="Of the film.")] = 1.0
    until: Annotated[float | None, typer.Option(metavar="S", min=0, help="End of the film.", show_default=False)] = (
        None
    )
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files that are there.")] = False


def main(options: Options) -> int:
    wanted = [name for name in ENDINGS if getattr(options, name)]
    if not wanted:
        known = ", ".join(f"--{name}" for name in ENDINGS)
        raise InputRefused(Fault(reason="nothing is to be made", advice=f"say what: {known}"))
    if options.out is not None and len(wanted) > 1:
        raise InputRefused(Fault(reason="is a name for one file", where="--out", advice="leave it out"))
    if options.out == STDIN:
        reason, advice = "`-` is no file, and standard output gets the names of the files", "--out FILE"
        raise InputRefused(Fault(reason=reason, where="--out", advice=advice))
    paths = {name: _path(options, name) for name in wanted}
    for path in paths.values():
        if path.exists() and not options.overwrite:
            raise InputRefused(Fault(reason="there is such a file", where=str(path), advice="--overwrite"))
    recording = opened(options.file)
    for name, path in paths.items():
        try:
            path = _make(name, path, recording, options)
        except OSError as error:
            raise InputRefused(Fault(reason=f"cannot write: {error.strerror}", where=str(path))) from error
        print(path)
    return DONE


def _path(options: Options, name: str) -> Path:
    if options.out is not None:
        return options.out
    ending = ENDINGS[name]
    if name == "film" and not _has_ffmpeg():
        ending = ".gif"
    file = options.file  # what follows the last dot of its name may be part of a date
    return file.with_suffix(ending) if file.suffix == ".mcap" else file.with_name(file.name + ending)


def _has_ffmpeg() -> bool:
    try:
        import imageio_ffmpeg

        return bool(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        return False


def _make(name: str, path: Path, recording: "Recording", options: Options) -> Path:
    """Make one file. Returns where it is."""
    from engage_hri.services.recording import annotations, settings, tiers
    from engage_hri.services.recording.reading import BILLION

    match name:
        case "elan":
            date = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(recording.wall / BILLION))
            path.write_bytes(annotations.eaf(tiers.tiers(recording), date=date, media=_media(path, options)))
        case "textgrid":
            text = annotations.textgrid(tiers.tiers(recording), recording.duration)
            path.write_text(text, encoding="utf-8")
        case "csv":
            path.write_text(annotations.table(tiers.tiers(recording)), encoding="utf-8")
        case "lines":
            path.write_text(lines_of(recording), encoding="utf-8")
        case "settings":
            found = settings.settings_of(recording)
            path.write_text(settings.configuration(found, options.file.name), encoding="utf-8")
        case _:
            _draw(name, path, recording, options)
    return path


def _media(path: Path, options: Options) -> "annotations.Media | None":
    """The film that belongs to annotations: one that is made with them, or lies beside them already.

    ELAN shows no `.gif`, and a film of another speed has other times.
    """
    from engage_hri.services.recording.annotations import Media

    film = _path(options, "film") if options.out is None else path.with_suffix(".mp4")
    is_its = options.film and options.speed == 1.0
    if film.suffix != ".mp4" or not (is_its or (film.exists() and not options.film)):
        return None
    return Media(film.resolve().as_uri(), f"./{quote(film.name)}")


def lines_of(recording: "Recording") -> str:
    """The messages that have a line, as `engage watch --json` would have printed them."""
    from engage_hri.schemas import lines
    from engage_hri.services.recording.times import messages

    told = (lines.line(received.message) for received, _ in messages(recording) if not received.past)
    return "".join(f"{line}\n" for line in told if line is not None)


def _draw(name: str, path: Path, recording: "Recording", options: Options) -> None:
    try:
        from engage_hri.services.recording.drawing import sheet, times_of_film, write_film
    except ImportError as error:
        fault = Fault(reason=f"pictures need matplotlib: {error}", advice=extra_command("study"))
        raise InputRefused(fault) from error
    from engage_hri.services.recording.scenes import scenes, spread

    if name == "sheet":
        times = spread(recording.duration, PICTURES)
        path.write_bytes(sheet(list(scenes(recording, times)), path.suffix.removeprefix(".") or "png"))
        return
    times = times_of_film(recording.duration, RATE, options.speed, options.until)
    try:
        write_film(path, list(scenes(recording, times)), RATE)
    except ImportError as error:
        advice = f"{packages_command('pillow', 'imageio-ffmpeg')}, or --sheet"
        fault = Fault(reason=f"a film needs more: {error}", advice=advice)
        raise InputRefused(fault) from error
