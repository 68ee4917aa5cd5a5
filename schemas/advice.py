"""Advice about what is wrong: a name that is not known, or a value that is not of its type.

It tells the name or the value that was probably meant, or which there are.
"""

import re
from collections.abc import Iterable
from difflib import get_close_matches
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Struct

MOST = 12
"""Most names that are listed."""


def meant(name: str, known: Iterable[str]) -> str:
    """Write ` (did you mean 'start'?)`; empty if no name is like this one."""
    near = _nearest(name, sorted(known), 0.75)
    return f" (did you mean {near}?)" if near else ""


def suggestion(name: str, known: Iterable[str], none: str = "known: none") -> str:
    """Write `did you mean 'can'?`, or `known: can, cup` if no name is like this one.

    none: what to write if there is no name at all.
    """
    names = sorted(known)
    if not names:
        return none
    if near := _nearest(name, names, 0.6):
        return f"did you mean {near}?"
    return f"known: {', '.join(names[:MOST])}{', ...' if len(names) > MOST else ''}"


def in_other_letters(name: str, known: Iterable[str]) -> str:
    """The one known name that is this one but for capital letters; empty: there is none, or several."""
    same = [each for each in known if each.casefold() == name.casefold()]
    return same[0] if len(same) == 1 else ""


def _nearest(name: str, names: list[str], cutoff: float) -> str:
    """The name that is most like this one, or all that differ from it only in case, in quotes; empty if none is."""
    near = get_close_matches(name.casefold(), [each.casefold() for each in names], n=1, cutoff=cutoff)
    return " or ".join(repr(each) for each in names if each.casefold() in near)


# -- values of a type ----------------------------------------------------------------------------------------------


def explained(error: msgspec.ValidationError, kind: Any) -> tuple[str, str]:
    """Explain an error of a value of this type: what is wrong and would be right, and the key; empty: the whole."""
    reason, key = _parted(error)
    kinds = _inside(kind, key)
    if reason.startswith("Invalid enum value"):
        choices = ", ".join(map(repr, _choices(kinds)))
        reason = f"{reason.removeprefix('Invalid enum value ')} is none of {choices}"
    elif unknown := re.fullmatch(r"Object contains unknown field `(.*)`", reason):
        fields = [field for each in kinds for field in getattr(each, "__struct_fields__", ())]
        close = get_close_matches(unknown[1], fields, n=1)
        known = f"do you mean `{close[0]}`?" if close else f"known are {', '.join(fields)}"
        reason = f"unknown key `{unknown[1]}`; {known}"
    return reason, key


def allowed(error: msgspec.ValidationError, kind: Any) -> str:
    """Write `did you mean 'RIGHT_HAND'? one of LEFT_HAND, RIGHT_HAND, BOTH_HANDS`; empty: not only a few are allowed.

    kind: type of the whole, in which the error says the place.
    """
    reason, key = _parted(error)
    values = [str(value) for value in _choices(_inside(kind, key))]
    if not values:
        return ""
    near = _nearest(reason.partition("'")[2].rstrip("'"), values, 0.6)
    return f"{f'did you mean {near}? ' if near else ''}one of {', '.join(values)}"


def _parted(error: msgspec.ValidationError) -> tuple[str, str]:
    """The reason of an error, and the key of its place, such as `stalls[0].part`."""
    reason, _, place = str(error).partition(" - at `$")
    return reason, place.strip("`").lstrip(".")


def _inside(kind: Any, key: str) -> list[Any]:
    """Types that a value inside of one of this type may have. key: its place."""
    kinds = _alternatives(kind)
    for step in re.findall(r"\[|[^.\[\]]+(?=[.\[]|$)", key):
        if step == "[":
            inner = [part for each in kinds for part in get_args(each) if part is not Ellipsis]
        else:
            hints = [get_type_hints(each) for each in kinds if _is_struct(each)]
            inner = [each[step] for each in hints if step in each]
        kinds = [part for each in inner for part in _alternatives(each)]
    return kinds


def _is_struct(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Struct)


def _alternatives(kind: Any) -> list[Any]:
    is_union = get_origin(kind) in (Union, UnionType)
    return [part for each in get_args(kind) for part in _alternatives(each)] if is_union else [kind]


def _choices(kinds: Iterable[Any]) -> list[Any]:
    """Values that Literal types allow, also those inside other types."""
    found: dict[Any, None] = {}
    for kind in kinds:
        parts = get_args(kind)
        found |= dict.fromkeys(parts if get_origin(kind) is Literal else _choices(parts))
    return list(found)
