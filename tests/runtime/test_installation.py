"""What messages tell to install: the command works where it is printed."""

import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from engage_hri.services.runtime import installation

ROOT = Path(__file__).resolve().parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
METADATA = """Metadata-Version: 2.4
Name: engage-hri
Version: 0.1.0
Requires-Dist: numpy>=1.26
Provides-Extra: mujoco
Requires-Dist: mujoco>=4.0; extra == "mujoco"
Requires-Dist: pillow>=10; extra == 'mujoco'
Provides-Extra: speed
Requires-Dist: uvloop>=0.21; platform_system != "Windows" and extra == "speed"
"""


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A folder of packages with this one as a wheel installs it: no pyproject.toml, but what its extras need."""
    file = tmp_path / "engage_hri" / "services" / "runtime" / "installation.py"
    file.parent.mkdir(parents=True)
    file.write_text((ROOT / "services/runtime/installation.py").read_text())
    for folder in file.relative_to(tmp_path).parents:
        (tmp_path / folder / "__init__.py").touch()
    (tmp_path / "engage_hri-0.1.0.dist-info").mkdir()
    (tmp_path / "engage_hri-0.1.0.dist-info" / "METADATA").write_text(METADATA)
    return tmp_path


def told(installed: Path, call: str) -> list[str]:
    code = f"from engage_hri.services.runtime.installation import extra_command, packages_command; print({call})"
    # -S: the editable package of the checkout is not in sight.
    done = subprocess.run(
        (sys.executable, "-S", "-c", code), cwd=installed, env={"PYTHONPATH": str(installed)}, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    return shlex.split(done.stdout)


def test_a_checkout_is_installed_once_more_with_the_extra_from_where_one_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "executable", str(ROOT / ".venv" / "bin" / "python"))

    assert installation.extra_command("console") == ".venv/bin/python -m pip install -e '.[console]'"


def test_from_another_folder_the_command_names_the_checkout_and_its_python(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)

    assert shlex.split(installation.extra_command("study")) == [
        sys.executable,
        "-m",
        "pip",
        "install",
        "-e",
        f"{ROOT}[study]",
    ]


def test_of_an_installed_package_the_requirements_are_named_for_no_index_need_have_the_package(
    installed: Path,
) -> None:
    assert told(installed, "extra_command('mujoco')")[1:] == ["-m", "pip", "install", "mujoco>=4.0", "pillow>=10"]
    assert told(installed, "extra_command('speed')")[1:] == ["-m", "pip", "install", "uvloop>=0.21"]


def test_packages_are_installed_for_the_python_that_runs(installed: Path) -> None:
    assert told(installed, "packages_command('imageio-ffmpeg')") == [
        sys.executable,
        "-m",
        "pip",
        "install",
        "imageio-ffmpeg",
    ]


def test_a_folder_with_blanks_and_quotes_is_one_word_of_the_shell(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "executable", "/a b/it's/python")

    assert shlex.split(installation.packages_command("x"))[0] == "/a b/it's/python"


def texts() -> Iterator[tuple[str, str]]:
    for folder, ending in (
        ("services", "*.py"),
        ("schemas", "*.py"),
        ("docs", "*.md"),
        ("examples", "*"),
        ("tests", "*.py"),
    ):
        for file in (ROOT / folder).rglob(ending):
            name = str(file.relative_to(ROOT))
            if file.is_file() and "__pycache__" not in name and "decisions" not in name:
                yield name, file.read_text(errors="replace")


def test_nobody_is_told_to_install_an_extra_by_a_name_that_no_index_has() -> None:
    own = ("services/runtime/installation.py", "tests/runtime/test_installation.py")

    assert [name for name, text in texts() if name not in own and "'engage-hri[" in text] == []


def test_every_extra_that_a_message_names_is_one() -> None:
    named = {each for _, text in texts() for each in re.findall(r"extra_command\([\"']([\w-]+)", text)}

    assert named >= {"check", "console", "keys", "reachy-mini", "record", "study", "voice"}
    assert named <= set(EXTRAS)
