"""What a block asks for, read from its XML by the rules of docs/bml.md, without the reader of the project.

Everything is as its author wrote it: names of sync points are those of the block's dialect, as in its feedback.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from typing import Literal, NamedTuple

from msgspec import Struct

BML_1_0 = "http://www.bml-initiative.org/bml/bml-1.0"
SEVEN = ("start", "ready", "stroke_start", "stroke", "stroke_end", "relax", "end")
SEVEN_1_0 = ("start", "ready", "strokeStart", "stroke", "strokeEnd", "relax", "end")
WITH_STROKE = ("gesture", "pointing", "head")
LASTING = ("gaze", "face", "faceLexeme", "faceFacs", "posture")
SHIFTS = ("gazeShift", "headDirectionShift", "faceShift", "postureShift")
OTHERS = ("speech", "wait", "emit", "pose", "locomotion")
TYPES = (*WITH_STROKE, *LASTING, *SHIFTS, *OTHERS)
OPERATORS = ("synchronize", "after", "before")
START = "bml:start"
"""Name of the beginning of a block, from which bare numbers count."""

Kind = Literal["same", "after", "before"]


class Place(NamedTuple):
    """A sync point of a block. behavior: empty: the block itself. number: of a repeated stroke, from 1."""

    block: str
    behavior: str
    sync: str
    number: int = 1


class Term(NamedTuple):
    """A point and the seconds that are added to it."""

    place: Place
    offset: float


class Relation(Struct, frozen=True):
    """`same`: all terms are one instant. `after`, `before`: the second term is, of the first; two terms each.

    text: as written, for messages. own: the behavior that says it of itself, as an attribute; empty: a constraint.
    """

    kind: Kind
    terms: tuple[Term, ...]
    text: str
    required: bool = False
    own: str = ""


class Asked(Struct, frozen=True):
    """A behavior as its author wrote it. points: its default points in order. words: what a speech is to say."""

    id: str
    type: str
    points: tuple[str, ...]
    attributes: Mapping[str, str]
    required: bool = False
    words: str = ""
    is_timed: bool = False

    @property
    def main(self) -> str:
        """The point at which the meaning is seen: the stroke, the arrival on target."""
        if self.type in WITH_STROKE:
            return "stroke"
        if self.type in SHIFTS or self.type in OTHERS:
            return "end"
        if "stroke" in self.points:
            return "stroke"
        return "attackPeak" if "attackPeak" in self.points else "ready"

    @property
    def hand(self) -> str:
        """`left`, `right`, `both`; empty: the body chooses."""
        written = self.attributes.get("mode", "") or self.attributes.get("hand", "")
        return written.lower().removesuffix("_hand").removesuffix("_hands")


class Reading(Struct, frozen=True):
    """A block. relations: in the order in which they are written."""

    id: str
    dialect: Literal["draft", "bml-1.0"]
    composition: str
    behaviors: Mapping[str, Asked]
    relations: tuple[Relation, ...]

    @property
    def speeches(self) -> tuple[str, ...]:
        """Ids of the speeches in the document's order."""
        return tuple(id for id, asked in self.behaviors.items() if asked.type == "speech")


def read(xml: str, others: Mapping[str, Reading] | None = None) -> Reading:
    """Read a block. others: earlier blocks, whose points it may name."""
    root = ET.fromstring(xml)
    dialect: Literal["draft", "bml-1.0"] = "bml-1.0" if root.tag.startswith(f"{{{BML_1_0}}}") else "draft"
    id = root.get("id", "")
    found: dict[str, tuple[Asked, ET.Element]] = {}
    for element, required in _elements(root, required=False):
        if _name(element) in TYPES:
            asked = _asked(element, dialect, required=required)
            found[asked.id] = (asked, element)
    behaviors = {key: asked for key, (asked, _) in found.items()}
    block = Reading(id, dialect, root.get("composition", "MERGE").upper(), behaviors, ())
    known = {**(others or {}), id: block}
    relations = [relation for asked, element in found.values() for relation in _inline(asked, element, block, known)]
    for element, required in _elements(root, required=False):
        if _name(element) == "constraint":
            relations += _constraint(element, block, known, required=required)
    return Reading(id, dialect, block.composition, behaviors, tuple(relations))


def read_all(documents: Iterator[str]) -> dict[str, Reading]:
    """Read blocks that come one after the other; each may name points of those before it."""
    found: dict[str, Reading] = {}
    for xml in documents:
        reading = read(xml, found)
        found[reading.id] = reading
    return found


def term(text: str, block: Reading, known: Mapping[str, Reading]) -> Term | None:
    """What a reference means: `[block:]behavior:sync[:n][+-seconds]`, or `[block:]seconds`; None: nothing known."""
    *parts, tail = re.split(r"\s*:\s*", text.strip())
    if not parts or (len(parts) == 1 and parts[0] not in block.behaviors and _number(tail) is not None):
        seconds = _number(tail)
        of = parts[0] if parts and parts[0] != "bml" else block.id
        return None if seconds is None else Term(Place(of, "", "start"), seconds)
    names = {name for each in known.values() for asked in each.behaviors.values() for name in asked.points}
    sync, offset = tail, 0.0
    if tail not in names and (match := re.fullmatch(r"(.+?)\s*([+-]\s*[\d.]+)", tail)):
        sync, offset = match[1], float(match[2].replace(" ", ""))
    number = 1
    if sync.isdigit() and len(parts) >= 2:
        number, sync = int(sync), parts.pop()
    behavior = parts.pop()
    of = parts.pop() if parts else block.id
    if behavior == "bml":
        return Term(Place(of, "", sync), offset)
    holder = known.get(of)
    if holder is None or parts or behavior not in holder.behaviors:
        return None
    spelled = _spelled(sync, holder.behaviors[behavior], block, holder)
    return None if spelled is None else Term(Place(of, behavior, spelled, number), offset)


def _spelled(sync: str, asked: Asked, block: Reading, holder: Reading) -> str | None:
    """Name of a point in the block that holds it; None if feedback tells of no such point there.

    A reference to another block is spelled as in the block that names it.
    """
    if asked.type == "speech" or block.dialect == holder.dialect:
        return sync if sync in asked.points else None
    if block.dialect == "draft":
        rows = dict(zip(SEVEN, SEVEN_1_0, strict=True))
        if asked.type in ("gaze", "posture"):
            rows = {"start": "start", "stroke": "ready", "relax": "relax", "end": "end"}
        elif asked.type in LASTING:
            rows = {"start": "start", "stroke": "attackPeak", "relax": "relax", "end": "end"}
    else:
        rows = dict(zip(SEVEN_1_0, SEVEN, strict=True))
        if asked.type in LASTING:
            rows |= {"ready": "stroke", "attackPeak": "stroke"}
    name = rows.get(sync, "")
    return name if name in asked.points else None


def _elements(parent: ET.Element, *, required: bool) -> Iterator[tuple[ET.Element, bool]]:
    for element in parent:
        if _name(element) == "required":
            yield from _elements(element, required=True)
        else:
            yield element, required or element.get("required") == "true"


def _asked(element: ET.Element, dialect: str, *, required: bool) -> Asked:
    type, attributes = _name(element), dict(element.attrib)
    if type == "gesture" and attributes.get("type") == "POINT":
        type = "pointing"
    words = ""
    marks: list[str] = []
    if type == "speech":
        holder = next((each for each in element if _name(each) == "text"), element)
        words = " ".join("".join(holder.itertext()).split())
        marks = [each.get("id", "") for each in holder if _name(each) in ("sync", "tm", "mark")]
    if (inner := next((each for each in element if _name(each) in ("lexeme", "pose")), None)) is not None:
        attributes.setdefault("lexeme", inner.get("lexeme", ""))
    points: tuple[str, ...] = ("start", *marks, "end")
    if type in WITH_STROKE:
        points = SEVEN if dialect == "draft" else SEVEN_1_0
    elif type in LASTING:
        middle = "ready" if type in ("gaze", "posture") else "attackPeak"
        points = SEVEN if dialect == "draft" else ("start", middle, "relax", "end")
    timed = any(name in points for name in attributes)
    return Asked(element.get("id", ""), type, points, attributes, required, words, timed)


def _inline(asked: Asked, element: ET.Element, block: Reading, known: Mapping[str, Reading]) -> Iterator[Relation]:
    marks = asked.points[1:-1] if asked.type == "speech" else ()
    for name, text in element.attrib.items():
        if name in asked.points and name not in marks and (to := term(text, block, known)) is not None:
            own = Term(Place(block.id, asked.id, name), 0.0)
            yield Relation("same", (to, own), f'{asked.id}: {name}="{text}"', own=asked.id)


def _constraint(
    element: ET.Element, block: Reading, known: Mapping[str, Reading], *, required: bool
) -> Iterator[Relation]:
    for operator in element:
        kind = _name(operator)
        if kind not in OPERATORS:
            continue
        texts = [text for text in [operator.get("ref", "")] if text]
        texts += [each.get("ref", "") for each in operator if _name(each) == "sync"]
        terms = [term(text, block, known) for text in texts]
        where = f"<{kind}> {' '.join(texts)}"
        if kind == "synchronize":
            yield Relation("same", tuple(each for each in terms if each is not None), where, required)
        elif terms and terms[0] is not None:
            order: Kind = "after" if kind == "after" else "before"
            for other in terms[1:]:
                if other is not None:
                    yield Relation(order, (terms[0], other), where, required)


def _number(text: str) -> float | None:
    return float(text) if re.fullmatch(r"[+-]?\d+(\.\d+)?", text.replace(" ", "")) else None


def _name(element: ET.Element) -> str:
    return str(element.tag).rpartition("}")[2]
