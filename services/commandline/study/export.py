"""Command `engage export`: a recording as annotations for ELAN, a table, a script, lines, or its settings."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import quote

import typer

from engage_hri.schemas.faults import Fault, InputRefused, raised_as
from engage_hri.services.commandline.shell.process import DONE
from engage_hri.services.commandline.shell.recording_file import opened
from engage_hri.services.commandline.shell.sources import STDIN

if TYPE_CHECKING:
    from engage_hri.services.recording.reading import Recording

ENDINGS = {"elan": ".eaf", "csv": ".csv", "script": ".txt", "lines": ".jsonl", "settings": ".settings.toml"}


@dataclass(frozen=True, kw_only=True)
class Options:
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording of `engage record`.", show_default=False)]
    elan: Annotated[bool, typer.Option("--elan", help="Tiers for ELAN, FILE.eaf.")] = False
    csv: Annotated[bool, typer.Option("--csv", help="Tiers as a table, FILE.csv.")] = False
    script: Annotated[
        bool, typer.Option("--script", help="Who said what to whom, looked at whom, and was answered: FILE.txt.")
    ] = False
    lines: Annotated[bool, typer.Option("--lines", help="The lines of `engage watch --json`, FILE.jsonl.")] = False
    settings: Annotated[
        bool, typer.Option("--settings", help="Settings of the services, FILE.settings.toml, as for --config.")
    ] = False
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Another name for the one file.", show_default=False)
    ] = None
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
        with raised_as(InputRefused, OSError, path, "cannot write"):
            path.write_bytes(_made(name, path, recording, options))
        print(path)
    return DONE


def _path(options: Options, name: str) -> Path:
    if options.out is not None:
        return options.out
    ending, file = ENDINGS[name], options.file  # what follows the last dot of its name may be part of a date
    return file.with_suffix(ending) if file.suffix == ".mcap" else file.with_name(file.name + ending)


def _made(name: str, path: Path, recording: "Recording", options: Options) -> bytes:
    """Content of one file. path: where it will be."""
    from engage_hri.services.recording import play_script, settings, tiers
    from engage_hri.services.recording.reading import BILLION

    match name:
        case "elan":
            date = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(recording.wall / BILLION))
            film = path.with_suffix(".mp4")
            media = tiers.Media(film.resolve().as_uri(), f"./{quote(film.name)}") if film.exists() else None
            return tiers.eaf(tiers.tiers(recording), date=date, media=media)
        case "csv":
            text = tiers.table(tiers.tiers(recording))
        case "script":
            text = play_script.script(recording)
        case "lines":
            text = lines_of(recording)
        case _:
            text = settings.configuration(settings.settings_of(recording), options.file.name)
    return text.encode()


def lines_of(recording: "Recording") -> str:
    """The messages that have a line, as `engage watch --json` would have printed them."""
    from engage_hri.schemas.messages import line
    from engage_hri.services.recording.reading import messages

    told = (line(received.message) for received, _ in messages(recording) if not received.past)
    return "".join(f"{line}\n" for line in told if line is not None)
