"""Command `engage eyes install`: fetch what eyes need of others from its registries into this user's data folder."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from engage_hri.services.commandline.shell.process import DONE
from engage_hri.services.runtime.packages import data_folder, download, install
from engage_hri.services.runtime.parcels import PARCELS


@dataclass(frozen=True, kw_only=True)
class Options:
    what: Annotated[Literal["install"], typer.Argument(metavar="install", help="What to do.")]
    folder: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="FOLDER",
            help=f"Folder in which {' and '.join(each.file for each in PARCELS)} lie, where there is no network.",
            show_default=False,
        ),
    ] = None


def main(options: Options) -> int:
    """Install the models, and what runs them in browsers."""
    for parcel in PARCELS:
        with tempfile.TemporaryDirectory() as aside:
            file = download(parcel, Path(aside)) if options.folder is None else options.folder / parcel.file
            kept = install(parcel, file, data_folder())
        for path in kept:
            print(path)
        print(f"of {parcel.name} {parcel.version}, under the license {parcel.license}: {parcel.purpose}")
    return DONE
