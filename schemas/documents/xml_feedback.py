"""Feedback as XML in the forms of BML 1.0.

    <blockProgress id="block-1:start" globalTime="12.5" characterId="Melvin"/>
    <syncPointProgress id="block-1:gaze-1:ready" time="0.5" globalTime="13.0"/>
    <predictionFeedback><bml id="block-1" globalStart="12.5" globalEnd="15.0"/>
        <gaze id="block-1:gaze-1" start="0.0" ready="0.5"/></predictionFeedback>
    <warningFeedback id="block-1:gaze-9" type="NO_SUCH_TARGET">nobody knows it</warningFeedback>

Values without a word in BML (skew, source, status, the clock of an instant, the time of a warning) stand in
attributes of our own namespace. Marks of a speech are in its text: `<text><sync id="m1" ref="1.2"/></text>`. A point
with a name that no attribute can have is an `ebml:point`. A stream of feedback is one `<ebml:feedback>`.
"""

import re
from collections.abc import Mapping
from itertools import groupby
from typing import Any, NamedTuple

from lxml import etree

from engage_hri.schemas.documents.xml_source import BML_1_0, EBML
from engage_hri.schemas.feedback import (
    BlockProgress,
    Feedback,
    PredictionFeedback,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.units import Seconds, Stamp

HEAD = f'<?xml version="1.0" encoding="UTF-8"?>\n<ebml:feedback xmlns:ebml="{EBML}" xmlns="{BML_1_0}">\n'
TAIL = "</ebml:feedback>\n"
"""Texts before and behind the elements of a stream."""
_ATTRIBUTE = re.compile(r"(?!xml|id$|type$)[A-Za-z_][A-Za-z0-9_.-]*", re.IGNORECASE)
_EBML_TYPES = ("event", "turn", "unknown")
_PREFIXES: Any = {None: BML_1_0, "ebml": EBML}
_UNWRITABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


def _ebml(*names: str) -> dict[str, str]:
    """Fields with their attributes, of the same name in our namespace."""
    return {name: f"{{{EBML}}}{name}" for name in names}


class Form(NamedTuple):
    """Form of a message as one element. id: fields that make up its id. attributes: of its other fields, by field."""

    kind: type[BlockProgress | SyncPointProgress | WarningFeedback]
    id: tuple[str, ...]
    attributes: Mapping[str, str]


_GLOBAL_TIME = f"{{{EBML}}}globalTime"
"""Attribute for the time of a warning, which BML does not know."""
CLOCK = f"{{{EBML}}}clock"
FORMS = {
    "blockProgress": Form(
        BlockProgress, ("block", "progress"), {"at": "globalTime", **_ebml("time", "status")},
    ),
    "syncPointProgress": Form(
        SyncPointProgress, ("block", "behavior", "sync"),
        {"time": "time", "at": "globalTime", **_ebml("predicted", "arrived", "skew", "source")},
    ),
    "warningFeedback": Form(WarningFeedback, ("block", "behavior"), {"kind": "type", "at": _GLOBAL_TIME}),
}  # fmt: skip
"""Forms of all messages but predictions, by element."""
_NAMES = {form.kind: name for name, form in FORMS.items()}


def encode_feedback(message: Feedback, *, in_stream: bool = False) -> str:
    """Write a message as one element, without the line end. in_stream: HEAD declares the namespaces."""
    element = _prediction(message) if isinstance(message, PredictionFeedback) else _element(message)
    if message.character_id:
        element.set("characterId", _clean(message.character_id))
    etree.cleanup_namespaces(element)
    text = etree.tostring(element, encoding="unicode")
    if in_stream:
        for declared in (f' xmlns="{BML_1_0}"', f' xmlns:ebml="{EBML}"'):
            text = text.replace(declared, "", 1)
    return text


def _element(message: BlockProgress | SyncPointProgress | WarningFeedback) -> etree._Element:
    local = _NAMES[type(message)]
    form = FORMS[local]
    element = etree.Element(f"{{{BML_1_0}}}{local}", nsmap=_PREFIXES)
    if id := ":".join(getattr(message, field) or "" for field in form.id).rstrip(":"):
        element.set("id", _clean(id))
    for field, name in form.attributes.items():
        _set(element, name, getattr(message, field))
    if isinstance(message, WarningFeedback):
        element.text = _clean(message.message)
    return element


def _set(element: etree._Element, name: str, value: Seconds | Stamp | str | None) -> None:
    """Set an attribute, unless its value is empty; of an instant the clock as well."""
    if isinstance(value, Stamp):
        _set(element, name, float(value.seconds))
        _set(element, CLOCK, value.clock)
    elif value not in (None, ""):
        element.set(name, _number(value) if isinstance(value, float) else _clean(str(value)))


def _prediction(message: PredictionFeedback) -> etree._Element:
    element = etree.Element(f"{{{BML_1_0}}}predictionFeedback", nsmap=_PREFIXES)
    block = etree.SubElement(element, f"{{{BML_1_0}}}bml", {"id": _clean(message.block)})
    if message.at is not None:
        last = max((point.time for point in message.points), default=0.0)
        block.set("globalStart", _number(message.at.seconds))
        block.set("globalEnd", _number(message.at.seconds + last))
        _set(block, CLOCK, message.at.clock)
    for (behavior, type), points in groupby(message.points, lambda point: (point.behavior, point.type)):
        is_known = _ATTRIBUTE.fullmatch(type) is not None
        tag = f"{{{EBML if type in _EBML_TYPES else BML_1_0}}}{type}" if is_known else f"{{{EBML}}}behavior"
        child = etree.SubElement(element, tag, {"id": _clean(f"{message.block}:{behavior}")})
        for point in points:
            if type == "speech" and point.sync not in ("start", "end"):
                text = child[0] if len(child) else etree.SubElement(child, f"{{{BML_1_0}}}text")
                etree.SubElement(text, f"{{{BML_1_0}}}sync", id=_clean(point.sync), ref=_number(point.time))
            elif _ATTRIBUTE.fullmatch(point.sync) and point.sync not in child.attrib:
                child.set(point.sync, _number(point.time))
            else:
                etree.SubElement(child, f"{{{EBML}}}point", sync=_clean(point.sync), time=_number(point.time))
    return element


def _number(seconds: Seconds) -> str:
    return repr(float(seconds) + 0.0)


def _clean(text: str) -> str:
    """Replace the characters that XML can't hold (control characters)."""
    return _UNWRITABLE.sub("\ufffd", text)
