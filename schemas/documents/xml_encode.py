"""Blocks and fragments as XML: the thesis' dialect, or BML 1.0 for a block written in it.

What is written decodes to the equal struct, but for `line`.
"""

import re
from collections.abc import Sequence
from typing import Any

from lxml import etree
from msgspec import NODEFAULT, structs

from engage_hri.schemas import behaviors as of
from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.xml_source import BML_1_0, DRAFT, EBML
from engage_hri.schemas.documents.xml_speech import fill, ties
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import type_name
from engage_hri.schemas.syncref import SYNC_POINTS

_ELSEWHERE = frozenset({
    "id", "line", "timing", "required", "marks", "text", "markup", "options", "objects", "anchors", "distractors",
    "behaviors", "constraints", "operators", "syncs", "dialect", "unread",
})  # fmt: skip
"""Fields that are not simply an attribute."""
_NAMES = {"minimum_reliability": "minReliability"}
_INLINE = frozenset({*SYNC_POINTS, "strokeStart", "strokeEnd", "attackPeak"})


def encode_xml(thing: Block | TurnFragment) -> bytes:
    """The XML document, UTF-8. Raises InputRefused for text that XML can't hold (control characters)."""
    try:
        root = _fragment(thing) if isinstance(thing, TurnFragment) else _block(thing)
    except ValueError as error:
        raise InputRefused(Fault(reason=str(error), where=thing.id, advice="send it as JSON")) from error
    etree.cleanup_namespaces(root)
    _indent(root, 0)
    return etree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def _block(block: Block) -> etree._Element:
    namespace = BML_1_0 if block.dialect == "bml-1.0" else DRAFT
    root = etree.Element(f"{{{namespace}}}bml", {"id": block.id}, nsmap=_prefixes(namespace))
    _set_fields(root, block)
    _content(root, namespace, block)
    return root


def _fragment(fragment: TurnFragment) -> etree._Element:
    root = etree.Element(f"{{{EBML}}}ebml", {"id": fragment.id}, nsmap=_prefixes(DRAFT))
    root.set("turnIndex", str(fragment.turn_index))
    root.set("turnStatus", fragment.turn_status)
    _set_fields(root, fragment)
    _content(root, DRAFT, fragment)
    return root


def _prefixes(namespace: str) -> dict[str, str]:
    return {None: namespace, "ebml": EBML}  # type: ignore[dict-item]  # None is lxml's default namespace


def _content(root: etree._Element, namespace: str, thing: Block | TurnFragment) -> None:
    for behavior in thing.behaviors:
        _behavior(_required(root, namespace, behavior.required), namespace, behavior)
    for constraint in thing.constraints:
        element = etree.SubElement(_required(root, namespace, constraint.required), f"{{{namespace}}}constraint")
        if constraint.id:
            element.set("id", constraint.id)
        for operator in constraint.operators:
            inner = etree.SubElement(element, f"{{{namespace}}}{type(operator).__struct_config__.tag}")
            if operator.ref or not isinstance(operator, of.Synchronize):
                inner.set("ref", operator.ref)
            for sync in operator.syncs:
                etree.SubElement(inner, f"{{{namespace}}}sync", {"ref": sync})


def _required(root: etree._Element, namespace: str, required: bool) -> etree._Element:
    return etree.SubElement(root, f"{{{namespace}}}required") if required else root


def _behavior(root: etree._Element, namespace: str, behavior: of.Behavior) -> None:
    local = type_name(behavior)
    points = isinstance(behavior, of.Pointing) and namespace == DRAFT
    tag = f"{{{namespace if TYPES[local].is_standard else EBML}}}{'gesture' if points else local}"
    element = etree.SubElement(root, tag, {"id": behavior.id})
    if points:
        element.set("type", "POINT")
    if not isinstance(behavior, of.Posture | of.PostureShift):
        _set_fields(element, behavior)
    tied = ties(behavior, namespace) if isinstance(behavior, of.Speech) else {}
    _set_timing(element, [timing for timing in behavior.timing if timing.sync not in tied])
    match behavior:
        case of.Speech():
            fill(element, behavior, namespace)
        case of.Posture() | of.PostureShift():
            if behavior.stance:
                etree.SubElement(element, f"{{{namespace}}}stance", {"type": behavior.stance})
            if behavior.part or behavior.lexeme:
                pose = {"part": behavior.part, "lexeme": behavior.lexeme}
                etree.SubElement(element, f"{{{namespace}}}pose", pose)
        case of.FaceShift() if namespace == BML_1_0:
            _nest_expression(element)
        case of.Reference():
            if behavior.options is None:
                element.set("propose", "true")
            for option in behavior.options or ():
                inner = etree.SubElement(element, f"{{{namespace}}}speechOption", {"text": option.text})
                _set_fields(inner, option)
                for distractor in option.distractors:
                    etree.SubElement(inner, f"{{{namespace}}}distractor", {"object": distractor})
        case of.Event():
            for id in behavior.objects:
                etree.SubElement(element, f"{{{EBML}}}object", {"id": id})
            for anchor in behavior.anchors:
                etree.SubElement(element, f"{{{EBML}}}anchor", {"ref": anchor})


def _nest_expression(shift: etree._Element) -> None:
    """BML 1.0 has the one expression of a shift inside it."""
    given = [name for name in ("lexeme", "au") if name in shift.attrib]
    if len(given) != 1:
        return
    local, names = ("lexeme", ("lexeme",)) if given == ["lexeme"] else ("facs", ("au", "side"))
    child = etree.SubElement(shift, f"{{{BML_1_0}}}{local}")
    for name in names:
        if name in shift.attrib:
            child.set(name, shift.attrib.pop(name))


def _set_timing(element: etree._Element, timings: Sequence[of.Timing]) -> None:
    names = [timing.sync for timing in timings]
    if _INLINE.issuperset(names) and len(set(names)) == len(names):
        for timing in timings:
            element.set(timing.sync, timing.ref)
        return
    for timing in timings:
        etree.SubElement(element, f"{{{EBML}}}timing", {"sync": timing.sync, "ref": timing.ref})


def _set_fields(element: etree._Element, thing: Any) -> None:
    """Every field that differs from its default as an attribute in camelCase."""
    for field in structs.fields(thing):
        value = getattr(thing, field.name)
        if field.name in _ELSEWHERE or (field.default is not NODEFAULT and value == field.default):
            continue
        element.set(_NAMES.get(field.name, _camel(field.name)), _text(value))


def _text(value: object) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case tuple():
            return " ".join(str(item) for item in value)
        case float():
            return repr(value)
    return str(value)


def _camel(field: str) -> str:
    return re.sub("_([a-z])", lambda match: match[1].upper(), field)


def _indent(element: etree._Element, level: int) -> None:
    """Line breaks between elements, but none inside <text> and <description>, where white space is speech."""
    if len(element) == 0 or str(element.tag).endswith(("}text", "}description")):
        return
    for child in element:
        _indent(child, level + 1)
        child.tail = "\n" + "  " * (level + 1)
    element.text = "\n" + "  " * (level + 1)
    element[-1].tail = "\n" + "  " * level
