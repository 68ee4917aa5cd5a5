"""The examples do what they show."""

import re
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import msgspec
import pytest

from engage_hri.schemas.documents.json_codec import read
from engage_hri.schemas.summary import Summary
from engage_hri.schemas.tool import ToolInput

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"


def example(name: str) -> ModuleType:
    spec = spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


async def test_a_streaming_model_learns_that_nobody_looked_and_makes_itself_clear(
    capsys: pytest.CaptureFixture[str],
) -> None:
    streaming = example("stream_from_generator")
    async with streaming.embedded(human="listening") as robot:
        greeting, repeated, request, goodbye = await streaming.converse(robot)

    assert greeting.said.startswith("Hello! I could use your help")
    assert [(each.by, each.looked) for each in greeting.references] == [("a look", False)]
    assert [(each.object, each.by, each.looked) for each in repeated.references] == [("red-square", "pointing", True)]
    assert request.said.startswith("Good. Please move this so that")
    assert (request.answer, request.references[0].looked) == ("act", True)
    assert goodbye.said == streaming.GOODBYE
    assert {each.status for each in (greeting, repeated, request, goodbye)} == {"done"}
    printed = capsys.readouterr().out
    assert printed.count("model:  ") == 4
    assert all(len(line) < 500 for line in printed.splitlines())


async def test_a_model_that_listens_acts_on_what_it_heard(capsys: pytest.CaptureFixture[str]) -> None:
    listening = example("listening_model")
    async with listening.of_our_own() as robot:
        choice, corrected, agreed, last = await listening.converse(robot)

    assert [each.heard[0].text for each in (choice, corrected, agreed)] == list(listening.ANSWERS)
    assert {each.answered_by for each in (choice, corrected, agreed)} == {"ann"}
    assert [each.references[0].object for each in (corrected, agreed, last)] == [
        "red-square", "blue-square", "blue-square",
    ]  # fmt: skip
    assert not last.heard
    assert {each.status for each in (choice, corrected, agreed, last)} == {"done"}
    assert capsys.readouterr().out.count("model:  ") == 4


def test_what_the_page_on_language_models_shows_is_so() -> None:
    page = (ROOT / "docs" / "language-models.md").read_text()
    call, result = re.findall("```json\n(.*?)```", page, re.DOTALL)
    fields = re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)

    fragment = read(call.encode())[0]
    told = msgspec.json.decode(result, type=Summary, strict=True)
    assert [each.id for each in fragment.behaviors] == ["say-1", "refer-2", "say-3", "refer-4"]
    assert msgspec.json.decode(told.json) == msgspec.json.decode(result)
    assert set(fields) == {*ToolInput.__struct_fields__, *Summary.__struct_fields__} - {"cut_short", "answer_delay"}
