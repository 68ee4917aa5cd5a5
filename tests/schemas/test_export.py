"""The exported schemas are what the code says: what the codec writes fits them, and what it refuses does not."""

import json
from pathlib import Path
from random import Random
from typing import Any, get_args

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from jsonschema import Draft202012Validator
from referencing import Registry, Resource

from engage_hri.schemas import messages
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.json_codec import encode_json
from engage_hri.schemas.export import BUNDLE, EXPORTED, ID, bundle, files, stale, write
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.messages import Message, decode
from tests.random_cases import share_of
from tests.rigs.hostile.typed import RandomMessages, Words, distorted
from tests.schemas.strategies import blocks, fragments

SCHEMA: dict[str, Any] = json.loads((EXPORTED / BUNDLE).read_bytes())
REGISTRY: Registry[Any] = Registry().with_resource(ID, Resource.from_contents(SCHEMA)).crawl()
"""Crawled once: what has not been is crawled anew at each look-up of a name."""
MESSAGES = [kind.__name__ for kind in get_args(Message)]
quick = settings(max_examples=share_of(30), suppress_health_check=[HealthCheck.too_slow], deadline=None)


def validator(name: str) -> Draft202012Validator:
    """Of one definition, as a stranger asks for it."""
    return Draft202012Validator({"$ref": f"{ID}#{name}"}, registry=REGISTRY)


def refusal(message: object) -> str:
    """Why no process takes it, as it is on the bus; empty if all do."""
    try:
        decode(msgspec.json.encode(message), "application/json")
    except InputRefused as error:
        return str(error)
    return ""


def test_the_exported_schemas_are_not_stale() -> None:
    assert stale() == [], "run make generate"


def test_the_bundle_is_a_schema() -> None:
    Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize("name", [*MESSAGES, "Block", "TurnFragment", "Line"])
def test_a_definition_is_found_by_pointer_and_by_name(name: str) -> None:
    resolver = REGISTRY.resolver(ID)

    by_pointer = resolver.lookup(f"#/$defs/{name}").contents
    assert by_pointer is not None
    assert resolver.lookup(f"{ID}#{name}").contents == by_pointer


def test_every_reference_leads_to_a_definition() -> None:
    found = set(_references(SCHEMA))

    assert {"#/$defs/TurnFragment", "#/$defs/Stamp"} <= found
    assert found <= {f"#/$defs/{name}" for name in SCHEMA["$defs"]}


def _references(node: object) -> list[str]:
    if isinstance(node, dict):
        own = [node["$ref"]] if isinstance(node.get("$ref"), str) else []
        return own + [found for value in node.values() for found in _references(value)]
    if isinstance(node, list):
        return [found for value in node for found in _references(value)]
    return []


def test_units_are_in_the_schema() -> None:
    assert bundle()["$defs"]["SyncPointProgress"]["properties"]["time"] == {
        "description": "seconds",
        "type": "number",
    }


@pytest.mark.parametrize("name", MESSAGES)
def test_what_the_codec_writes_fits_and_what_fits_it_reads(name: str) -> None:
    """Random messages as they are, and each with one thing in it of the wrong type, missing or too much."""
    chance = Random(name)
    typed, fits = RandomMessages(chance, Words()), validator(name)
    verdicts = set()
    for _ in range(60):
        message = typed.message(1.0, name)
        good, doubtful = (json.loads(msgspec.json.encode(each)) for each in (message, distorted(chance, message)))
        if not refusal(good):
            fits.validate(good)
        verdicts.add(is_fit := fits.is_valid(doubtful))
        assert not (is_fit and refusal(doubtful)), doubtful

    assert verdicts == {False, True}


def test_the_whole_bundle_is_any_message() -> None:
    whole = Draft202012Validator(SCHEMA)

    assert whole.is_valid({"type": "peer_alive", "participant": "control"})
    assert not whole.is_valid({"type": "peer_alive"})
    assert not whole.is_valid({"type": "block", "id": "b"})


@quick
@given(blocks())
def test_a_block_as_it_is_written_fits(block: Block) -> None:
    validator("Block").validate(json.loads(encode_json(block)))


@quick
@given(fragments())
def test_a_fragment_as_it_is_written_fits(fragment: TurnFragment) -> None:
    validator("TurnFragment").validate(json.loads(encode_json(fragment)))


def test_every_line_of_watch_fits() -> None:
    typed, fits, seen = RandomMessages(Random(5), Words()), validator("Line"), set()
    for name in MESSAGES * 10:
        message = typed.message(1.0, name)
        if not refusal(message) and (line := messages.line(message)) is not None:
            fits.validate(json.loads(line))
            seen.add(json.loads(line)["type"])

    assert seen == {kind.__struct_config__.tag for kind in get_args(messages.LineMessage)}


def test_a_stale_file_is_noticed_and_put_right(tmp_path: Path) -> None:
    write(tmp_path)
    (tmp_path / BUNDLE).write_text("{}")
    (tmp_path / "Gone.json").write_text("{}")
    missing = next(name for name in files() if name != BUNDLE)
    (tmp_path / missing).unlink()

    noticed = stale(tmp_path)
    changed = write(tmp_path)

    assert noticed == changed == ["Gone.json", BUNDLE, missing]
    assert stale(tmp_path) == []
