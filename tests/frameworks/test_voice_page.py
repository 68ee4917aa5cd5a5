"""What docs/voice-frameworks.md shows: its code names what is there, whether or not a framework is installed."""

import ast
import re
from pathlib import Path

import pytest

from tests.docs.pages import blocks

ROOT = Path(__file__).parents[2]
PAGE = "docs/voice-frameworks.md"
BLOCKS = [each for each in blocks(PAGE, (ROOT / PAGE).read_text()) if each.language == "python"]
ADAPTORS = {"livekit": "RobotOutput", "pipecat": "RobotSpeech", "realtime": "RealtimeSpeech"}


def members(adaptor: str, name: str) -> set[str]:
    """Names that a class of an adaptor has: methods, fields, and parameters of its constructor."""
    tree = ast.parse((ROOT / "services" / "frameworks" / f"{adaptor}.py").read_text())
    [made] = [each for each in ast.walk(tree) if isinstance(each, ast.ClassDef) and each.name == name]
    found = {each.name for each in made.body if isinstance(each, ast.AsyncFunctionDef | ast.FunctionDef)}
    [start] = [each for each in made.body if isinstance(each, ast.FunctionDef) and each.name == "__init__"]
    found |= {each.arg for each in (*start.args.args, *start.args.kwonlyargs)}
    return found | {each.attr for each in ast.walk(start) if isinstance(each, ast.Attribute)}


@pytest.mark.parametrize("block", BLOCKS, ids=str)
def test_the_code_of_a_block_names_what_its_adaptor_has(block: object) -> None:
    tree = ast.parse(f"async def shown():\n    {block.text.replace(chr(10), chr(10) + '    ')}")  # type: ignore[attr-defined]
    [(adaptor, name)] = [
        (each.module.rpartition(".")[2], alias.name)
        for each in ast.walk(tree)
        if isinstance(each, ast.ImportFrom) and each.module and "services.frameworks" in each.module
        for alias in each.names
    ]
    called = [
        each for each in ast.walk(tree)
        if isinstance(each, ast.Call) and isinstance(each.func, ast.Name) and each.func.id == name
    ]  # fmt: skip
    variable = re.search(rf"(\w+) = {name}\(", ast.unparse(tree))
    assert variable is not None
    used = {
        each.attr for each in ast.walk(tree)
        if isinstance(each, ast.Attribute) and isinstance(each.value, ast.Name) and each.value.id == variable[1]
    }  # fmt: skip
    used |= {keyword.arg for each in called for keyword in each.keywords if keyword.arg}

    assert ADAPTORS[adaptor] == name
    assert used <= members(adaptor, name) | {"add_event_handler"}  # of Pipecat's own class


def test_each_adaptor_is_shown_and_the_versions_are_those_of_the_extras() -> None:
    shown = "".join(each.text for each in BLOCKS)
    page, project = (ROOT / PAGE).read_text(), (ROOT / "pyproject.toml").read_text()

    assert all(name in shown for name in ADAPTORS.values())
    for package, version in re.findall(r"(livekit-agents|pipecat-ai) (\d+\.\d+)\.\d+", page):
        assert f'"{package}>={version},' in project
