"""Drivers that packages offer: packages without files, installed into a folder of the test."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.control.bases import drivers
from engage_hri.services.control.bases.driver_guard import GuardedBody
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.runtime.installation import BODIES, VOICES, offers

DRIVER = """
from tests.control.test_drivers import Bare

class Kuka(Bare): ...
"""
Install = Callable[..., None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Install a package as pip does: its metadata beside its modules."""

    def installed(package: str, points: str, **modules: str) -> None:
        metadata = tmp_path / f"{package.replace('-', '_')}-1.2.dist-info"
        metadata.mkdir()
        (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.2\n")
        (metadata / "entry_points.txt").write_text(points)
        for name, text in modules.items():
            (tmp_path / f"{name}.py").write_text(text)

    monkeypatch.syspath_prepend(tmp_path)
    yield installed
    for name in [name for name, each in sys.modules.items() if str(tmp_path) in str(getattr(each, "__file__", ""))]:
        del sys.modules[name]


def made(body: str, voice: str = "") -> object:
    return drivers.made(ControlConfig(body=body, voice=voice))


async def test_a_body_of_an_installed_package_is_had_by_its_name_and_is_guarded(install: Install):
    install("acme-robots", "[engage.bodies]\nkuka = acme:Kuka\n", acme=DRIVER)

    body = made("kuka")
    assert isinstance(body, GuardedBody)
    assert type(body.body).__name__ == "Kuka"
    with pytest.raises(InputRefused, match="do you mean kuka"):
        made("kukka")


async def test_a_voice_of_an_installed_package_is_offered_as_a_voice(install: Install):
    text = "from engage_hri.services.control.voice.silent import SilentVoice\nclass Parrot(SilentVoice): ...\n"
    install("acme-voices", "[engage.voices]\nparrot = acme_voice:Parrot\n", acme_voice=text)

    assert isinstance(made("simulated", "parrot").capabilities.parts, tuple)  # type: ignore[attr-defined]
    with pytest.raises(
        InputRefused, match=r"no voice 'parot' \(do you mean parrot\? known are espeak, parrot, silent;"
    ):
        made("simulated", "parot")


async def test_a_driver_that_cannot_be_imported_names_its_package_and_costs_nobody_else_anything(install: Install):
    install("acme-robots", "[engage.bodies]\nkuka = acme:Kuka\nlost = acme_lost:Lost\n", acme="import no_such_sdk\n")

    with pytest.raises(InputRefused) as refused:
        made("kuka")
    assert "the driver of the package acme-robots 1.2 (acme:Kuka) cannot be imported" in str(refused.value)
    assert "No module named 'no_such_sdk' (see " in str(refused.value)
    assert "acme.py, line 1" in str(refused.value)
    with pytest.raises(InputRefused, match=r"acme-robots 1\.2 \(acme_lost:Lost\)"):
        made("lost")
    assert isinstance(made("simulated"), SimulatedBody)


async def test_an_extra_that_is_not_installed_is_named_for_the_package_that_has_it(install: Install):
    points = "[engage.bodies]\nkuka = acme:Kuka [real-arm]\n"
    install("acme-robots", points, acme="import no_such_sdk\n")

    with pytest.raises(InputRefused, match=r"pip install 'acme-robots\[real-arm\]'"):
        made("kuka")


@pytest.mark.parametrize(
    "points", ["[engage.bodies]\nkuka\n", "[engage.bodies]\n[\n", "[engage.bodies]\nkuka = !?\n"]
)
async def test_entry_points_that_cannot_be_read_are_told_to_those_who_ask_for_them(install: Install, points: str):
    install("acme-robots", points)

    assert isinstance(made("simulated"), SimulatedBody)
    with pytest.raises(InputRefused, match="acme-robots"):
        made("kuka")


async def test_two_packages_with_one_name_are_refused_by_both_names(install: Install):
    install("acme-robots", "[engage.bodies]\nkuka = acme:Kuka\narm = acme:Kuka\n", acme=DRIVER)
    install("other-robots", "[engage.bodies]\nkuka = other:Kuka\n", other=DRIVER)

    with pytest.raises(InputRefused) as refused:
        made("kuka")
    assert "acme-robots 1.2 (acme:Kuka)" in str(refused.value)
    assert "other-robots 1.2 (other:Kuka)" in str(refused.value)
    assert made("arm")


def test_ours_are_offered_as_anybodys():
    assert {each.name for each in offers(BODIES) if each.is_ours} == {"simulated", "mujoco", "reachy_mini"}
    assert {each.name for each in offers(VOICES) if each.is_ours} == {"silent", "espeak"}
    assert {each.name: each.extras for each in offers(BODIES)}["reachy_mini"] == ("reachy-mini",)


def test_the_command_line_finds_a_body_of_a_package_on_the_path(install: Install, tmp_path: Path):
    install("acme-robots", "[engage.bodies]\nkuka = acme:Kuka\n", acme=DRIVER)

    paths = os.pathsep.join((str(tmp_path), str(Path(__file__).parents[2])))
    ended = subprocess.run(
        [sys.executable, "-m", "engage_hri", "check-body", "kuka", "--law", "noise", "--json"],
        env={**os.environ, "PYTHONPATH": paths}, capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip

    assert '"driver":"kuka"' in ended.stdout, ended.stderr
