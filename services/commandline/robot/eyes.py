"""Commands `engage eyes install`, `engage hearing install`: fetch what senses need of others, for this user."""

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
            help="Folder in which the files of the packages lie, where there is no network.",
            show_default=False,
        ),
    ] = None


def main(options: Options, sense: str = "eyes") -> int:
    """Install the models of a sense."""
    for parcel in PARCELS[sense]:
        with tempfile.TemporaryDirectory() as aside:
            file = download(parcel, Path(aside)) if options.folder is None else options.folder / parcel.file
            kept = install(parcel, file, data_folder(sense))
        for path in kept:
            print(path)
        print(f"of {parcel.name} {parcel.version}, under the license {parcel.license}: {parcel.purpose}")
    return DONE
