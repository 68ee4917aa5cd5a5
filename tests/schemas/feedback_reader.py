"""Reader of feedback that was written as XML."""

from collections.abc import Iterable
from typing import Any

import msgspec
from lxml import etree

from engage_hri.schemas.documents.xml_feedback import CLOCK, FORMS, Form
from engage_hri.schemas.documents.xml_source import EBML, Source, local_name, split
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.feedback import (
    BlockProgress,
    Feedback,
    PlannedPoint,
    PredictionFeedback,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.units import Stamp


def decode_feedback(data: bytes | str, source: str = "") -> tuple[Feedback, ...]:
    """Read the messages of one element, or of a stream in `<ebml:feedback>`. Raises InputRefused with the line."""
    document = Source(data, source)
    root = document.root
    elements: Iterable[etree._Element] = root if split(str(root.tag)) == (EBML, "feedback") else (root,)
    return tuple(_read(document, element) for element in elements)


def _read(source: Source, element: etree._Element) -> Feedback:
    local = local_name(element)
    if local not in (*FORMS, "predictionFeedback"):
        known = "blockProgress, syncPointProgress, predictionFeedback, warningFeedback"
        raise source.refusal(f"<{local}> is no feedback", element, advice=f"known: {known}")
    try:
        return _read_prediction(element) if local == "predictionFeedback" else _read_form(element, FORMS[local])
    except (ValueError, LookupError, msgspec.ValidationError) as error:
        fault = Fault(reason=f"<{local}>: {error}", where=source.name, line=source.line(element))
        raise InputRefused(fault) from error


def _read_form(element: etree._Element, form: Form) -> Feedback:
    fields: dict[str, Any] = {"character_id": element.get("characterId", ""), "type": form.kind.__struct_config__.tag}
    split_id = str.rsplit if form.kind is BlockProgress else str.split
    fields |= dict(zip(form.id, split_id(str(element.get("id", "")), ":", len(form.id) - 1), strict=False))
    if form.kind is not SyncPointProgress:
        fields["block"] = fields["block"] or None
    fields |= {field: element.get(name) for field, name in form.attributes.items() if name in element.attrib}
    if seconds := fields.pop("at", None) or element.get("globalTime"):
        fields["at"] = Stamp(str(element.get(CLOCK, "")), float(seconds))
    if form.kind is WarningFeedback:
        fields["message"] = element.text or ""
    return msgspec.convert(fields, form.kind, strict=False)


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
    clock, start = str(about.get(CLOCK, "")), about.get("globalStart")
    at = None if start is None else Stamp(clock, float(start))
    block, character = str(about.attrib["id"]), str(element.get("characterId", ""))
    return PredictionFeedback(block=block, points=tuple(points), at=at, character_id=character)


def _named(point: etree._Element) -> tuple[str, str]:
    """Name and time of a point that is an element of its own: a mark of a speech, or an `ebml:point`."""
    name, time = ("id", "ref") if local_name(point) == "sync" else ("sync", "time")
    return str(point.attrib[name]), str(point.attrib[time])
