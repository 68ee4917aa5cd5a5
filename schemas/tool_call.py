"""Reading of the tool `perform_turn_fragment` (schemas/tool.py): from its input to a turn fragment.

Bad input is refused with its JSON path, so that the model can correct itself.
"""

import re
from collections.abc import Iterable
from typing import Any, get_args, get_type_hints

import msgspec
from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    Action,
    After,
    Constraint,
    FragmentBehavior,
    Gaze,
    Head,
    Reference,
    Speech,
    SpeechOption,
)
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.speakable import word_count
from engage_hri.schemas.tool import PARTS, Certainty, Expects, Gesture, Look, Part, Refer, Say, ToolInput
from engage_hri.schemas.units import Probability

RELIABILITY: dict[Certainty, Probability | None] = {"normal": None, "high": 0.95}
"""Minimum reliability of a reference: generation's default, or that of the pieces to be moved in thesis Appendix
B."""
ANSWERS: dict[Expects, tuple[Action, ...]] = {"reply": (), "action": ("act", "speak", "nod", "shake")}
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
    behaviors: list[FragmentBehavior] = []
    order: list[Constraint] = []
    before = ""
    for number, part in enumerate(parts, start=1):
        behavior, resume = _behavior(part, number)
        if before:
            after = After(ref=before, syncs=(f"{behavior.id}:start",))
            order.append(Constraint(id=f"order-{number}", operators=(after,)))
        behaviors.append(behavior)
        before = f"{behavior.id}:{resume}" if resume else before
    return TurnFragment(
        id=id,
        turn_status=turn.turn_status,
        turn_index=turn.turn_index,
        behaviors=tuple(behaviors),
        constraints=tuple(order),
        addressee=turn.addressee,
        delay=turn.thinking and turn.turn_status in ("beginning", "middle"),
        accept=ANSWERS[turn.expects],
        within=turn.within or None,
    )


def _behavior(part: Part, number: int) -> tuple[FragmentBehavior, str]:
    """Behavior of a part, and its sync point at which the next behavior may start; empty: at once."""
    match part:
        case Say(say=text):
            return Speech(id=f"say-{number}", text=_in_lines(text)), "end"
        case Refer(refer=target, phrases=phrases, certainty=certainty):
            reference = Reference(
                id=f"refer-{number}",
                target=target,
                minimum_reliability=RELIABILITY[certainty],
                options=tuple(map(_option, phrases)) if phrases else None,
            )
            return reference, "end"
        case Look(look=target):
            return Gaze(id=f"look-{number}", target=target), "stroke"
        case Gesture(gesture=gesture):
            return Head(id=f"gesture-{number}", lexeme=gesture.upper()), ""


def _option(phrase: str) -> SpeechOption:
    words = phrase.split()
    deictic = bool(words) and words[0].lower() in DEMONSTRATIVES
    return SpeechOption(text=" ".join(words), cost=word_count(phrase), deictic=deictic)


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
        advice = f"known: {known}" if "unknown field" in reason else _allowed(where.strip("`."), kind)
        fault = Fault(reason=reason, where=_place(source, f"{path}{where.rstrip('`')}"), advice=advice)
        raise InputRefused(fault) from error


def _allowed(field: str, kind: type[Any]) -> str:
    """Advice that lists the values of a field, if it has only a few."""
    values = [str(value) for value in get_args(get_type_hints(kind).get(field)) if isinstance(value, str | int)]
    return f"one of {', '.join(values)}" if values else CALL


def _place(source: str, path: str) -> str:
    return f"{source}: {path}" if source else path


def _in_lines(text: str) -> str:
    """The text with single blanks. Its lines stay: they tell what is an item, a quotation or a row of a table."""
    return "\n".join(" ".join(line.split()) for line in text.strip().splitlines())
