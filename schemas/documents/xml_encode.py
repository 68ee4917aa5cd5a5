"""Writing of blocks and fragments as XML: in the thesis' dialect, or in BML 1.0 for a block of that dialect.

Reading the document gives an equal struct again, but for `line`.
"""

from collections.abc import Sequence
from typing import Any

from lxml import etree
from msgspec import NODEFAULT, Struct, structs

from engage_hri.schemas import behaviors as of
from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents import xml_grammar as grammar
from engage_hri.schemas.documents import xml_source as xml
from engage_hri.schemas.documents.xml_speech import fill, ties
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import SYNC_NAMES, type_name

_ELSEWHERE = ("id", "required", "markup")
"""Fields that are written apart: `required`, for example, is an element around the others."""
_ALWAYS = ("turn_index", "turn_status")
"""Fields that are written even at their default."""


def encode_xml(thing: Block | TurnFragment) -> bytes:
    """Write the XML document, in UTF-8. Raises InputRefused for text that XML can't hold (control characters)."""
    try:
        root = _document(thing)
    except ValueError as error:
        raise InputRefused(Fault(reason=str(error), where=thing.id, advice="send it as JSON")) from error
    etree.cleanup_namespaces(root)
    _indent(root, 0)
    return etree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def _document(thing: Block | TurnFragment) -> etree._Element:
    namespace = xml.BML_1_0 if isinstance(thing, Block) and thing.dialect == "bml-1.0" else xml.DRAFT
    tag = f"{{{namespace}}}bml" if isinstance(thing, Block) else f"{{{xml.EBML}}}ebml"
    prefixes: Any = {None: namespace, "ebml": xml.EBML}  # None is lxml's default namespace
    root = etree.Element(tag, {"id": thing.id}, nsmap=prefixes)
    _set_fields(root, thing, namespace)
    for behavior in thing.behaviors:
        _behavior(_required(root, namespace, behavior.required), namespace, behavior)
    for constraint in thing.constraints:
        element = etree.SubElement(_required(root, namespace, constraint.required), f"{{{namespace}}}constraint")
        if constraint.id:
            element.set("id", constraint.id)
        for operator in constraint.operators:
            inner = etree.SubElement(element, f"{{{namespace}}}{operator.__struct_config__.tag}")
            _set_fields(inner, operator, namespace)
    return root


def _required(root: etree._Element, namespace: str, required: bool) -> etree._Element:
    return etree.SubElement(root, f"{{{namespace}}}required") if required else root


def _behavior(root: etree._Element, namespace: str, behavior: of.Behavior) -> None:
    local = type_name(behavior)
    tag = f"{{{namespace if TYPES[local].is_standard else xml.EBML}}}{local}"
    plain = {"id": behavior.id}
    if isinstance(behavior, of.Pointing) and namespace == xml.DRAFT:
        tag, plain = f"{{{xml.DRAFT}}}gesture", plain | {"type": "POINT"}
    element = etree.SubElement(root, tag, plain)
    _set_fields(element, behavior, xml.EBML)
    if behavior.needs and TYPES[local].is_standard:  # BML has no such attribute
        element.set(f"{{{xml.EBML}}}needs", element.attrib.pop("needs"))
    tied = ties(behavior, namespace) if isinstance(behavior, of.Speech) else {}
    _set_timing(element, [timing for timing in behavior.timing if timing.sync not in tied])
    match behavior:
        case of.Speech():
            fill(element, behavior, namespace)
        case of.Posture() | of.PostureShift():
            _nest(element, namespace, grammar.CHILDREN[local])
            for pose in behavior.poses:
                etree.SubElement(element, f"{{{namespace}}}pose", {"part": pose.part, "lexeme": pose.lexeme})
        case of.Face():
            _express(element, namespace, behavior.expressions)
        case of.FaceShift() if behavior.expressions:
            _express(element, namespace, behavior.expressions)
        case of.FaceShift() if namespace == xml.BML_1_0 and not (behavior.lexeme and behavior.au):
            _nest(element, namespace, ["lexeme"] if behavior.lexeme else ["facs"] if behavior.au else [])
        case of.Reference():
            if behavior.options is None:
                element.set("propose", "true")
            for option in behavior.options or ():
                _set_fields(etree.SubElement(element, f"{{{namespace}}}speechOption"), option, namespace)


def _nest(element: etree._Element, namespace: str, parts: Sequence[str]) -> None:
    """Move attributes of a face or posture into the elements of its parts; the amount stays with the whole."""
    for part in parts:
        fields = {name: field for name, field in grammar.PARTS[part].items() if field != "amount"}
        said = {name: str(element.attrib.pop(field, "")) for name, field in fields.items()}
        if any(said.values()):
            said = {name: value for name, value in said.items() if value or part == "pose"}  # which has both
            etree.SubElement(element, f"{{{namespace}}}{part}", said)


def _express(face: etree._Element, namespace: str, expressions: Sequence[of.Expression]) -> None:
    for each in expressions:
        inner = etree.SubElement(face, f"{{{namespace}}}{'lexeme' if each.lexeme else 'facs'}")
        _set_fields(inner, each, namespace)


def _set_timing(element: etree._Element, timings: Sequence[of.Timing]) -> None:
    names = [timing.sync for timing in timings]
    if SYNC_NAMES.issuperset(names) and len(set(names)) == len(names):
        for timing in timings:
            element.set(timing.sync, timing.ref)
        return
    for timing in timings:
        etree.SubElement(element, f"{{{xml.EBML}}}timing", {"sync": timing.sync, "ref": timing.ref})


def _set_fields(element: etree._Element, thing: Struct, namespace: str) -> None:
    """Write every field that differs from its default, as an attribute or as elements of the namespace."""
    attributes = grammar.attribute_fields(type(thing))
    for field in structs.fields(thing):
        value = getattr(thing, field.name)
        is_default = field.default is not NODEFAULT and value == field.default and field.name not in _ALWAYS
        if field.name in attributes and field.name not in _ELSEWHERE and not is_default:
            element.set(grammar.attribute(field.name), _text(value))
    for name, (local, item) in grammar.LISTS.items():
        for value in getattr(thing, name, ()):
            etree.SubElement(element, f"{{{namespace}}}{local}", {item: value})


def _text(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _indent(element: etree._Element, level: int) -> None:
    """Put line breaks between elements, but not inside <text> and <description>, where white space is speech."""
    if len(element) == 0 or str(element.tag).endswith(("}text", "}description")):
        return
    for child in element:
        _indent(child, level + 1)
        child.tail = "\n" + "  " * (level + 1)
    element.text = "\n" + "  " * (level + 1)
    element[-1].tail = "\n" + "  " * level
