"""Explanation of a value that is not of its type: what is wrong, what would be right, and the key."""

import re
from collections.abc import Mapping
from difflib import get_close_matches
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Struct


def explained(error: msgspec.ValidationError, kind: Any) -> tuple[str, str]:
    """Explain an error of a value of this type: what is wrong and would be right, and the key; empty: the whole.

    A type may have a table `FIXED` of keys that it had once, with the value that each of them has for good.
    """
    reason, _, place = str(error).partition(" - at `$")
    key = place.strip("`").lstrip(".")
    kinds = _inside(kind, key)
    if reason.startswith("Invalid enum value"):
        choices = [repr(choice) for each in kinds for choice in _choices(each)]
        reason = f"{reason.removeprefix('Invalid enum value ')} is none of {', '.join(choices)}"
    elif unknown := re.fullmatch(r"Object contains unknown field `(.*)`", reason):
        fixed = {name: value for each in kinds for name, value in getattr(each, "FIXED", {}).items()}
        if unknown[1] in fixed:
            return f"`{unknown[1]}` is no setting any more, it is fixed at {fixed[unknown[1]]}; take it out", key
        fields = [field for each in kinds for field in getattr(each, "__struct_fields__", ())]
        close = get_close_matches(unknown[1], fields, n=1)
        known = f"do you mean `{close[0]}`?" if close else f"known are {', '.join(fields)}"
        reason = f"unknown key `{unknown[1]}`; {known}"
    return reason, key


def without_former(table: Any, kind: Any) -> Any:
    """The table without keys that this type had once, where it gives them the value that they have for good.

    Files and recordings from before stay good so long as they ask for nothing else.
    """
    if not isinstance(table, Mapping) or not _is_struct(kind):
        return table
    fixed, inner = getattr(kind, "FIXED", {}), get_type_hints(kind)
    return {
        key: without_former(value, inner.get(key))
        for key, value in table.items()
        if key not in fixed or msgspec.json.decode(msgspec.json.encode(fixed[key])) != value
    }


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
