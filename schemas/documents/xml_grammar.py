"""Grammar of BML and EBML, shared by the reader and the writer: the attributes and elements that each element has.

An attribute has the name of the field that it becomes, in camelCase. So most of the grammar is in the structs of
behaviors.py, the namespaces are in the rows of behavior_types.py, and the tables here hold only the rest.
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
from engage_hri.schemas.documents import xml_source as xml
from engage_hri.schemas.references import SYNC_NAMES, SyncRef
from engage_hri.schemas.vocabulary import SHAPES

AnyStruct = TypeVar("AnyStruct", bound=msgspec.Struct)
OPERATORS: Mapping[str, type[of.Synchronize | of.Before | of.After]] = {
    "synchronize": of.Synchronize, "before": of.Before, "after": of.After,
}  # fmt: skip
STANDARD = sorted(row.name for row in TYPES.values() if row.is_standard)

# -- attributes ----------------------------------------------------------------------------------------------------

_NAMES = {"minimum_reliability": "minReliability"}
"""Fields with an attribute of another name."""
_CONTENT = frozenset({
    "line", "timing", "marks", "options", "objects", "anchors", "distractors", "syncs", "operators", "behaviors",
    "constraints", "dialect", "unread", "expressions", "poses",
})  # fmt: skip
"""Fields that are no attributes: they are elements, or not set by the author."""
DRAFTS: Mapping[str, Mapping[str, str]] = {
    "gesture": {"hand": "mode", "type": "lexeme"},
    "pointing": {"hand": "mode"},
    "head": {
        "rotation": "lexeme", "orientation": "lexeme", "type": "lexeme", "action": "lexeme", "repeats": "repetition",
    },
    "face": {**dict.fromkeys(SHAPES, "lexeme"), "type": "lexeme"},
}  # fmt: skip
"""Further attributes of the drafts, by element, and the field of each. They count if the field is not given."""
_ACTIONS = ("ROTATION", "ORIENTATION")
"""Values of a draft's `action` that say which other attribute says what to do."""
_AXES = {"X": "NOD", "Y": "SHAKE", "Z": "TILT"}
"""The draft's other names of rotations."""
_OPTIONAL: Mapping[tuple[str, type[of.Behavior]], tuple[str, ...]] = {
    ("head", of.Head): ("lexeme", "rotation", "orientation"),
    ("gesture", of.Gesture): ("lexeme", "type", "lexeme"),
    ("gesture", of.Pointing): ("target", "target"),
    ("face", of.FaceFacs): ("au", "au"),
    ("locomotion", of.Locomotion): ("target", "target"),
}
"""By element and struct, a field that the struct needs, and the attributes of the draft that can give it."""
PARTS: Mapping[str, Mapping[str, str]] = {
    "lexeme": {"lexeme": "lexeme", "amount": "amount"},
    "facs": {"au": "au", "side": "side", "amount": "amount"},
    "stance": {"type": "stance"},
    "pose": {"part": "part", "lexeme": "lexeme"},
}
"""Elements inside a face or posture: their attributes, and the field of the behavior for each."""
LISTS = {
    "objects": ("object", "id"), "anchors": ("anchor", "ref"), "distractors": ("distractor", "object"),
    "syncs": ("sync", "ref"),
}  # fmt: skip
"""Fields that are a list of elements: the element of an item, and the attribute with its value."""
_OTHER_ATTRIBUTES = {
    "bml": ("composition", "characterId"),
    "sync": ("ref",), "mark": ("name", "ref"), "tm": ("name", "ref"),
    **dict.fromkeys(OPERATORS, ("ref",)),
}  # fmt: skip


@cache
def attribute_fields(kind: type[msgspec.Struct]) -> tuple[str, ...]:
    """Fields of a struct that are attributes of its element."""
    without = _CONTENT | {"text"} if kind is of.Speech else _CONTENT
    return tuple(field for field in kind.__struct_fields__ if field not in without)


def attribute(field: str) -> str:
    """Attribute of a field: offset_angle -> offsetAngle."""
    return _NAMES.get(field) or re.sub("_([a-z])", lambda match: match[1].upper(), field)


def snake(name: str) -> str:
    """Spell a name in snake case: offsetAngle, offset-angle -> offset_angle."""
    return re.sub("(?<=[a-z])([A-Z])", r"_\1", name).replace("-", "_").lower()


@lru_cache(1024)  # authors may write what they like
def field_of(name: str) -> str:
    """Field that an attribute becomes."""
    return next((field for field, written in _NAMES.items() if snake(written) == snake(name)), snake(name))


def unknown_attributes(plain: Mapping[str, str], local: str, kind: type[msgspec.Struct] | None) -> Iterator[str]:
    """Find the attributes of an element that no reader knows. kind: of the behavior, if it is one."""
    read = _read(local, kind)
    for name in sorted(plain.keys() - read):
        if kind is None or field_of(name) not in attribute_fields(kind):
            yield name


def known_attributes(local: str, kind: type[msgspec.Struct] | None) -> frozenset[str]:
    """List the attributes of an element that a reader knows. kind: of the behavior, if it is one."""
    return frozenset(_read(local, kind)) | (set(map(attribute, attribute_fields(kind))) if kind else set())


def _read(local: str, kind: type[msgspec.Struct] | None) -> set[str]:
    """Attributes that are read, besides those that become fields."""
    read = {"id", "type", "required", *DRAFTS.get(local, ()), *_OTHER_ATTRIBUTES.get(local, ())}
    return read | (SYNC_NAMES if kind else PARTS.get(local, {}).keys())


def of_drafts(plain: Mapping[str, str], local: str) -> Iterator[tuple[str, str]]:
    """Read the further attributes of the drafts: field and value of each."""
    for name, field in DRAFTS.get(local, {}).items():
        value = plain.get(name, "").strip().upper()
        if not value or (local == "head" and value in _ACTIONS):
            continue
        if local == "face" and name in SHAPES:
            value = f"{SHAPES[name]}_{value}"
        yield field, _AXES.get(value, value) if name == "rotation" else value


def lacking(plain: Mapping[str, str], local: str, raw: Mapping[str, Any], kind: type[of.Behavior]) -> str:
    """Attributes of a draft of which a behavior needs one, and has none. Empty: it has, or its dialect demands one.

    Every attribute of these elements may be left out in the draft of 2007, where others may say what to do.
    """
    field, *names = _OPTIONAL.get((local, kind), ("",))
    if not field or raw.get(field):
        return ""
    action = plain.get("action", plain.get("type", "")).strip().lower()
    return action if action in names else " or ".join(names)


# -- elements ------------------------------------------------------------------------------------------------------

_FACE, _POSTURE = ("lexeme", "facs"), ("stance", "pose")
CHILDREN: Mapping[str, tuple[str, ...]] = {
    "face": _FACE, "faceShift": _FACE, "posture": _POSTURE, "postureShift": _POSTURE, "emit": ("event",),
    "reference": ("speechOption",), "event": ("object", "anchor"), "speechOption": ("distractor",),
    **dict.fromkeys(OPERATORS, ("sync",)),
}  # fmt: skip
"""Elements that each element may hold; an element that is not listed may hold none."""
_ANYWHERE = ("description", "timing")
_FREE = ("description", "event")
"""Elements with any content."""


def behavior_type(namespace: str, local: str, *, is_strict: bool) -> BehaviorType | None:
    """Type of an element that is a behavior, else None. is_strict: in a fragment our elements need no namespace."""
    row = TYPES.get(local)
    if row is None or (row.is_standard and namespace in xml.CORE):
        return row
    is_ours = not row.is_standard and (namespace == xml.EBML or (is_strict and not namespace))
    return row if is_ours else None


def misplaced(element: etree._Element) -> Iterator[tuple[etree._Element, str, str]]:
    """Find elements below this one that their parent cannot hold, with their own and the parent's name."""
    holder = xml.local_name(element)
    for child, _, name in xml.bml_children(element):
        if name not in CHILDREN.get(holder, ()) and name not in _ANYWHERE:
            yield child, name, holder
        elif name not in _FREE:
            yield from misplaced(child)


def foreign_parts(element: etree._Element) -> Iterator[str]:
    """Find what other namespaces add to an element and to those inside it, but not inside a <description>."""
    yield from xml.foreign_attributes(element)
    yield from (f"<{xml.prefixed_name(child)}>" for child, _ in xml.foreign_children(element))
    for child, _, name in xml.bml_children(element):
        if name != "description":
            yield from foreign_parts(child)


def behaviors_inside(speech: etree._Element, *, is_strict: bool) -> Iterator[etree._Element]:
    """Find behaviors and constraints below a speech, which is no place for them. is_strict: in a fragment."""
    for child in speech:
        namespace, local = xml.split(str(child.tag))
        is_grouping = namespace in xml.CORE and local in ("constraint", "required")
        if is_grouping or behavior_type(namespace, local, is_strict=is_strict):
            yield child
        elif local != "description":
            yield from behaviors_inside(child, is_strict=is_strict)


# -- from attributes to structs ------------------------------------------------------------------------------------

_HANDS = {"LEFT": "LEFT_HAND", "RIGHT": "RIGHT_HAND", "BOTH": "BOTH_HANDS", "": None}


def _one_or_several(text: str) -> str | list[str]:
    ids = text.split()
    return ids if len(ids) > 1 else "".join(ids)


_SPELLED: Mapping[str, Callable[[str], Any]] = {
    "accept": str.split,
    "addressee": _one_or_several,
    "interruptible": lambda text: {"true": True, "false": False}.get(text.strip().lower(), _one_or_several(text)),
    "composition": lambda text: text.strip().upper(),
    "needs": str.split,
    "mode": lambda text: _HANDS.get(text.upper(), text.upper()),
    "side": str.upper,
}
"""Readers of attributes that may be spelled more freely than the field."""

_NEVER_SET = ("line", "timing", "marks", "unread", "expressions", "poses")
"""Fields that no attribute can set."""


def fields(plain: Mapping[str, str]) -> dict[str, Any]:
    """Rename attributes to their fields."""
    named = {field_of(name): value for name, value in plain.items()}
    return {name: value for name, value in named.items() if name not in _NEVER_SET}


def lists(element: etree._Element, kind: type[msgspec.Struct]) -> dict[str, list[str]]:
    """Values of the fields that are lists of elements inside this one."""
    return {
        field: [str(child.get(item, "")) for child in xml.children_named(element, local)]
        for field, (local, item) in LISTS.items()
        if field in kind.__struct_fields__
    }


def kind_of(local: str, type: str, raw: Mapping[str, Any]) -> type[of.Behavior]:
    """Struct of a behavior. Some elements have several, chosen by their `type` or their content."""
    match local, type:
        case "gesture" | "pointing", "POINT":
            return of.Pointing
        case "face", _ if type == "FACS" or "au" in raw:
            return of.FaceFacs
        case "face", _ if "lexeme" in raw:
            return of.FaceLexeme
    return TYPES[local].kind


def converted(raw: Mapping[str, Any], kind: type[AnyStruct]) -> AnyStruct:
    """Make a struct. Raises msgspec.ValidationError. raw: texts of XML by field; None counts as not given."""
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
    """Value of an attribute. Numbers may be written as in XML (`.5`, `+2`), which JSON does not allow."""
    if not isinstance(value, str):
        return value
    if field in _SPELLED:
        return _SPELLED[field](value)
    if field in _decimals(kind):
        with suppress(ValueError):
            return float(value)
    return value


def says_yes(value: object) -> bool:
    """Tell whether an attribute means true, as XML spells that."""
    return str(value).strip().lower() in ("true", "1")


def is_reference(value: str) -> bool:
    """Tell whether an attribute's value names a sync point of a behavior, and so is meant as timing."""
    with suppress(ValueError):
        return SyncRef.parse(value).behavior != ""
    return False
