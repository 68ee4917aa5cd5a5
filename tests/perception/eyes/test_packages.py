"""`engage eyes install`: named files of each package, checked, kept whole or not at all."""

import io
import tarfile
import zipfile
from hashlib import sha256
from pathlib import Path
from typing import Literal

import pytest

from engage_hri.schemas.faults import InputRefused, RunFailed
from engage_hri.services.commandline.robot.eyes import download, install
from engage_hri.services.runtime.parcels import FACE_MODELS, PAGE_RUNTIME, Parcel, data_folder
from tests.cli.command import engage


def parcel(folder: Path, registry: Literal["PyPI", "npm"] = "PyPI", **other: str) -> Parcel:
    """A package with a model and its license, and the file that a registry would have of it."""
    files = {
        "thing/model.bin": b"a model",
        "thing-1.0.dist-info/LICENSE": b"do as you like",
        "thing/code.py": b"print()",
    }
    file = folder / ("thing-1.0-py3-none-any.whl" if registry == "PyPI" else "thing-1.0.tgz")
    if registry == "PyPI":
        with zipfile.ZipFile(file, "w") as wheel:
            for name, content in files.items():
                wheel.writestr(name, content)
    else:
        with tarfile.open(file, "w:gz") as packed:
            for name, content in files.items():
                member = tarfile.TarInfo(name)
                member.size = len(content)
                packed.addfile(member, io.BytesIO(content))
    kept = {name: sha256(content).hexdigest() for name, content in files.items() if not name.endswith(".py")}
    digest = sha256(file.read_bytes()).hexdigest()
    return Parcel(registry, "thing", "1.0", file.name, digest, {**kept, **other}, "CC0-1.0", "tests")


@pytest.mark.parametrize("registry", ["PyPI", "npm"])
def test_what_is_named_is_kept_and_nothing_else(tmp_path: Path, registry: Literal["PyPI", "npm"]):
    made = parcel(tmp_path, registry)

    kept = install(made, tmp_path / made.file, tmp_path / "data" / "eyes")
    assert [path.name for path in kept] == made.names() == ["model.bin", "LICENSE"]
    assert sorted(path.name for path in (tmp_path / "data/eyes").iterdir()) == ["LICENSE", "model.bin"]
    assert kept[0].read_bytes() == b"a model"


def test_a_file_that_is_another_one_is_refused_and_nothing_is_kept(tmp_path: Path):
    made = parcel(tmp_path)
    with (tmp_path / made.file).open("ab") as wheel:
        wheel.write(b"more")

    with pytest.raises(InputRefused, match="its SHA-256 is"):
        install(made, tmp_path / made.file, tmp_path / "data")
    assert not (tmp_path / "data").exists()


def test_a_model_that_is_another_one_is_refused(tmp_path: Path):
    made = parcel(tmp_path, **{"thing/model.bin": "0" * 64})

    with pytest.raises(InputRefused, match=r"model\.bin"):
        install(made, tmp_path / made.file, tmp_path / "data")


def test_without_a_network_the_command_says_which_file_it_wants(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("ENGAGE_DATA", str(tmp_path / "data"))
    told = engage(capsys)("eyes", "install", "--from", tmp_path)

    assert told.code == 2
    assert FACE_MODELS.file in told.err
    assert "it is the file of mediapipe 0.10.21 on PyPI" in told.err
    assert not (tmp_path / "data").exists()


@pytest.mark.real_time
def test_a_client_that_has_not_got_a_package_is_told_with_what_to_carry(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    npm = tmp_path / "npm"
    npm.write_text("#!/bin/sh\necho E404 >&2\nexit 1\n")
    npm.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin")

    with pytest.raises(RunFailed, match=r"@litertjs/core 2\.5\.3 cannot be fetched: E404") as told:
        download(PAGE_RUNTIME, tmp_path)
    assert PAGE_RUNTIME.file in told.value.fault.advice


def test_models_lie_in_the_data_of_this_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("ENGAGE_DATA", raising=False)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.setattr("sys.platform", "linux")

    assert data_folder("eyes") == tmp_path / "engage/eyes"
