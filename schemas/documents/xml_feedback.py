"""Feedback as XML in the forms of BML 1.0, and back.

    <blockProgress id="block-1:start" globalTime="12.5" characterId="Melvin"/>
    <syncPointProgress id="block-1:gaze-1:ready" time="0.5" globalTime="13.0"/>
    <predictionFeedback><bml id="block-1" globalStart="12.5" globalEnd="15.0"/>
        <gaze id="block-1:gaze-1" start="0.0" ready="0.5"/></predictionFeedback>
    <warningFeedback id="block-1:gaze-9" type="NO_SUCH_TARGET">nobody knows it</warningFeedback>

What BML has no word for (skew, source, status, who stamped the time, when a warning was given) stands in attributes
of our own namespace. Marks of a speech are in its text: `<text><sync id="m1" ref="1.2"/></text>`. A point whose name
can't be that of an attribute is an `ebml:point`. A stream of feedback is one `<ebml:feedback>`.
"""

import re
from collections.abc import Callable, Iterable
from itertools import groupby
from typing import Any

import msgspec
from lxml import etree

from engage_hri.schemas.documents.xml_source import BML_1_0, EBML, Source, split
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.feedback import (
    BlockProgress,
    Feedback,
    PlannedPoint,
    PredictionFeedback,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.units import Seconds, Stamp

HEAD = f'<?xml version="1.0" encoding="UTF-8"?>\n<ebml:feedback xmlns:ebml="{EBML}" xmlns="{BML_1_0}">\n'
TAIL = "</ebml:feedback>\n"
"""What stands before and behind the elements of a stream."""
_ATTRIBUTE = re.compile(r"(?!xml|id$|type$)[A-Za-z_][A-Za-z0-9_.-]*", re.IGNORECASE)
_OURS = ("event", "turn", "unknown")
_GLOBAL_TIME = f"{{{EBML}}}globalTime"
"""Of a warning: there BML knows no time."""
_UNWRITABLE = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def encode_feedback(message: Feedback, *, in_stream: bool = False) -> str:
    """One element, without the line end. in_stream: between HEAD and TAIL, which declare the namespaces."""
    match message:
        case BlockProgress():
            element = _block_progress(message)
        case SyncPointProgress():
            element = _sync_point_progress(message)
        case PredictionFeedback():
            element = _prediction(message)
        case WarningFeedback():
            element = _warning(message)
    if message.character_id:
        element.set("characterId", _clean(message.character_id))
    etree.cleanup_namespaces(element)
    text = etree.tostring(element, encoding="unicode")
    if in_stream:
        for declared in (f' xmlns="{BML_1_0}"', f' xmlns:ebml="{EBML}"'):
            text = text.replace(declared, "", 1)
    return text


def _block_progress(message: BlockProgress) -> etree._Element:
    element = _element("blockProgress", f"{message.block or ''}:{message.progress}")
    _set_global_time(element, message.at)
    _set(element, time=message.time, status=message.status)
    return element


def _sync_point_progress(message: SyncPointProgress) -> etree._Element:
    element = _element("syncPointProgress", f"{message.block}:{message.behavior}:{message.sync}")
    element.set("time", _number(message.time))
    _set_global_time(element, message.at)
    _set(element, predicted=message.predicted, arrived=message.arrived, skew=message.skew, source=message.source)
    return element


def _prediction(message: PredictionFeedback) -> etree._Element:
    element = etree.Element(f"{{{BML_1_0}}}predictionFeedback", nsmap=_PREFIXES)
    block = etree.SubElement(element, f"{{{BML_1_0}}}bml", {"id": _clean(message.block)})
    if message.at is not None:
        last = max((point.time for point in message.points), default=0.0)
        block.set("globalStart", _number(message.at.seconds))
        block.set("globalEnd", _number(message.at.seconds + last))
        _set(block, clock=message.at.clock)
    for (behavior, type), points in groupby(message.points, lambda point: (point.behavior, point.type)):
        is_known = _ATTRIBUTE.fullmatch(type) is not None
        tag = f"{{{EBML if type in _OURS else BML_1_0}}}{type}" if is_known else f"{{{EBML}}}behavior"
        child = etree.SubElement(element, tag, {"id": _clean(f"{message.block}:{behavior}")})
        for point in points:
            if type == "speech" and point.sync not in ("start", "end"):
                text = child[0] if len(child) else etree.SubElement(child, f"{{{BML_1_0}}}text")
                written = {"id": _clean(point.sync), "ref": _number(point.time)}
                etree.SubElement(text, f"{{{BML_1_0}}}sync", written)
            elif _ATTRIBUTE.fullmatch(point.sync) and point.sync not in child.attrib:
                child.set(point.sync, _number(point.time))
            else:
                written = {"sync": _clean(point.sync), "time": _number(point.time)}
                etree.SubElement(child, f"{{{EBML}}}point", written)
    return element


def _warning(message: WarningFeedback) -> etree._Element:
    id = ":".join(filter(None, (message.block, message.behavior)))
    element = etree.Element(f"{{{BML_1_0}}}warningFeedback", nsmap=_PREFIXES)
    if id:
        element.set("id", _clean(id))
    element.set("type", message.kind)
    if message.at is not None:
        _set(element, globalTime=message.at.seconds, clock=message.at.clock)
    element.text = _clean(message.message)
    return element


_PREFIXES: Any = {None: BML_1_0, "ebml": EBML}


def _element(local: str, id: str) -> etree._Element:
    return etree.Element(f"{{{BML_1_0}}}{local}", {"id": _clean(id)}, nsmap=_PREFIXES)


def _set_global_time(element: etree._Element, at: Stamp) -> None:
    element.set("globalTime", _number(at.seconds))
    _set(element, clock=at.clock)


def _set(element: etree._Element, **fields: Seconds | str | None) -> None:
    """Attributes of ours, unless empty."""
    for name, value in fields.items():
        if value not in (None, ""):
            element.set(f"{{{EBML}}}{name}", _number(value) if isinstance(value, float) else _clean(str(value)))


def _number(seconds: Seconds) -> str:
    return repr(float(seconds) + 0.0)


def _clean(text: str) -> str:
    """Without what XML can't hold (control characters)."""
    return _UNWRITABLE.sub("\ufffd", text)


def decode_feedback(data: bytes | str, source: str = "") -> tuple[Feedback, ...]:
    """The messages of one element, or of a stream in its `<ebml:feedback>`. Raises InputRefused with the line."""
    document = Source(data, source)
    root = document.root
    elements: Iterable[etree._Element] = root if split(str(root.tag)) == (EBML, "feedback") else (root,)
    return tuple(_read(document, element) for element in elements)


def _read(source: Source, element: etree._Element) -> Feedback:
    local = split(str(element.tag))[1]
    readers: dict[str, Callable[[etree._Element], Feedback]] = {
        "blockProgress": _read_block_progress,
        "syncPointProgress": _read_sync_point_progress,
        "predictionFeedback": _read_prediction,
        "warningFeedback": _read_warning,
    }
    if local not in readers:
        raise source.refusal(f"<{local}> is no feedback", element, advice=f"known: {', '.join(readers)}")
    try:
        return readers[local](element)
    except (ValueError, LookupError, msgspec.ValidationError) as error:
        fault = Fault(reason=f"<{local}>: {error}", where=source.name, line=source.line(element))
        raise InputRefused(fault) from error


def _read_block_progress(element: etree._Element) -> BlockProgress:
    block, _, progress = str(element.attrib["id"]).rpartition(":")
    fields = {"type": "block_progress", "block": block or None, "progress": progress, "at": _at(element)}
    return msgspec.convert(fields | _extra(element, "time", "status"), BlockProgress, strict=False)


def _read_sync_point_progress(element: etree._Element) -> SyncPointProgress:
    block, behavior, sync = str(element.attrib["id"]).split(":", 2)
    fields = {"type": "sync_point_progress", "block": block, "behavior": behavior, "sync": sync, "at": _at(element)}
    fields |= {"time": element.attrib["time"]} | _extra(element, "predicted", "arrived", "skew", "source")
    return msgspec.convert(fields, SyncPointProgress, strict=False)


def _read_prediction(element: etree._Element) -> PredictionFeedback:
    about, *behaviors = element
    points = []
    for child in behaviors:
        namespace, type = split(str(child.tag))
        behavior = str(child.attrib["id"]).rpartition(":")[2]
        timed = [(str(name), str(time)) for name, time in child.items() if name != "id"]
        timed += [_named(point) for point in child.iter("{*}sync", "{*}point")]
        timed.sort(key=lambda point: type == "speech" and point[0] == "end")
        type = "" if namespace == EBML and type == "behavior" else type
        points += [PlannedPoint(behavior=behavior, sync=sync, time=float(time), type=type) for sync, time in timed]
    at = Stamp(_clock(about), float(about.attrib["globalStart"])) if "globalStart" in about.attrib else None
    block = str(about.attrib["id"])
    return PredictionFeedback(block=block, points=tuple(points), at=at, character_id=element.get("characterId", ""))


def _named(point: etree._Element) -> tuple[str, str]:
    """A mark of a speech, or a point of our own."""
    name, time = ("id", "ref") if split(str(point.tag))[1] == "sync" else ("sync", "time")
    return str(point.attrib[name]), str(point.attrib[time])


def _read_warning(element: etree._Element) -> WarningFeedback:
    block, _, behavior = element.get("id", "").partition(":")
    fields = {
        "type": "warning",
        "block": block or None,
        "behavior": behavior,
        "kind": element.attrib["type"],
        "message": element.text or "",
        "at": _at(element) if {"globalTime", _GLOBAL_TIME} & set(element.attrib) else None,
    }
    return msgspec.convert(fields | _extra(element), WarningFeedback, strict=False)


def _at(element: etree._Element) -> Stamp:
    seconds = element.attrib.get(_GLOBAL_TIME) or element.attrib["globalTime"]
    return Stamp(_clock(element), float(seconds))


def _clock(element: etree._Element) -> str:
    return str(element.get(f"{{{EBML}}}clock", ""))


def _extra(element: etree._Element, *names: str) -> dict[str, Any]:
    """Those of our own attributes that are there."""
    found = {name: str(value) for name in names if (value := element.get(f"{{{EBML}}}{name}")) is not None}
    return found | {"character_id": str(element.get("characterId", ""))}
