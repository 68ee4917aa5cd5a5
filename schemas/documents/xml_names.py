"""How the attributes of BML elements are called and written, in every dialect, and the fields they become."""

import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec
from lxml import etree

from engage_hri.schemas.documents.xml_source import CORE, EBML, Source, split
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.syncref import SYNC_POINTS, SyncRef

AnyStruct = TypeVar("AnyStruct", bound=msgspec.Struct)
SYNC_ATTRIBUTES = frozenset({*SYNC_POINTS, "strokeStart", "strokeEnd", "attackPeak"})
_NOT_ATTRIBUTES = frozenset(
    {"line", "timing", "behaviors", "constraints", "options", "distractors", "objects", "anchors", "marks", "text"}
)
_SPELLINGS = {
    "gesture": {"hand"}, "pointing": {"hand"}, "head": {"action", "rotation", "repeats"}, "face": {"overshoot"},
    "emit": {"event"}, "bml": {"composition", "characterId"}, "synchronize": {"ref"}, "before": {"ref"},
    "after": {"ref"}, "sync": {"ref"}, "lexeme": {"lexeme", "amount"}, "facs": {"au", "side", "amount"},
    "pose": {"part", "lexeme"},
}  # fmt: skip
"""Attributes that are read though no field is called so, beside `id` and `type`, which every element may have."""
_HANDS = {"left": "LEFT_HAND", "right": "RIGHT_HAND", "both": "BOTH_HANDS"}


def ours(parent: etree._Element) -> Iterator[tuple[etree._Element, str, str]]:
    """The children that are BML or EBML, with namespace and local name."""
    for child in parent:
        namespace, local = split(str(child.tag))
        if namespace in CORE or namespace == EBML:
            yield child, namespace, local


def attributes(element: etree._Element) -> dict[str, str]:
    """The attributes that are BML's or EBML's, by local name."""
    found = {}
    for name, value in element.items():
        namespace, local = split(str(name))
        undeclared = ":" in local
        if (namespace in CORE or namespace == EBML) and not undeclared:
            found[local] = str(value)
    return found


def fields(plain: dict[str, str]) -> dict[str, Any]:
    """offsetAngle, offset-angle -> offset_angle. `line` is ours to say."""
    named = {snake(name): value for name, value in plain.items()}
    return {name: value for name, value in named.items() if name not in ("line", "timing", "marks", "unread")}


def unknown_attributes(plain: dict[str, str], local: str, kind: type[msgspec.Struct] | None) -> Iterator[str]:
    """Of an element's own attributes those that nobody will read."""
    read = {"id", "type", "required", *_SPELLINGS.get(local, ()), *(SYNC_ATTRIBUTES if kind else ())}
    for name in sorted(plain.keys() - read):
        if kind is None or snake(name) not in set(kind.__struct_fields__) - _NOT_ATTRIBUTES:
            yield name


def known_attributes(kind: type[msgspec.Struct]) -> str:
    """As advice."""
    return ", ".join(camel(field) for field in kind.__struct_fields__ if field not in _NOT_ATTRIBUTES | {"required"})


def is_reference(value: str) -> bool:
    """Does the value of an attribute name a sync point of a behavior, so that it can only be meant as timing?"""
    try:
        return SyncRef.parse(value).behavior != ""
    except ValueError:
        return False


def camel(field: str) -> str:
    if field == "minimum_reliability":
        return "minReliability"
    return re.sub("_([a-z])", lambda match: match[1].upper(), field)


def snake(name: str) -> str:
    """offsetAngle, offset-angle -> offset_angle."""
    return re.sub("(?<=[a-z])([A-Z])", r"_\1", name).replace("-", "_").lower()


def hand(name: str | None) -> str | None:
    return None if name is None else _HANDS.get(name.lower(), name.upper())


def head(raw: dict[str, Any]) -> dict[str, Any]:
    """`type="NOD"` or `action="rotation" rotation="nod"` of the drafts."""
    spelled = [str(raw[name]).upper() for name in ("rotation", "type", "action") if name in raw]
    drafts = [name for name in spelled if name != "ROTATION"]
    if "lexeme" not in raw and drafts:
        raw["lexeme"] = drafts[0]
    if "repeats" in raw:
        raw.setdefault("repetition", raw["repeats"])
    return raw


def converted(source: Source, element: etree._Element, raw: dict[str, Any], kind: type[AnyStruct]) -> AnyStruct:
    """Texts to the types of the struct. Raises InputRefused with the attribute that is wrong."""
    try:
        # BML has attributes called `type`; the struct's own says which element it is.
        return msgspec.convert({**_numbers(raw, kind), "type": kind.__struct_config__.tag}, kind, strict=False)
    except msgspec.ValidationError as error:
        raise _bad_value(source, element, raw, kind, str(error)) from error


def _bad_value(
    source: Source, element: etree._Element, raw: dict[str, Any], kind: type[msgspec.Struct], error: str
) -> InputRefused:
    reason, _, path = error.partition(" - at `$")
    field = path.strip(".`")
    local = split(str(element.tag))[1]
    missing = re.fullmatch("Object missing required field `(.*)`", reason)
    what = f"no {camel(missing[1])}" if missing else f"{camel(field)}: {reason}"
    name = f"<{local} id={raw['id']!r}>" if raw.get("id") else f"<{local}>"
    return source.refusal(f"{name}: {what}", element, advice=_allowed(kind, field))


@cache
def _hints(kind: type[msgspec.Struct]) -> dict[str, Any]:
    return get_type_hints(kind)


def _numbers(raw: dict[str, Any], kind: type[msgspec.Struct]) -> dict[str, Any]:
    """Numbers as XML may write them (`.5`, `+2`), which JSON may not."""
    decimals = [name for name, hint in _hints(kind).items() if float in (hint, *get_args(hint))]
    numbers = {}
    for name in decimals:
        with suppress(ValueError):
            if isinstance(text := raw.get(name), str):
                numbers[name] = float(text)
    return raw | numbers


def _allowed(kind: type[msgspec.Struct], field: str) -> str:
    """The values of a field that has only a few, as advice."""
    hint = _hints(kind).get(field)
    choices = [str(value) for value in get_args(hint) if isinstance(value, str | int)]
    return f"one of {', '.join(choices)}" if choices else ""
