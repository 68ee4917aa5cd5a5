"""The core without the tangram, as where its folder was deleted: any import of it fails in these processes."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.real_time

ROOT = Path(__file__).parents[2]
WITHOUT = """\
import sys

class Deleted:
    def find_spec(self, name, path=None, target=None):
        if name.startswith("engage_hri.services.tangram"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Deleted())
"""
COMMAND = f"{WITHOUT}\nfrom engage_hri.services.__main__ import main\nmain()"
IMPORTS = f"""{WITHOUT}
from importlib import import_module

for name in sys.argv[1:]:
    try:
        import_module(name)
    except ModuleNotFoundError as error:
        if not error.name.startswith("engage_hri.services.tangram"):
            raise
        print(name.removeprefix("engage_hri.services."))
"""
EXAMPLE = ("tangram.", "control.mujoco.")
"""What knows the tangram: itself, and the physics, whose room has its table."""
ELSEWHERE = ("frameworks.livekit", "frameworks.pipecat")
"""What cannot be imported without packages that are not here: `make test-frameworks` has them."""
OF_THE_EXAMPLE = {
    "commandline.look.demo", "commandline.shell.config", "commandline.study.session", "commandline.study.simulate",
}  # fmt: skip
"""Modules of the commands that play the tangram."""


def python(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run([sys.executable, "-c", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)


def engage(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return python(COMMAND, *arguments)


def test_no_module_needs_it_but_those_that_play_it() -> None:
    files = (path.relative_to(ROOT).with_suffix("") for path in (ROOT / "services").rglob("*.py"))
    names = sorted(".".join(path.parts[1:]) for path in files if path.name not in ("__init__", "__main__"))
    core = [f"engage_hri.services.{name}" for name in names if not name.startswith((*EXAMPLE, *ELSEWHERE))]

    ended = python(IMPORTS, *core)

    assert ended.returncode == 0, ended.stderr
    assert len(core) > 300
    assert set(ended.stdout.split()) == OF_THE_EXAMPLE


def test_the_commands_are_all_listed() -> None:
    ended = engage("--help")

    assert ended.returncode == 0, ended.stderr
    assert "demo" in ended.stdout


@pytest.mark.parametrize("options", [("plan",), ("play", "--embedded", "--virtual-time")])
def test_a_robot_talks_at_the_table_of_the_core(options: tuple[str, ...], tmp_path: Path) -> None:
    path = tmp_path / "ask.json"
    path.write_text('{"turn_status": "full", "parts": [{"say": "Look at"}, {"refer": "rectangle"}]}')

    ended = engage(*options, str(path))

    assert ended.returncode == 0, ended.stderr


@pytest.mark.parametrize(
    "arguments", [("demo",), ("simulate", "--out", "x"), ("run", "simulation"), ("up", "--task")]
)
def test_what_plays_it_says_how_to_install_it(arguments: tuple[str, ...]) -> None:
    ended = engage(*arguments)

    assert ended.returncode == 2
    assert len(ended.stderr.splitlines()) == 1
    assert "tangram" in ended.stderr
    assert "pip install" in ended.stderr
