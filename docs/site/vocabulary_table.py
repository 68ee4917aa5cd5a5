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
from engage_hri.schemas.vocabulary import NAMES, Term, terms
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.choreography import plan
from engage_hri.services.control.figure.course import Situation

PAGE = Path(__file__).resolve().parents[2] / "docs" / "vocabulary.md"
HEAD = """\
# What the simulated body does with BML

Everything that BML 1.0 and the draft of 2007 define, as `schemas/vocabulary.py` lists it: elements, attributes, and
the values of attributes. What is performed needs no warning. What is degraded is performed with one warning
(`DEGRADED`) that names what was asked and what is done instead; an attribute that is ignored costs only itself. What
is dropped costs the behavior, with one warning. This page is made from the code: `make generate`.

The tables hold the words of the standards only. The simulated body has a few lexemes more, which
`services/control/figure/repertoire.toml` lists; where a lexeme is not known, the warning names those that there are.
For lexemes of your own write a repertoire file and name it with `control.repertoire`: it may add words, or replace
what is performed for a word of these tables ([control.md](control.md#repertoire) has an example). `engage plan` and
`engage play` take it with `--set control.repertoire=FILE`. A lexeme of yours is performed without a warning.
"""
COLUMNS = "| element | attribute | performed | degraded | dropped |\n|---|---|---|---|---|"
WORLD = World(
    entities=(
        Entity(id="human", kind="person", position=(1.3, 0.0, 1.2)),
        Entity(id="cup", kind="object", position=(0.45, -0.25, 0.73), radius=0.03),
    )
)
VALUES: Mapping[str, str] = {
    "target": "cup", "offsetAngle": "10", "amount": "0.6", "overshoot": "0.2", "repetition": "2", "repeats": "2",
    "duration": "0.5", "event": "e", "dynamic": "true", "facing": "LEFT", "lexeme": "BEAT", "viseme": "A",
    "flapping": "true", "au": "12", "side": "LEFT",
}  # fmt: skip
"""Values of attributes that may have any; others get the number 1."""
NEEDED: Mapping[str, Mapping[str, str]] = {
    "gaze": {"target": "cup"}, "gazeShift": {"target": "cup"}, "gesture": {"lexeme": "BEAT"},
    "pointing": {"target": "cup"}, "head": {"lexeme": "NOD"}, "headDirectionShift": {"target": "cup"},
    "faceLexeme": {"lexeme": "SMILE"}, "faceFacs": {"au": "12"}, "locomotion": {"target": "cup"},
    "emit": {"event": "e"}, "wait": {"duration": "0.5"}, "lexeme": {"lexeme": "SMILE"}, "facs": {"au": "12"},
    "stance": {"type": "STANDING"}, "pose": {"lexeme": "ARMS_OPEN"},
}  # fmt: skip
"""Attributes without which an element says nothing."""
CONTENT: Mapping[str, str] = {
    "face": '<lexeme lexeme="SMILE"/>', "faceShift": '<lexeme lexeme="SMILE"/>', "speech": "<text>Hello.</text>",
    "posture": '<pose part="ARMS" lexeme="ARMS_OPEN"/>', "postureShift": '<pose part="ARMS" lexeme="ARMS_OPEN"/>',
}  # fmt: skip
"""Elements without which an element says nothing."""
INSIDE: Mapping[str, str] = {"lexeme": "face", "facs": "face", "stance": "posture", "pose": "posture"}
"""Elements that stand in others."""
WRITTEN: Mapping[tuple[str, str], str] = {
    ("lexeme", "lexeme"): '<lexeme lexeme="SMILE"/>',
    ("gaze", "offsetAngle"): '<gaze id="x" target="cup" offsetAngle="{}" offsetDirection="UP"/>',
    ("gaze", "offsetDirection"): '<gaze id="x" target="cup" offsetAngle="10" offsetDirection="{}"/>',
    ("gazeShift", "offsetAngle"): '<gazeShift id="x" target="cup" offsetAngle="{}" offsetDirection="UP"/>',
    ("gazeShift", "offsetDirection"): '<gazeShift id="x" target="cup" offsetAngle="10" offsetDirection="{}"/>',
    ("gesture", "type"): '<gesture id="x" type="{}"/>',
    ("gesture", "type=POINT"): '<gesture id="x" type="{}" target="cup"/>',
    ("gesture", "type=LEXICALIZED"): '<gesture id="x" type="{}" lexeme="WAVE"/>',
    ("gesture", "target"): '<gesture id="x" type="POINT" target="{}"/>',
    ("head", "action=ROTATION"): '<head id="x" action="{}" rotation="NOD"/>',
    ("head", "action=ORIENTATION"): '<head id="x" action="{}" orientation="UP"/>',
    ("head", "rotation"): '<head id="x" action="ROTATION" rotation="{}"/>',
    ("head", "orientation"): '<head id="x" action="ORIENTATION" orientation="{}"/>',
    ("face", "type"): '<face id="x" type="{}"/>',
    ("face", "type=FACS"): '<face id="x" type="{}" au="12"/>',
    ("face", "eyebrow"): '<face id="x" type="EYEBROWS" eyebrow="{}"/>',
    ("face", "eyelid"): '<face id="x" type="EYELIDS" eyelid="{}"/>',
    ("face", "mouth"): '<face id="x" type="MOUTH" mouth="{}"/>',
    ("face", "separation"): '<face id="x" type="EYEBROWS" separation="{}"/>',
    ("face", "au"): '<face id="x" type="FACS" au="{}"/>',
    ("face", "side"): '<face id="x" type="FACS" au="12" side="{}"/>',
    ("posture", "stance"): '<posture id="x" stance="{}"/>',
    ("pose", "part=LEGS"): '<pose part="{}" lexeme="LEGS_CROSSED"/>',
    ("pose", "part=LEFT_LEG"): '<pose part="{}" lexeme="LEGS_CROSSED"/>',
    ("pose", "part=RIGHT_LEG"): '<pose part="{}" lexeme="LEGS_CROSSED"/>',
    ("pose", "part=HEAD"): '<pose part="{}" lexeme="LEANING_FORWARD"/>',
    ("pose", "part=WHOLEBODY"): '<pose part="{}" lexeme="LEANING_FORWARD"/>',
}
"""Elements that need something else beside an attribute, or beside one value of it."""
Outcome = Literal["performed", "degraded", "dropped"]


class Told(NamedTuple):
    """What becomes of a term, with the warning."""

    outcome: Outcome
    warning: str = ""


def sample(term: Term) -> str:
    """Write a block with one behavior `x` that uses the term."""
    element, attribute = term.element, term.attribute
    value = term.value or VALUES.get(attribute, "1")
    written = WRITTEN.get((element, f"{attribute}={value}")) or WRITTEN.get((element, attribute))
    if written is None:
        given = {**NEEDED.get(element, {}), **({attribute: value} if attribute else {})}
        id = "" if element in INSIDE else ' id="x"'
        attributes = "".join(f' {name}="{said}"' for name, said in given.items())
        written = f"<{element}{id}{attributes}>{CONTENT.get(element, '')}</{element}>"
    xml = written.format(value)
    if around := INSIDE.get(element):
        xml = f'<{around} id="x">{xml}</{around}>'
    return f'<bml xmlns="{BML_1_0 if term.dialect == "bml-1.0" else DRAFT}" id="b">{xml}</bml>'


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
            yield f"\n## {name[0].upper()}{name[1:]}\n\n{COLUMNS}"
        cells = [_cell(found, outcome) for outcome in ("performed", "degraded", "dropped")]
        yield f"| `{element}` | {f'`{attribute}`' if attribute else ''} | {' | '.join(cells)} |"


def _cell(found: list[tuple[Term, Told]], outcome: Outcome) -> str:
    """List the values with an outcome; `yes` where an element or an attribute has no values."""
    words = []
    for term, became in found:
        if became.outcome == outcome:
            _, _, instead = became.warning.rpartition("; it ") if outcome == "degraded" else ("", "", "")
            instead = instead.removeprefix("is ").removesuffix(", the nearest")
            instead = instead.replace(repr(VALUES["target"]), "the target").replace("'", "")
            words.append((term.value or "yes") + (f" ({instead})" if instead else ""))
    return ", ".join(words)


def page() -> str:
    return HEAD + "\n".join(_rows()) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE.name)
