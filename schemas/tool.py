"""Tool for language models, `perform_turn_fragment`: its description, the form of its input, and what is made of it.

The form is smaller than a turn fragment: parts in the order in which they are to be said and done, without gestures,
timing and ids, which Engage finds. The JSON Schema is made from the structs below and uses only what both APIs
constrain sampling by: closed objects, no `$ref`, no bounds, no defaults, and alternatives of a part that differ in
their first key. Bad input is refused with its JSON path, so that the model can correct itself.
"""

import re
from collections.abc import Iterable
from typing import Annotated, Any, Literal, get_args

import msgspec
from msgspec import Meta, Struct
from msgspec.structs import replace

from engage_hri.schemas import behaviors as of
from engage_hri.schemas.advice import allowed
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import EVERYBODY, TurnFragment, TurnStatus
from engage_hri.schemas.text import word_count
from engage_hri.schemas.units import Probability
from engage_hri.schemas.world import TOGETHER, Entity, World

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


class Say(Struct, frozen=True, kw_only=True, omit_defaults=True, forbid_unknown_fields=True):
    say: Annotated[str, Meta(description="Words to speak. Leave out the words for an object: use `refer` for it.")]


class Refer(Struct, frozen=True, kw_only=True, omit_defaults=True, forbid_unknown_fields=True):
    refer: Annotated[
        str | tuple[str, ...],
        Meta(
            description="Id of an object, exactly as the world calls it, or a list of ids to mean several at once "
            '("these"). Never write ids into words to be spoken.'
        ),
    ]
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
        str | tuple[str, ...],
        Meta(
            description="Id of the person to speak to, a list of ids, or `*` for all; left out or empty if there is "
            "only one."
        ),
    ] = ""
    interruptible: Annotated[
        bool | str | tuple[str, ...],
        Meta(
            description="Who may interrupt it: an id, a list of ids, `*` for anybody, false for nobody, as in a "
            "warning; left out or empty: those you speak to. Of a turn in pieces the `beginning` says it for all."
        ),
    ] = ""
    interruptible_after: Annotated[
        Literal[0, 1, 2, 4],
        Meta(
            description="Seconds for which somebody has to speak to interrupt it. 0, or left out: at once, or as "
            "the `beginning` said."
        ),
    ] = 0
    within: Annotated[
        Literal[0, 3, 6, 10, 20, 30, 60],
        Meta(
            description="Seconds that the person has to answer, if not as usual (6 for a reply, 8 for an action): "
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
    """JSON Schema of `ToolInput`. Every input that it allows is decoded by `from_tool`."""
    parts = [_schema_of(kind) for kind in PARTS]
    whole = _schema_of(ToolInput)
    whole["properties"]["parts"]["items"] = {"anyOf": parts}
    if world is not None:
        _, refer, look, _ = parts
        if is_listed(world):
            people = [person.id for person in world.people]
            things = [thing.id for thing in world.objects]
            one, several = whole["properties"]["addressee"]["anyOf"]
            one_thing, several_things = refer["properties"]["refer"]["anyOf"]
            for schema, ids in (
                (one, ["", EVERYBODY, *people] if people else []),
                (several["items"], people),
                (one_thing, things),
                (several_things["items"], things),
                (look["properties"]["look"], [each.id for each in world.entities if each.kind != "hand"]),
            ):
                if ids:
                    schema["enum"] = ids
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


RELIABILITY: dict[Certainty, Probability | None] = {"normal": None, "high": 0.95}
"""Minimum reliability of a reference: generation's default, or that of the pieces to be moved in thesis Appendix
B."""
ANSWERS: dict[Expects, tuple[of.Action, ...]] = {"reply": (), "action": ("act", "speak", "nod", "shake")}
"""Actions that answer the turn; empty: recognition's default."""
DEMONSTRATIVES = ("this", "that")
"""First words of phrases that need a pointing gesture."""

_BEHAVIOR = re.compile(r"\$\.behaviors\[(?P<index>\d+)\](?:\.options\[(?P<option>\d+)\])?[\w.\[\]]*")
EXAMPLE = '{"turn_status": "full", "parts": [{"say": "Hello."}]}'
CALL = f"for example {EXAMPLE}"
"""Advice for a call that is none."""
_KINDS = {kind.__struct_fields__[0]: kind for kind in PARTS}
_OF_CALLS = {*_KINDS, *ToolInput.__struct_fields__} - {*TurnFragment.__struct_fields__}
"""Keys by which a call, or a part of one, is known: a fragment has none of them."""


def is_tool_input(parsed: dict[str, Any]) -> bool:
    """Tell whether decoded JSON is a tool input, and no turn fragment or block."""
    if "behaviors" in parsed:
        return False
    is_named = "id" in parsed or "type" in parsed
    return "parts" in parsed or (not is_named and not parsed.keys().isdisjoint(_OF_CALLS))


def from_tool(parsed: dict[str, Any], id: str, source: str = "", path: str = "$") -> TurnFragment:
    """Make a fragment from a decoded tool input. Raises InputRefused with source, JSON path and advice."""
    call = _converted(parsed, ToolInput, source, path)
    parts = [_part(raw, source, f"{path}.parts[{index}]") for index, raw in enumerate(call.parts)]
    return replace(fragment_of(parts, replace(call, parts=()), id), from_parts=True)


def in_call(where: str, fragment: TurnFragment) -> str:
    """Translate a JSON path in a fragment to that of the author: in a tool call the part instead of the behavior."""
    return _BEHAVIOR.sub(lambda found: _part_of(found, fragment), where) if fragment.from_parts else where


def _part_of(found: re.Match[str], fragment: TurnFragment) -> str:
    index = int(found["index"])
    kind = fragment.behaviors[index].id.partition("-")[0]
    option = found["option"]
    return f"$.parts[{index}].{kind if option is None else f'phrases[{option}]'}"


def fragment_of(parts: Iterable[Part], turn: ToolInput, id: str) -> TurnFragment:
    """Make a fragment that says and does `parts` in this order. turn: gives everything else; its parts are ignored.

    A behavior is named after its part: `say-1`, `refer-2`.
    """
    behaviors: list[of.FragmentBehavior] = []
    order: list[of.Constraint] = []
    before = ""
    for number, part in enumerate(parts, start=1):
        behavior, resume = _behavior(part, number)
        if before:
            after = of.After(ref=before, syncs=(f"{behavior.id}:start",))
            order.append(of.Constraint(id=f"order-{number}", operators=(after,)))
        behaviors.append(behavior)
        before = f"{behavior.id}:{resume}" if resume else before
    return TurnFragment(
        id=id,
        turn_status=turn.turn_status,
        turn_index=turn.turn_index,
        behaviors=tuple(behaviors),
        constraints=tuple(order),
        addressee=turn.addressee,
        interruptible=None if turn.interruptible in ("", ()) else turn.interruptible,
        interruptible_after=turn.interruptible_after or None,
        delay=turn.thinking and turn.turn_status in ("beginning", "middle"),
        accept=ANSWERS[turn.expects],
        within=turn.within or None,
    )


def _behavior(part: Part, number: int) -> tuple[of.FragmentBehavior, str]:
    """Behavior of a part, and its sync point at which the next behavior may start; empty: at once."""
    match part:
        case Say(say=text):
            return of.Speech(id=f"say-{number}", text=_in_lines(text)), "end"
        case Refer(refer=target, phrases=phrases, certainty=certainty):
            reference = of.Reference(
                id=f"refer-{number}",
                target=target if isinstance(target, str) else TOGETHER.join(target),
                minimum_reliability=RELIABILITY[certainty],
                options=tuple(map(_option, phrases)) if phrases else None,
            )
            return reference, "end"
        case Look(look=target):
            return of.Gaze(id=f"look-{number}", target=target), "stroke"
        case Gesture(gesture=gesture):
            return of.Head(id=f"gesture-{number}", lexeme=gesture.upper()), ""


def _option(phrase: str) -> of.SpeechOption:
    words = phrase.split()
    deictic = bool(words) and words[0].lower() in DEMONSTRATIVES
    return of.SpeechOption(text=" ".join(words), cost=word_count(phrase), deictic=deictic)


def _part(raw: dict[str, Any], source: str, path: str) -> Part:
    kinds = [_KINDS[key] for key, value in raw.items() if key in _KINDS and value is not None]
    if len(kinds) != 1:
        found = f"{len(kinds)} of them" if kinds else f"only {', '.join(map(repr, raw)) or 'nothing'}"
        advice = f"give each part exactly one of {', '.join(_KINDS)}"
        raise InputRefused(Fault(reason=f"a part holds {found}", where=_place(source, path), advice=advice))
    part: Part = _converted(raw, kinds[0], source, path)
    return part


def _converted(raw: dict[str, Any], kind: type[Any], source: str, path: str) -> Any:
    """Decode a struct; a key with null counts as left out. Raises InputRefused with the JSON path and an advice."""
    given = {key: value for key, value in raw.items() if value is not None}
    try:
        return msgspec.convert(given, kind)
    except msgspec.ValidationError as error:
        reason, _, where = str(error).partition(" - at `$")
        known = ", ".join(kind.__struct_fields__)
        advice = f"known: {known}" if "unknown field" in reason else allowed(error, kind) or CALL
        fault = Fault(reason=reason, where=_place(source, f"{path}{where.rstrip('`')}"), advice=advice)
        raise InputRefused(fault) from error


def _place(source: str, path: str) -> str:
    return f"{source}: {path}" if source else path


def _in_lines(text: str) -> str:
    """The text with single blanks. Its lines stay: they tell what is an item, a quotation or a row of a table."""
    return "\n".join(" ".join(line.split()) for line in text.strip().splitlines())
