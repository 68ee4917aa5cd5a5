"""What `import engage_hri` gives: the names it promises, typed, and nothing else loaded before it is used."""

import ast
import asyncio
import inspect
import subprocess
import sys
from asyncio.subprocess import PIPE
from pathlib import Path

import pytest

import engage_hri
from engage_hri.services.commandline.shell.roster import ROBOT
from tests.bus.places import free_endpoint

SOURCE = Path(engage_hri.__file__).read_text(encoding="utf-8")
STAND_INS = ("engage_hri.services.simulation", "engage_hri.services.tangram")
"""Services and data of what a robot does without: a simulated person and table, and the task."""


@pytest.mark.parametrize("name", engage_hri.__all__)
def test_a_public_name_is_there_and_documented(name: str) -> None:
    assert inspect.getdoc(getattr(engage_hri, name))


def test_types_and_values_come_from_the_same_modules() -> None:
    """A checker reads the imports under TYPE_CHECKING, a program the table."""
    imports = [node for node in ast.walk(ast.parse(SOURCE)) if isinstance(node, ast.ImportFrom) and node.module]
    typed = {each.name: node.module for node in imports for each in node.names if each.asname == each.name}

    for name, module in typed.items():
        assert getattr(engage_hri, name) is getattr(sys.modules[str(module)], name)
    assert sorted(typed) == sorted(engage_hri.__all__)


def test_names_that_are_not_there_are_said() -> None:
    with pytest.raises(AttributeError, match="'engage_hri' has no attribute 'nothing'"):
        engage_hri.nothing  # noqa: B018


def test_it_loads_nothing_by_itself() -> None:
    code = "import engage_hri, sys; print([name for name in sys.modules if name.startswith('engage_hri.')])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


@pytest.mark.parametrize("service", ROBOT)
@pytest.mark.real_time
async def test_a_process_that_drives_a_robot_loads_no_simulation(service: str) -> None:
    """From its start until it serves. Python itself tells what it imports."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-v", "-m", "engage_hri", "run", service, "--attended"),
        *("--robot", f"lean-{service}", "--listen", free_endpoint()),
        stdin=PIPE, stderr=PIPE,
    )  # fmt: skip
    assert process.stdin is not None
    assert process.stderr is not None
    told = []
    async with asyncio.timeout(60):
        while line := await process.stderr.readline():
            told.append(line.decode().partition(" #")[0].strip().removeprefix("import ").strip("'"))
            if told[-1] == f"{service} is ready":
                process.stdin.close()
        await process.wait()

    assert f"{service} is ready" in told
    assert f"engage_hri.services.{service}.service" in told
    assert [name for name in told if name.startswith(STAND_INS)] == []
