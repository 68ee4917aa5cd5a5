"""Tool for language models, `perform_turn_fragment`: its description and the form of its input.

The form is smaller than a turn fragment: parts in the order in which they are to be said and done, without gestures,
timing and ids, which Engage finds. `schemas/tool_call.py` makes the fragment. The JSON Schema is made from the
structs
below and uses only what both APIs constrain sampling by: closed objects, no `$ref`, no bounds, no defaults, and
alternatives of a part that differ in their first key.
"""

from typing import Annotated, Any, Literal, get_args

import msgspec
from msgspec import Meta, Struct

from engage_hri.schemas.fragments import TurnStatus
from engage_hri.schemas.world import Entity, World

NAME = "perform_turn_fragment"
FILE = f"{NAME}.tool.json"
"""Name of the file in the folder of exported schemas."""
DESCRIPTION = """\
Speak as the robot, to the person in front of it. Say what is to be said and name the objects you mean by their ids; \
the robot finds the words for them, where to look, when to point, and the timing. It returns once this has been \
performed, with what was really said, whether the person looked where you referred to and at the robot's face, and \
what went wrong. If they did not look at an object that matters, refer to it again with certainty `high`. Status \
`unknown` means that a part of the robot has failed: more may have been said and done than is told, so ask the \
person before you say it again. After `refused`, nothing has been said or done."""

Format = Literal["anthropic", "openai", "openai-chat"]
"""Forms for Anthropic's Messages API, OpenAI's Responses API, and the Chat Completions API of many others."""
Expects = Literal["reply", "action"]
Certainty = Literal["normal", "high"]

ObjectId = Annotated[
    str,
    Meta(description="Id of an object, exactly as the world calls it. Never write ids into words to be spoken."),
]


class Say(Struct, frozen=True, kw_only=True, omit_defaults=True, forbid_unknown_fields=True):
    say: Annotated[str, Meta(description="Words to speak. Leave out the words for an object: use `refer` for it.")]


class Refer(Struct, frozen=True, kw_only=True, omit_defaults=True, forbid_unknown_fields=True):
    refer: ObjectId
    phrases: Annotated[
        tuple[str, ...],
        Meta(
            description="Only if the words matter: noun phrases to choose from, each of which fits the sentence "
            "and means this object alone. Leave it out and the robot finds them."
        ),
    ] = ()
    certainty: Annotated[
        Certainty,
        Meta(
            description="`normal` if left out. `high` if the person must not mistake it, or has not looked there "
            "before: then the robot usually points."
        ),
    ] = "normal"


class Look(Struct, frozen=True, kw_only=True, omit_defaults=True, forbid_unknown_fields=True):
    look: Annotated[
        str,
        Meta(
            description="Id of an object, surface or person to look at before what follows is said. Seldom needed: "
            "the robot looks at what it refers to, and at the person at the end of a turn."
        ),
    ]


class Gesture(Struct, frozen=True, kw_only=True, omit_defaults=True, forbid_unknown_fields=True):
    gesture: Annotated[Literal["nod", "shake"], Meta(description="Nod or shake the head while what follows is said.")]


Part = Say | Refer | Look | Gesture
"""Part of a turn. Its first key says which kind it is."""
PARTS: tuple[type[Part], ...] = get_args(Part)


class ToolInput(Struct, frozen=True, kw_only=True, omit_defaults=True, forbid_unknown_fields=True):
    """Input of the tool, as the model writes it.

    parts: each is a `Part`, which msgspec can't express without tags.
    """

    turn_status: Annotated[
        TurnStatus,
        Meta(
            description="`full`: all you have to say for now; the robot hands over by looking at the person. If you "
            "have much to say, or must think or look something up meanwhile, send it in pieces, each as soon as you "
            "have it: `beginning`, then any number of `middle`, then `end`, which hands over. Nothing else may "
            "follow before the `end`. `backchannel`: a short sign of listening while the person has the turn."
        ),
    ]
    parts: Annotated[
        tuple[dict[str, Any], ...],
        Meta(description="What to say and do, in this order. With `end` it may be empty if all has been said."),
    ]
    turn_index: Annotated[
        Literal[1, 2, 3],
        Meta(
            description="1, or left out: you open an exchange and expect an answer. 2: you answer what the person "
            "just said or asked. 3: you close an exchange (thanks, well done)."
        ),
    ] = 1
    expects: Annotated[
        Expects,
        Meta(
            description="`reply`, or left out: words, a nod, a shake of the head or pointing answers this turn. "
            "`action`: you ask for something to be done to an object, and doing it is the answer."
        ),
    ] = "reply"
    thinking: Annotated[
        bool,
        Meta(
            description="With `beginning` or `middle`: true if you need time before the next piece. The robot looks "
            "away then, as people do, and keeps the turn for up to 10 seconds."
        ),
    ] = False
    addressee: Annotated[
        str, Meta(description="Id of the person to speak to; left out or empty if there is only one.")
    ] = ""
    within: Annotated[
        Literal[0, 3, 6, 10, 20, 30, 60],
        Meta(
            description="Seconds that the person has to answer, if not as usual (4 for a reply, 8 for an action): "
            "6 for a question to think about. 0, or left out: as usual."
        ),
    ] = 0


Schema = dict[str, Any]

MOST_IDS, MOST_LETTERS = 250, 15_000
"""Ids that a world may have, and letters in these, to be listed: the APIs take 1000 values in all lists of a schema,
and 15 000 letters in a list of more than 250."""


def tool_definition(format: Format = "anthropic", world: World | None = None) -> Schema:
    """Make the tool as an entry of the API's `tools`.

    OpenAI's are strict (every field required, null where it may be left out); to have Anthropic's so, add
    `"strict": true`.

    format: for Anthropic's Messages API, OpenAI's Responses API, or the Chat Completions API of many others.
    world: only the ids of its objects and people are allowed; None: any. If it has more than the APIs take as values
        (`is_listed` tells), the fields take any text, and Engage refuses what is no id.

    Raises:
        ValueError: there is no such format.
    """
    if format not in get_args(Format):
        raise ValueError(f"no format {format!r}: there are {', '.join(get_args(Format))}")
    if format == "anthropic":
        return {"name": NAME, "description": DESCRIPTION, "input_schema": input_schema(world)}
    function = {
        "name": NAME, "description": DESCRIPTION, "strict": True, "parameters": _all_required(input_schema(world)),
    }  # fmt: skip
    return {"type": "function", **function} if format == "openai" else {"type": "function", "function": function}


def input_schema(world: World | None = None) -> Schema:
    """JSON Schema of `ToolInput`. Every input that it allows is decoded by `schemas/tool_call.py`."""
    parts = [_schema_of(kind) for kind in PARTS]
    whole = _schema_of(ToolInput)
    whole["properties"]["parts"]["items"] = {"anyOf": parts}
    if world is not None:
        _, refer, look, _ = parts
        if is_listed(world):
            people = [person.id for person in world.people]
            for schema, field, ids in (
                (whole, "addressee", ["", *people] if people else []),
                (refer, "refer", [thing.id for thing in world.objects]),
                (look, "look", [each.id for each in world.entities if each.kind != "hand"]),
            ):
                if ids:
                    schema["properties"][field]["enum"] = ids
        if told := _inventory(world):
            refer["properties"]["refer"]["description"] += f" There are: {told}."
    return whole


def is_listed(world: World) -> bool:
    """Tell whether the tool of this world lists its ids; else its readers would not take as many."""
    return len(world.entities) <= MOST_IDS and sum(len(each.id) for each in world.entities) <= MOST_LETTERS


def _schema_of(kind: type[Struct]) -> Schema:
    """Schema of one struct: closed, without titles and defaults, which the descriptions tell."""
    _, components = msgspec.json.schema_components((kind,))
    (component,) = components.values()
    properties = {name: _stripped(each) for name, each in component["properties"].items()}
    return {
        "type": "object",
        "properties": properties,
        "required": component["required"],
        "additionalProperties": False,
    }


def _stripped(schema: Schema) -> Schema:
    stripped = {key: value for key, value in schema.items() if key != "default"}
    if "enum" in stripped:
        numbers = all(isinstance(value, int) for value in stripped["enum"])
        stripped = {"type": "integer" if numbers else "string", **stripped}
    return stripped


def _inventory(world: World) -> str:
    return ", ".join(f"{thing.id} ({looks})" if (looks := _looks(thing)) else thing.id for thing in world.objects)


def _looks(thing: Entity) -> str:
    """Looks of an object in words, as perception knows them; empty if its id says all of it."""
    noun = thing.category or ("" if thing.shape else thing.name)
    words = [thing.size, thing.color, *thing.features, thing.shape, noun]
    said = thing.id.lower()
    return "" if all(word.lower() in said for word in words) else " ".join(filter(None, words))


def _all_required(schema: Schema) -> Schema:
    """Change a schema for OpenAI's strict functions: an optional key is required, and may be null."""
    if "anyOf" in schema:
        return {**schema, "anyOf": [_all_required(each) for each in schema["anyOf"]]}
    if "items" in schema:
        return {**schema, "items": _all_required(schema["items"])}
    if "properties" not in schema:
        return schema
    properties = {
        name: _all_required(each) if name in schema["required"] else _nullable(each)
        for name, each in schema["properties"].items()
    }
    return {**schema, "properties": properties, "required": list(properties)}


def _nullable(schema: Schema) -> Schema:
    rest = {key: value for key, value in schema.items() if key != "description"}
    return {"description": schema["description"], "anyOf": [_all_required(rest), {"type": "null"}]}
