"""Writes docs/vocabulary.md: what the simulated body does with all that the dialects define. `make generate`.

Each term is written as a block, read, and planned on the simulated body; nothing here knows what comes out.
`tests/realizer/test_vocabulary.py` plays the same blocks, and holds the page to what happens.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal, NamedTuple

from engage_hri.schemas.behaviors import Emit, Speech, Unknown, Wait
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.documents.xml_source import BML_1_0, DRAFT
from engage_hri.schemas.references import type_name
from engage_hri.schemas.vocabulary import NAMES, Term, terms
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.torso import kinematics
from engage_hri.services.control.torso.choreography import plan
from engage_hri.services.control.torso.course import Impossible, Situation

PAGE = Path(__file__).resolve().parents[2] / "docs" / "vocabulary.md"
HEAD = """\
# What the simulated body does with BML

Everything that BML 1.0 and the draft of 2007 define, as `schemas/vocabulary.py` lists it: elements, attributes, and the
values of attributes. Performed is what needs no warning. What is degraded is performed with one warning (`DEGRADED`)
that names what was asked and what is done instead. What is dropped costs the behavior, with one warning. A repertoire file
([control.md](control.md)) changes it: lexemes of yours, or others for these. This page is made from the code: `make generate`.
"""
WORLD = World(
    entities=(
        Entity(id="human", kind="person", position=(1.3, 0.0, 1.2)),
        Entity(id="cup", kind="object", position=(0.45, -0.25, 0.73), radius=0.03),
    )
)
SAMPLES: Mapping[str, str] = {
    "target": "cup", "offsetAngle": "10", "amount": "0.6", "overshoot": "0.2", "repetition": "2", "repeats": "2",
    "duration": "0.5", "event": "e", "proximity": "1", "velocity": "1", "dynamic": "true", "facing": "LEFT",
    "lexeme": "BEAT", "offset": "0.5", "separation": "0.5", "viseme": "A", "articulation": "0.5", "flapping": "true",
    "au": "12", "side": "LEFT",
}  # fmt: skip
"""Values of attributes that may have any."""
NEEDED: Mapping[str, str] = {
    "gaze": 'target="cup"', "gazeShift": 'target="cup"', "gesture": 'lexeme="BEAT"', "pointing": 'target="cup"',
    "head": 'lexeme="NOD"', "headDirectionShift": 'target="cup"', "faceLexeme": 'lexeme="SMILE"',
    "faceFacs": 'au="12"', "locomotion": 'target="cup"', "emit": 'event="e"', "wait": 'duration="0.5"',
    "lexeme": 'lexeme="SMILE"', "facs": 'au="12"', "stance": 'type="STANDING"', "pose": 'lexeme="ARMS_OPEN"',
}  # fmt: skip
"""Attributes without which an element says nothing."""
INSIDE: Mapping[str, tuple[str, str]] = {
    "lexeme": ('<face id="x">', "</face>"), "facs": ('<face id="x">', "</face>"),
    "stance": ('<posture id="x">', "</posture>"), "pose": ('<posture id="x">', "</posture>"),
}  # fmt: skip
"""Elements that stand in others."""
CONTENT: Mapping[str, str] = {
    "face": '<lexeme lexeme="SMILE"/>', "faceShift": '<lexeme lexeme="SMILE"/>', "speech": "<text>Hello.</text>",
    "posture": '<pose part="ARMS" lexeme="ARMS_OPEN"/>', "postureShift": '<pose part="ARMS" lexeme="ARMS_OPEN"/>',
}  # fmt: skip
"""Content without which an element says nothing."""
TOGETHER: Mapping[tuple[str, str], str] = {
    ("gaze", "offsetDirection"): 'offsetAngle="10"', ("gaze", "offsetAngle"): 'offsetDirection="UP"',
    ("gazeShift", "offsetDirection"): 'offsetAngle="10"', ("gazeShift", "offsetAngle"): 'offsetDirection="UP"',
    ("face", "eyebrow"): 'type="EYEBROWS"', ("face", "eyelid"): 'type="EYELIDS"', ("face", "mouth"): 'type="MOUTH"',
    ("face", "au"): 'type="FACS"', ("face", "side"): 'type="FACS" au="12"', ("face", "amount"): 'type="MOUTH"',
    ("face", "separation"): 'type="EYEBROWS"', ("face", "overshoot"): "",
}  # fmt: skip
"""What an attribute only makes sense with."""
_MEANS_LEXEME = ("lexeme", "type", "action", "rotation", "orientation")
Outcome = Literal["performed", "degraded", "dropped"]


class Told(NamedTuple):
    """What becomes of a term, with the warning."""

    outcome: Outcome
    warning: str = ""


def sample(term: Term) -> str:
    """Write a block with one behavior `x` that uses the term."""
    given = f'{term.attribute}="{term.value or SAMPLES.get(term.attribute, "1")}"' if term.attribute else ""
    beside = TOGETHER.get((term.element, term.attribute), "")
    if (term.element, term.attribute, term.value) == ("face", "type", "FACS"):
        beside = 'au="12"'
    if term.element == "gesture" and term.attribute in ("type", "target"):
        beside = _beside_type(term)
    if (term.element, term.attribute) == ("pose", "part"):
        beside = 'lexeme="ARMS_OPEN"' if "ARM" in term.value else 'lexeme="LEANING_FORWARD"'
        beside = 'lexeme="LEGS_CROSSED"' if "LEG" in term.value else beside
    if (term.element, term.attribute, term.value) == ("head", "action", "ROTATION"):
        beside = 'rotation="NOD"'
    if (term.element, term.attribute, term.value) == ("head", "action", "ORIENTATION"):
        beside = 'orientation="UP"'
    needed = NEEDED.get(term.element, "")
    is_said = needed.partition("=")[0] in f"{given} {beside}" or term.attribute in _MEANS_LEXEME or "type=" in beside
    attributes = " ".join(filter(None, ("" if is_said and needed else needed, beside, given)))
    is_whole = term.element in INSIDE
    id, content = ("" if is_whole else ' id="x"'), "" if "type=" in attributes else CONTENT.get(term.element, "")
    if term.element == "speech":
        content = CONTENT["speech"]
    if (term.element, term.attribute) == ("posture", "stance"):
        content = ""
    before, after = INSIDE.get(term.element, ("", ""))
    namespace = BML_1_0 if term.dialect == "bml-1.0" else DRAFT
    element = f"<{term.element}{id} {attributes}>{content}</{term.element}>"
    return f'<bml xmlns="{namespace}" id="b">{before}{element}{after}</bml>'


def _beside_type(term: Term) -> str:
    if term.value == "POINT" or term.attribute == "target":
        return 'type="POINT"' if term.attribute == "target" else 'target="cup"'
    return 'lexeme="WAVE"' if term.value == "LEXICALIZED" else ""


def told(term: Term) -> Told:
    """Plan the sample of a term on the simulated body."""
    block = decode_xml(sample(term))
    notes = [each.message for each in block.unread if each.kind == "DEGRADED"]
    others = [each.message for each in block.unread if each.kind != "DEGRADED"]
    if others or not block.behaviors:
        return Told("dropped", "; ".join(others))
    (behavior,) = block.behaviors
    if isinstance(behavior, Unknown):
        return Told("dropped", f"<{behavior.element}>")
    if isinstance(behavior, Speech | Wait | Emit):
        return Told("degraded" if notes else "performed", "; ".join(notes))
    try:
        made = plan(behavior, Situation(kinematics.HOME, kinematics.HOME, WORLD))
    except Impossible as impossible:
        return Told("dropped", impossible.reason)
    notes += [made.note] if made.note else []
    return Told("degraded" if notes else "performed", "; ".join(notes))


def _rows() -> Iterator[str]:
    groups: dict[tuple[str, str, str], list[tuple[Term, Told]]] = {}
    for term in terms():
        groups.setdefault((NAMES[term.dialect], term.element, term.attribute), []).append((term, told(term)))
    dialect = ""
    for (name, element, attribute), found in groups.items():
        if name != dialect:
            dialect = name
            yield f"\n## {name[0].upper()}{name[1:]}\n\n| element | attribute | performed | degraded | dropped |\n|---|---|---|---|---|"
        cells = [_cell(found, outcome) for outcome in ("performed", "degraded", "dropped")]
        yield f"| `{element}` | {f'`{attribute}`' if attribute else ''} | {' | '.join(cells)} |"


def _cell(found: list[tuple[Term, Told]], outcome: Outcome) -> str:
    """The values with an outcome; `yes` where an element or an attribute has no values."""
    words = []
    for term, became in found:
        if became.outcome == outcome:
            instead = became.warning.rpartition("; it ")[2] if "; it " in became.warning else ""
            words.append((term.value or "yes") + (f" ({instead})" if instead and outcome == "degraded" else ""))
    return ", ".join(words)


def page() -> str:
    return HEAD + "\n".join(_rows()) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE.name)
