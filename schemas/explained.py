"""Explanation of a value that is not of its type: what is wrong, what would be right, and the key."""

import re
from difflib import get_close_matches
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Struct


def explained(error: msgspec.ValidationError, kind: Any) -> tuple[str, str]:
    """Explain an error of a value of this type: what is wrong and would be right, and the key; empty: the whole."""
    reason, _, place = str(error).partition(" - at `$")
    key = place.strip("`").lstrip(".")
    kinds = _inside(kind, key)
    if reason.startswith("Invalid enum value"):
        choices = [repr(choice) for each in kinds for choice in _choices(each)]
        reason = f"{reason.removeprefix('Invalid enum value ')} is none of {', '.join(choices)}"
    elif unknown := re.fullmatch(r"Object contains unknown field `(.*)`", reason):
        fields = [field for each in kinds for field in getattr(each, "__struct_fields__", ())]
        close = get_close_matches(unknown[1], fields, n=1)
        known = f"do you mean `{close[0]}`?" if close else f"known are {', '.join(fields)}"
        reason = f"unknown key `{unknown[1]}`; {known}"
    return reason, key


def _inside(kind: Any, key: str) -> list[Any]:
    """Types that a value inside of one of this type may have. key: its place, such as `stalls[0].part`."""
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


def _choices(kind: Any) -> list[str]:
    """Words that a Literal type allows."""
    if get_origin(kind) is Literal:
        return list(get_args(kind))
    return [choice for part in get_args(kind) for choice in _choices(part)]
