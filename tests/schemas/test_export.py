"""The exported JSON Schemas are what the code says, and what the codec writes fits them."""

from pathlib import Path

import pytest

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.export import exported_types, files, main, schema, stale, write
from engage_hri.schemas.feedback import SyncPointProgress
from engage_hri.schemas.fragments import TurnFragment


def test_the_exported_schemas_are_not_stale() -> None:
    assert stale() == [], "run python -m engage_hri.schemas.export"


def test_every_message_and_both_inputs_are_exported() -> None:
    assert {"Block.json", "TurnFragment.json", "SyncPointReached.json"} <= files().keys()
    assert len(files()) == len(exported_types()) + 2  # JSON lines, and the tool of language models


def test_units_are_in_the_schema() -> None:
    time = schema(SyncPointProgress)["$defs"]["SyncPointProgress"]["properties"]["time"]

    assert time == {"description": "seconds", "type": "number"}


@pytest.mark.parametrize("kind", [Block, TurnFragment])
def test_a_schema_is_complete_in_itself(kind: type[Block] | type[TurnFragment]) -> None:
    exported = schema(kind)

    references = set(_references(exported))
    assert references <= {f"#/$defs/{name}" for name in exported["$defs"]}
    assert f"#/$defs/{kind.__name__}" in references


def _references(node: object) -> list[str]:
    if isinstance(node, dict):
        own = [node["$ref"]] if isinstance(node.get("$ref"), str) else []
        return own + [found for value in node.values() for found in _references(value)]
    if isinstance(node, list):
        return [found for value in node for found in _references(value)]
    return []


def test_a_stale_file_is_noticed_and_put_right(tmp_path: Path) -> None:
    write(tmp_path)
    (tmp_path / "Block.json").write_text("{}")
    (tmp_path / "Gone.json").write_text("{}")
    (tmp_path / "World.json").unlink()

    noticed = stale(tmp_path)
    changed = write(tmp_path)

    assert noticed == changed == ["Block.json", "Gone.json", "World.json"]
    assert stale(tmp_path) == []


def test_check_fails_when_stale(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("engage_hri.schemas.export.stale", lambda: ["Block.json"])

    assert main(["--check"]) == 1
    assert "Block.json" in capsys.readouterr().err
