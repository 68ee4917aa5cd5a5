"""Advice about a value that is none of a few that are allowed, in whatever document it stands."""

import re
from difflib import get_close_matches
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec

STEP = re.compile(r"\.([^.\[\]`]+)|\[(\d+)\]")
"""A step of a path as msgspec writes it: `.mode` or `[0]` of `$.behaviors[0].mode`."""


def advice(kind: Any, path: str, content: object) -> str:
    """Write `did you mean 'RIGHT_HAND'? one of LEFT_HAND, RIGHT_HAND, BOTH_HANDS`; empty: not only a few are allowed.

    kind: type of the whole. path: of the bad value in it. content: the whole, as it was read.
    """
    types = [kind]
    for name, index in STEP.findall(path):
        if index:
            types = [arg for each in types for arg in _items(each)]
            content = content[int(index)] if isinstance(content, list | tuple) and int(index) < len(content) else None
        elif isinstance(content, dict):
            types = [each for struct in _structs(types, content) for each in _alternatives(_field(struct, name))]
            content = content.get(name)
        else:
            return ""
    values = [str(value) for each in types for value in _literals(each)]
    if not values:
        return ""
    near = get_close_matches(str(content).upper(), [value.upper() for value in values], n=1)
    meant = next((value for value in values if near and value.upper() == near[0]), "")
    return f"{f'did you mean {meant!r}? ' if meant else ''}one of {', '.join(values)}"


def _alternatives(hint: Any) -> list[Any]:
    """Types of a union, or the one type."""
    return [*get_args(hint)] if get_origin(hint) in (Union, type(int | str)) else [hint]


def _items(hint: Any) -> list[Any]:
    return _alternatives(get_args(hint)[0]) if get_origin(hint) is tuple else []


def _structs(types: list[Any], content: dict[str, Any]) -> list[Any]:
    """The struct that is meant: of several that one whose tag the content has."""
    structs = [each for each in types if isinstance(each, type) and issubclass(each, msgspec.Struct)]
    tag = content.get("type")
    return structs if len(structs) == 1 else [each for each in structs if each.__struct_config__.tag == tag]


def _field(struct: Any, name: str) -> Any:
    return get_type_hints(struct).get(name)


def _literals(hint: Any) -> list[Any]:
    return [*get_args(hint)] if get_origin(hint) is Literal else []
