"""The tool of language models: what its schema allows decodes, and what is wrong is told by JSON path."""

import json
from itertools import product
from typing import Any, get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.check import problems
from engage_hri.schemas.documents.json_codec import encode_json, read
from engage_hri.schemas.export import EXPORTED
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.fragments import TurnFragment, TurnStatus
from engage_hri.schemas.tool import (
    DESCRIPTION,
    FILE,
    PARTS,
    Format,
    ToolInput,
    input_schema,
    is_listed,
    tool_definition,
)
from engage_hri.schemas.world import Entity, World
from engage_hri.services.recognition.config import RecognitionConfig
from tests.random_cases import share_of

SCENE = World(
    entities=(
        Entity(id="cup-1", kind="object", position=(0.5, 0.0, 0.7), category="cup", color="red"),
        Entity(id="red-square", kind="object", position=(0.5, 0.1, 0.7), shape="square", color="red"),
        Entity(id="table", kind="surface", position=(0.5, 0.0, 0.7)),
        Entity(id="ann", kind="person", position=(1.3, 0.0, 1.2)),
        Entity(id="ann-left", kind="hand", position=(1.0, 0.0, 0.7)),
    )
)
CALL = {
    "turn_status": "full",
    "turn_index": 3,
    "expects": "action",
    "parts": [
        {"gesture": "nod"},
        {"say": " Please  take "},
        {"refer": "cup-1", "certainty": "high"},
        {"look": "table"},
        {"say": "and"},
        {"refer": "red-square", "phrases": ["the red square", "that"]},
    ],
}


def decoded(call: object) -> TurnFragment:
    fragment = read(json.dumps(call).encode(), unnamed="f")[0]
    assert isinstance(fragment, TurnFragment)
    return fragment


def function(format: Format, world: World | None = None) -> dict[str, Any]:
    """Name, description and schema, wherever the API has them."""
    tool = tool_definition(format, world)
    return tool["function"] if format == "openai-chat" else tool  # type: ignore[no-any-return]


def schema(format: Format, world: World | None = None) -> dict[str, Any]:
    made = function(format, world)
    found = made["input_schema"] if format == "anthropic" else made["parameters"]
    assert isinstance(found, dict)
    return found


def nodes(schema: object) -> list[dict[str, Any]]:
    if isinstance(schema, dict):
        return [schema] + [node for value in schema.values() for node in nodes(value)]
    if isinstance(schema, list):
        return [node for value in schema for node in nodes(value)]
    return []


def instances(schema: dict[str, Any]) -> st.SearchStrategy[Any]:
    """Everything that the schema allows: the few keywords it uses, read as JSON Schema means them."""
    match schema:
        case {"anyOf": alternatives}:
            return st.one_of(*map(instances, alternatives))
        case {"enum": values}:
            return st.sampled_from(values)
        case {"type": "object", "properties": properties, "required": required, "additionalProperties": False}:
            optional = {name: instances(each) for name, each in properties.items() if name not in required}
            return st.fixed_dictionaries({name: instances(properties[name]) for name in required}, optional=optional)
        case {"type": "array", "items": items}:
            return st.lists(instances(items), max_size=4)
        case {"type": "string"}:
            return st.text(max_size=20)
        case {"type": "boolean"}:
            return st.booleans()
        case {"type": "null"}:
            return st.none()
    raise AssertionError(f"a keyword that nobody expected: {schema}")


FORMATS: tuple[Format, ...] = ("anthropic", "openai", "openai-chat")
EVERY = [schema(format, world) for format, world in product(FORMATS, (None, SCENE))]


@settings(max_examples=share_of(150))
@given(st.sampled_from(EVERY).flatmap(instances))
def test_whatever_the_schema_allows_decodes(call: Any) -> None:
    fragment = decoded(call)

    assert fragment.turn_status == call["turn_status"]
    assert len(fragment.behaviors) == len(call["parts"])
    assert list(problems(fragment)) == []


@pytest.mark.parametrize("schema", EVERY)
def test_the_schema_keeps_to_what_both_apis_constrain_by(schema: dict[str, Any]) -> None:
    known = {"type", "properties", "required", "additionalProperties", "items", "anyOf", "enum", "description"}
    objects = [node for node in nodes(schema) if node.get("type") == "object"]

    assert all(node.keys() <= known for node in nodes(schema) if "type" in node and isinstance(node["type"], str))
    assert all(node["additionalProperties"] is False for node in objects)
    assert "$ref" not in json.dumps(schema)
    first = [next(iter(part["properties"])) for part in schema["properties"]["parts"]["items"]["anyOf"]]
    assert len(set(first)) == len(first) == len(PARTS)


@pytest.mark.parametrize("format", ["openai", "openai-chat"])
def test_openais_strict_functions_require_every_field(format: Format) -> None:
    assert function(format)["strict"] is True
    for node in nodes(schema(format)):
        if node.get("type") == "object":
            assert node["required"] == list(node["properties"])


def test_the_description_of_the_tool_is_no_longer_than_chat_completions_take() -> None:
    """1024 characters. Descriptions of parameters, which name the objects of a world, may be of any length."""
    assert len(DESCRIPTION) <= 1024


def test_each_api_gets_the_form_it_takes() -> None:
    assert tool_definition("anthropic").keys() == {"name", "description", "input_schema"}
    assert tool_definition("openai").keys() == {"type", "name", "description", "strict", "parameters"}
    assert tool_definition("openai-chat").keys() == {"type", "function"}
    assert len({function(format)["name"] for format in FORMATS}) == 1
    assert len(function("anthropic")["description"]) < 1024  # what OpenAI takes


def test_a_model_is_told_the_limits_that_recognition_has() -> None:
    usual = RecognitionConfig()
    told = input_schema()["properties"]["within"]["description"]

    assert f"{usual.adjacency_pair_limit:g} for a reply, {usual.manipulation_limit:g} for an action" in told


def test_a_model_is_told_what_it_may_not_say_again_without_asking() -> None:
    told = function("anthropic")["description"]

    assert "`unknown` means that a part of the robot has failed" in told
    assert "After `refused`, nothing has been said or done." in told


def test_what_must_be_there_is_required_and_everything_is_explained() -> None:
    made = input_schema()
    objects = [node for node in nodes(made) if node.get("type") == "object"]

    assert made["required"] == ["turn_status", "parts"]
    assert all(field["description"] for node in objects for field in node["properties"].values())
    for missing in made["required"]:
        with pytest.raises(InputRefused):
            decoded({key: value for key, value in CALL.items() if key != missing} | {"expects": "reply"})


def test_the_statuses_and_the_fields_are_those_of_the_code() -> None:
    made = input_schema()

    assert set(made["properties"]) == set(ToolInput.__struct_fields__)
    assert set(made["properties"]["turn_status"]["enum"]) == set(get_args(TurnStatus))


@pytest.mark.parametrize("who", [False, True, "*", "ann", ("ann", "bob")])
def test_who_may_interrupt_is_as_in_a_fragment_and_left_out_it_is_as_usual(who: object) -> None:
    said = decoded({**CALL, "interruptible": who, "interruptible_after": 2})
    usual = decoded(CALL)

    assert (said.interruptible, said.interruptible_after) == (who, 2)
    assert (usual.interruptible, usual.interruptible_after) == (None, None)


def test_the_exported_tool_is_anthropics() -> None:
    assert json.loads((EXPORTED / FILE).read_bytes()) == tool_definition("anthropic")


def test_a_known_world_leaves_only_its_ids_and_tells_what_they_look_like() -> None:
    made = input_schema(SCENE)
    _, refer, look, _ = (part["properties"] for part in made["properties"]["parts"]["items"]["anyOf"])

    one, several = refer["refer"]["anyOf"]
    assert (one["enum"], several["items"]["enum"]) == (["cup-1", "red-square"], ["cup-1", "red-square"])
    assert refer["refer"]["description"].endswith("There are: cup-1 (red cup), red-square.")
    assert look["look"]["enum"] == ["cup-1", "red-square", "table", "ann"]
    one, several = made["properties"]["addressee"]["anyOf"]
    assert (one["enum"], several["items"]["enum"]) == (["", "*", "ann"], ["ann"])


@pytest.mark.parametrize(
    ("people", "objects", "listed"),
    [(300, 300, False), (0, 250, True), (125, 125, True), (250, 0, True), (1, 250, False), (600, 600, False)],
)
def test_the_ids_of_a_big_world_stay_within_the_values_that_a_schema_may_list(
    people: int, objects: int, listed: bool
) -> None:
    """OpenAI's strict functions take 1000 values in all; lists that do not fit are left out."""
    world = World(
        entities=(
            *(Entity(id=f"p{n}", kind="person", position=(1.0, 0.0, 1.0)) for n in range(people)),
            *(Entity(id=f"o{n}", kind="object", position=(1.0, 0.0, 1.0)) for n in range(objects)),
        )
    )

    def values(schema: object) -> int:
        if isinstance(schema, dict):
            return sum(len(part) if name == "enum" else values(part) for name, part in schema.items())
        return sum(map(values, schema)) if isinstance(schema, list) else 0

    assert values(input_schema(world)) <= 1000
    assert is_listed(world) is listed
    assert (values(input_schema(world)) > values(input_schema())) is listed


def test_an_empty_world_forbids_nothing() -> None:
    assert input_schema(World(entities=())) == input_schema()


def test_parts_become_behaviors_one_after_the_other() -> None:
    fragment = decoded(CALL)

    assert (fragment.id, fragment.turn_index, fragment.accept) == ("f", 3, ("act", "speak", "nod", "shake"))
    assert [behavior.id for behavior in fragment.behaviors] == [
        "gesture-1", "say-2", "refer-3", "look-4", "say-5", "refer-6",
    ]  # fmt: skip
    after = [(operator.ref, operator.syncs) for each in fragment.constraints for operator in each.operators]
    assert after == [
        ("say-2:end", ("refer-3:start",)),
        ("refer-3:end", ("look-4:start",)),
        ("look-4:stroke", ("say-5:start",)),
        ("say-5:end", ("refer-6:start",)),
    ]


def test_a_list_of_ids_is_one_reference_to_all_of_them() -> None:
    (reference,) = decoded({"turn_status": "full", "parts": [{"refer": ["cup-1", "red-square"]}]}).behaviors

    assert reference.target == "cup-1 + red-square"  # type: ignore[union-attr]


def test_phrases_are_proposed_unless_given_and_words_that_need_a_point_are_known() -> None:
    cup, square = (each for each in decoded(CALL).behaviors if each.id.startswith("refer"))

    assert (cup.minimum_reliability, cup.options) == (0.95, None)  # type: ignore[union-attr]
    assert square.minimum_reliability is None  # type: ignore[union-attr]  # generation's default
    assert [(o.text, o.cost, o.deictic) for o in square.options] == [  # type: ignore[union-attr]
        ("the red square", 3.0, False), ("that", 1.0, True),
    ]  # fmt: skip


@pytest.mark.parametrize("status", get_args(TurnStatus))
def test_only_who_goes_on_can_think(status: str) -> None:
    thinks = decoded({"turn_status": status, "parts": [], "thinking": True}).delay

    assert thinks == (status in ("beginning", "middle"))


def test_the_full_fragment_is_accepted_too() -> None:
    fragment = decoded(CALL)

    assert read(json.dumps({"id": "g", "turn_status": "end", "behaviors": []}).encode())[0].id == "g"
    assert decoded(json.loads(encode_json(fragment))) == fragment


PART = {"say": "hello"}


@pytest.mark.parametrize(
    ("call", "where", "reason", "advice"),
    [
        ({"turn_status": "ful", "parts": []}, "$.turn_status", "'ful'", "one of beginning, middle, end, full"),
        ({"turn_status": "full"} | {"parts": None}, "$", "`parts`", '"parts": [{"say"'),
        ({"turn_status": "full", "parts": [PART, {"saay": "x"}]}, "$.parts[1]", "only 'saay'", "say, refer, look"),
        ({"turn_status": "full", "parts": [{}]}, "$.parts[0]", "nothing", "exactly one of"),
        ({"turn_status": "full", "parts": [{"say": "x", "refer": "y"}]}, "$.parts[0]", "2 of them", "exactly one"),
        ({"turn_status": "full", "parts": [{"refer": 7}]}, "$.parts[0].refer", "Expected `str | array`", ""),
        ({"turn_status": "full", "parts": [{**PART, "to": "ann"}]}, "$.parts[0]", "`to`", "known: say"),
        ({"turn_status": "full", "parts": [{"refer": "x", "phrases": "it"}]}, "$.parts[0].phrases", "`array`", ""),
        (
            {"turn_status": "full", "parts": [{"refer": "x", "certainty": "sure"}]},
            "$.parts[0].certainty", "'sure'", "normal, high",
        ),
        ({"turn_status": "full", "parts": [], "turn_index": 4}, "$.turn_index", "4", "1, 2, 3"),
        ({"turn_status": "full", "parts": [], "speed": 2}, "$", "`speed`", "known: turn_status, parts"),
        ({"turn_status": "full", "parts": ["hello"]}, "$.parts[0]", "Expected `object`", ""),
    ],
)  # fmt: skip
def test_a_bad_call_is_refused_with_its_path_and_advice(call: Any, where: str, reason: str, advice: str) -> None:
    with pytest.raises(InputRefused) as refused:
        decoded(call)

    assert refused.value.fault.where == where
    assert reason in refused.value.fault.reason
    assert advice in refused.value.fault.advice


def test_calls_in_an_array_are_numbered() -> None:
    things = read(json.dumps([CALL, CALL]).encode(), "talk.json", "talk")

    assert [thing.id for thing in things] == ["talk-1", "talk-2"]


def test_the_lines_of_what_is_said_stay_and_blanks_are_single() -> None:
    (speech,) = decoded({"turn_status": "full", "parts": [{"say": " - one  item\n\n-  two "}]}).behaviors

    assert speech == Speech(id="say-1", text="- one item\n\n- two")
