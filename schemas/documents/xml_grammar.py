"""The grammar of BML and EBML that the reader and the writer share: which attributes and elements each element has.

An attribute is called like the field of the struct that it becomes, in camelCase. So the structs of behaviors.py say
most of the grammar, their rows in behavior_types.py the namespaces, and the tables here only the rest.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import cache, lru_cache
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec
from lxml import etree

from engage_hri.schemas import behaviors as of
from engage_hri.schemas.behavior_types import TYPES, BehaviorType
from engage_hri.schemas.documents.xml_source import CORE, EBML, local_name, named, ours, split
from engage_hri.schemas.syncref import SYNC_POINTS

AnyStruct = TypeVar("AnyStruct", bound=msgspec.Struct)
SYNC_ATTRIBUTES = frozenset({*SYNC_POINTS, "strokeStart", "strokeEnd", "attackPeak"})
"""Inline sync points."""
OPERATORS: Mapping[str, type[of.Synchronize | of.Before | of.After]] = {
    "synchronize": of.Synchronize, "before": of.Before, "after": of.After,
}  # fmt: skip
STANDARD = sorted(row.name for row in TYPES.values() if row.is_standard)

# -- attributes ----------------------------------------------------------------------------------------------------

_NAMES = {"minimum_reliability": "minReliability"}
"""Fields whose attribute is not called like them."""
_CONTENT = frozenset({
    "line", "timing", "marks", "options", "objects", "anchors", "distractors", "syncs", "operators", "behaviors",
    "constraints", "dialect", "unread",
})  # fmt: skip
"""Fields that are no attributes: they are elements, or not the author's to say."""
DRAFTS: Mapping[str, Mapping[str, str]] = {
    "gesture": {"hand": "mode", "type": "lexeme"},
    "pointing": {"hand": "mode"},
    "head": {"rotation": "lexeme", "type": "lexeme", "action": "lexeme", "repeats": "repetition"},
    "face": {"type": "lexeme"},
}
"""By element: attributes of the drafts, and the field of each. They are read where the field is not given."""
PARTS: Mapping[str, Mapping[str, str]] = {
    "lexeme": {"lexeme": "lexeme", "amount": "amount"},
    "facs": {"au": "au", "side": "side", "amount": "amount"},
    "stance": {"type": "stance"},
    "pose": {"part": "part", "lexeme": "lexeme"},
}
"""Elements inside a face or posture: their attributes, and the field of the behavior that each becomes."""
LISTS = {
    "objects": ("object", "id"), "anchors": ("anchor", "ref"), "distractors": ("distractor", "object"),
    "syncs": ("sync", "ref"),
}  # fmt: skip
"""Fields that are a list of elements, and the attribute of these that is an item."""
_OTHER_ATTRIBUTES = {
    "bml": ("composition", "characterId"), "face": ("overshoot",), "sync": ("ref",),
    **dict.fromkeys(OPERATORS, ("ref",)),
}  # fmt: skip


@cache
def attribute_fields(kind: type[msgspec.Struct]) -> tuple[str, ...]:
    """The fields of a struct that are attributes of its element."""
    without = _CONTENT | {"text"} if kind is of.Speech else _CONTENT
    return tuple(field for field in kind.__struct_fields__ if field not in without)


def attribute(field: str) -> str:
    """offset_angle -> offsetAngle."""
    return _NAMES.get(field) or re.sub("_([a-z])", lambda match: match[1].upper(), field)


def snake(name: str) -> str:
    """offsetAngle, offset-angle -> offset_angle."""
    return re.sub("(?<=[a-z])([A-Z])", r"_\1", name).replace("-", "_").lower()


@lru_cache(1024)  # authors may write what they like
def field_of(name: str) -> str:
    """The field that an attribute becomes."""
    return next((field for field, written in _NAMES.items() if snake(written) == snake(name)), snake(name))


def unknown_attributes(plain: Mapping[str, str], local: str, kind: type[msgspec.Struct] | None) -> Iterator[str]:
    """Of an element's own attributes those that nobody will read. kind: of a behavior."""
    read = {"id", "type", "required", *DRAFTS.get(local, ()), *_OTHER_ATTRIBUTES.get(local, ())}
    read |= SYNC_ATTRIBUTES if kind else PARTS.get(local, {}).keys()
    for name in sorted(plain.keys() - read):
        if kind is None or field_of(name) not in attribute_fields(kind):
            yield name


# -- elements ------------------------------------------------------------------------------------------------------

_FACE, _POSTURE = ("lexeme", "facs"), ("stance", "pose")
CHILDREN: Mapping[str, tuple[str, ...]] = {
    "face": _FACE, "faceShift": _FACE, "posture": _POSTURE, "postureShift": _POSTURE, "emit": ("event",),
    "reference": ("speechOption",), "event": ("object", "anchor"), "speechOption": ("distractor",),
    **dict.fromkeys(OPERATORS, ("sync",)),
}  # fmt: skip
"""What else stands in them is misplaced; in those that are not listed, everything is."""
_ANYWHERE = ("description", "timing")
_FREE = ("description", "event")
"""Their content is their author's affair."""


def behavior_type(namespace: str, local: str, *, is_strict: bool) -> BehaviorType | None:
    """The type of an element that is a behavior. is_strict: in a fragment, where our elements need no namespace."""
    row = TYPES.get(local)
    if row is None or (row.is_standard and namespace in CORE):
        return row
    is_ours = not row.is_standard and (namespace == EBML or (is_strict and not namespace))
    return row if is_ours else None


def misplaced(element: etree._Element) -> Iterator[tuple[etree._Element, str, str]]:
    """Elements below this one that their parent cannot hold, with their own and the parent's name."""
    holder = local_name(element)
    for child, _, name in ours(element):
        if name not in CHILDREN.get(holder, ()) and name not in _ANYWHERE:
            yield child, name, holder
        elif name not in _FREE:
            yield from misplaced(child)


def behaviors_inside(speech: etree._Element, *, is_strict: bool) -> Iterator[etree._Element]:
    """Behaviors and constraints below a speech, which is no place for them. is_strict: in a fragment."""
    for child in speech:
        namespace, local = split(str(child.tag))
        is_grouping = namespace in CORE and local in ("constraint", "required")
        if is_grouping or behavior_type(namespace, local, is_strict=is_strict):
            yield child
        elif local != "description":
            yield from behaviors_inside(child, is_strict=is_strict)


# -- from attributes to structs ------------------------------------------------------------------------------------

_HANDS = {"LEFT": "LEFT_HAND", "RIGHT": "RIGHT_HAND", "BOTH": "BOTH_HANDS", "": None}
_SPELLED: Mapping[str, Callable[[str], Any]] = {
    "accept": str.split,
    "composition": lambda text: text.strip().upper(),
    "mode": lambda text: _HANDS.get(text.upper(), text.upper()),
    "side": str.upper,
}
"""Fields whose attribute is spelled more freely than the field."""
_OURS_TO_SAY = ("line", "timing", "marks", "unread")
"""Fields that no attribute sets."""


def fields(plain: Mapping[str, str]) -> dict[str, Any]:
    """Attributes by the names of their fields."""
    named = {field_of(name): value for name, value in plain.items()}
    return {name: value for name, value in named.items() if name not in _OURS_TO_SAY}


def lists(element: etree._Element, kind: type[msgspec.Struct]) -> dict[str, list[str]]:
    """The fields that are elements inside the element."""
    return {
        field: [str(child.get(item, "")) for child in named(element, local)]
        for field, (local, item) in LISTS.items()
        if field in kind.__struct_fields__
    }


def kind_of(local: str, type: str, raw: Mapping[str, Any]) -> type[of.Behavior]:
    """The struct of a behavior: some elements are several, by their `type` or their content."""
    match local, type:
        case "gesture" | "pointing", "POINT":
            return of.Pointing
        case "face", _ if type == "FACS" or "au" in raw:
            return of.FaceFacs
        case "face", _ if "lexeme" in raw:
            return of.FaceLexeme
    return TYPES[local].kind


def converted(raw: Mapping[str, Any], kind: type[AnyStruct]) -> AnyStruct:
    """The struct. Raises msgspec.ValidationError. raw: by field, texts as in XML; None is not given."""
    given = {name: read for name, value in raw.items() if (read := _value(kind, name, value)) is not None}
    # BML has attributes called `type`; the struct's own says which element it is.
    return msgspec.convert({**given, "type": kind.__struct_config__.tag}, kind, strict=False)


@cache
def _hints(kind: type[msgspec.Struct]) -> dict[str, Any]:
    return get_type_hints(kind)


@cache
def _decimals(kind: type[msgspec.Struct]) -> frozenset[str]:
    return frozenset(field for field, hint in _hints(kind).items() if float in (hint, *get_args(hint)))


def _value(kind: type[msgspec.Struct], field: str, value: Any) -> Any:
    """What an attribute says. Numbers may be written as in XML (`.5`, `+2`), which JSON does not allow."""
    if not isinstance(value, str):
        return value
    if field in _SPELLED:
        return _SPELLED[field](value)
    if field in _decimals(kind):
        with suppress(ValueError):
            return float(value)
    return value


def choices(kind: type[msgspec.Struct], field: str) -> str:
    """The values of a field that has only a few, as advice."""
    values = [str(value) for value in get_args(_hints(kind).get(field)) if isinstance(value, str | int)]
    return f"one of {', '.join(values)}" if values else ""
