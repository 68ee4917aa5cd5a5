"""What `import engage_hri` gives: the names it promises, typed, and nothing else loaded before it is used."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import engage_hri

SOURCE = Path(engage_hri.__file__).read_text(encoding="utf-8")


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


def test_a_service_that_drives_a_robot_loads_no_simulation() -> None:
    """Its configuration is data; the torso is loaded when control is given no other body."""
    code = (
        "import sys; from engage_hri.services.commandline import roster; "
        "from engage_hri.services.commandline.config import Config; "
        "[roster.service(name, Config()) for name in roster.ROBOT]; "
        "print(*sorted(name for name in sys.modules if 'services.simulation.' in name or 'torso' in name))"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()

    assert loaded == ["engage_hri.services.simulation.config"]
