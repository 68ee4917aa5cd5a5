"""Inventory of what BML 1.0 and the draft of 2007 define: elements, their attributes, and the values of these.

What a body does with each is its own affair (docs/vocabulary.md for the simulated one); but nothing that stands
here is unknown. Sources: BML 1.0, chapters 3 to 10; the tables of working groups 1, 3 and 4 of the draft (locomotion;
gesture; head, face and gaze), and what the reference implementation of the thesis reads of it. Action units are those
of FACS, to which both refer.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache

from msgspec import Struct

from engage_hri.schemas.blocks import Dialect

Values = tuple[str, ...]
Attributes = Mapping[str, Values]
"""Values by attribute; none: any text or number."""
FREE: Values = ()

_MODES = ("LEFT_HAND", "RIGHT_HAND", "BOTH_HANDS")
_SIDES = ("LEFT", "RIGHT", "BOTH")
_DIRECTIONS = ("RIGHT", "LEFT", "UP", "DOWN", "UPRIGHT", "UPLEFT", "DOWNLEFT", "DOWNRIGHT", "POLAR")
_ORIENTATIONS = (
    "FRONT", "RIGHT", "LEFT", "UP", "DOWN", "UP_RIGHT", "UP_LEFT", "DOWN_RIGHT", "DOWN_LEFT", "POLAR_ANGLE",
)  # fmt: skip
_UNITS = tuple(map(str, (1, 2, 4, 5, 6, 7, *range(9, 19), 20, *range(22, 29), *range(41, 47))))
_FACES = (
    "OBLIQUE_BROWS", "RAISE_BROWS", "RAISE_LEFT_BROW", "RAISE_RIGHT_BROW", "LOWER_BROWS", "LOWER_LEFT_BROW",
    "LOWER_RIGHT_BROW", "LOWER_MOUTH_CORNERS", "LOWER_LEFT_MOUTH_CORNER", "LOWER_RIGHT_MOUTH_CORNER",
    "RAISE_MOUTH_CORNERS", "RAISE_RIGHT_MOUTH_CORNER", "RAISE_LEFT_MOUTH_CORNER", "OPEN_MOUTH", "OPEN_LIPS",
    "WIDEN_EYES", "CLOSE_EYES",
)  # fmt: skip
_GAZE: Attributes = {
    "target": FREE, "influence": ("EYES", "HEAD", "SHOULDER", "WAIST", "WHOLE"), "offsetAngle": FREE,
    "offsetDirection": _DIRECTIONS,
}  # fmt: skip
_FACE: Attributes = {"amount": FREE, "overshoot": FREE}
_FACS: Attributes = {"au": _UNITS, "side": _SIDES, "amount": FREE}

BML_1_0: Mapping[str, Attributes] = {
    "gaze": _GAZE,
    "gazeShift": _GAZE,
    "gesture": {"lexeme": ("BEAT",), "mode": _MODES},
    "pointing": {"target": FREE, "mode": _MODES},
    "head": {"lexeme": ("NOD", "SHAKE"), "repetition": FREE, "amount": FREE},
    "headDirectionShift": {"target": FREE},
    "faceLexeme": {"lexeme": _FACES, "amount": FREE},
    "faceFacs": _FACS,
    "face": _FACE,
    "faceShift": _FACE,
    "lexeme": {"lexeme": FREE, "amount": FREE},
    "facs": {"au": FREE, "side": FREE, "amount": FREE},
    "posture": {},
    "postureShift": {},
    "stance": {"type": ("SITTING", "CROUCHING", "STANDING", "LYING")},
    "pose": {
        "part": ("ARMS", "LEFT_ARM", "RIGHT_ARM", "LEGS", "LEFT_LEG", "RIGHT_LEG", "HEAD", "WHOLEBODY"),
        "lexeme": ("ARMS_AKIMBO", "ARMS_CROSSED", "ARMS_NEUTRAL", "ARMS_OPEN", "LEGS_CROSSED", "LEGS_NEUTRAL",
                   "LEGS_OPEN", "LEANING_FORWARD", "LEANING_BACKWARD"),
    },
    "locomotion": {"target": FREE, "manner": ("WALK", "RUN", "STRAFE")},
    "speech": {},
}  # fmt: skip
"""Elements of BML 1.0 with their attributes, without ids and sync points. Those inside others stand by themselves."""
DRAFT: Mapping[str, Attributes] = {
    "gaze": {"target": FREE, "offsetAngle": FREE, "offsetDirection": _DIRECTIONS},
    "gesture": {
        "type": ("POINT", "BEAT", "CONDUIT", "GENERIC", "LEXICALIZED", "DEPICT", "METAPHORIC", "EMBLEM"),
        "hand": _SIDES, "target": FREE, "lexeme": FREE, "repetition": FREE, "handshape": FREE,
        "fingerDirection": FREE, "palmDirection": FREE, "trajectory": FREE, "twoHanded": FREE,
        "verticalLocation": FREE, "horizontalLocation": FREE, "distance": FREE, "moveDirection": FREE,
        "amplitude": FREE, "power": FREE,
    },
    "head": {
        "action": ("ROTATION", "ORIENTATION"), "rotation": ("X", "NOD", "Y", "SHAKE", "Z", "TILT"),
        "orientation": _ORIENTATIONS, "offset": FREE, "repeats": FREE, "amount": FREE,
    },
    "face": {
        "type": ("EYEBROWS", "EYELIDS", "MOUTH", "FACS"), "eyebrow": ("FLAT", "POINT_DOWN", "POINT_UP"),
        "eyelid": ("BOTH", "UPPER", "LOWER"), "mouth": ("FLAT", "SMILE", "LAUGH", "PUCKER", "FROWN"),
        "separation": FREE, **_FACS,
    },
    "posture": {"stance": ("SIT", "STAND")},
    "locomotion": {
        "type": ("TARGET", "VECTOR"), "target": FREE, "proximity": FREE, "facing": FREE, "manner": ("WALK", "RUN"),
        "dynamic": FREE, "velocity": FREE,
    },
    "lips": {"viseme": FREE, "articulation": FREE, "flapping": FREE},
    "torso": {}, "body": {}, "legs": {},
    "speech": {},
    "emit": {"event": FREE},
    "wait": {"duration": FREE},
}  # fmt: skip
"""Elements of the draft, likewise."""
DEFINED: Mapping[Dialect, Mapping[str, Attributes]] = {"bml-1.0": BML_1_0, "draft": DRAFT}
NAMES: Mapping[Dialect, str] = {"bml-1.0": "BML 1.0", "draft": "the draft of 2007"}


class Term(Struct, frozen=True):
    """Something that a dialect defines: an element, an attribute of it, or a value of that attribute."""

    dialect: Dialect
    element: str
    attribute: str = ""
    value: str = ""

    def __str__(self) -> str:
        given = f'="{self.value}"' if self.value else ""
        return f"{self.element}{f' {self.attribute}{given}' if self.attribute else ''} ({self.dialect})"


def terms() -> Iterator[Term]:
    """List everything that the dialects define."""
    for dialect, elements in DEFINED.items():
        for element, attributes in elements.items():
            yield Term(dialect, element)
            for attribute, values in attributes.items():
                if not values:
                    yield Term(dialect, element, attribute)
                yield from (Term(dialect, element, attribute, value) for value in values)


def normal(lexeme: str) -> str:
    """Spell a lexeme in one way: `tilt-right` -> `TILT_RIGHT`."""
    return "_".join(lexeme.strip().upper().replace("-", " ").replace("_", " ").replace("+", " ").split())


def definition(element: str, attribute: str = "") -> str:
    """Name of the dialect that defines an element, or an attribute of it; empty: none does."""
    for dialect, elements in DEFINED.items():
        if element in elements and (not attribute or attribute in elements[element]):
            return NAMES[dialect]
    return ""


def unperformed(element: str) -> str:
    """Reason why a behavior that no struct of ours has is dropped: nobody knows it, or no body performs it."""
    dialect = definition(element)
    return f"<{element}>, which {dialect} has, is performed by no body" if dialect else f"unknown element <{element}>"


def ignored(element: str, attributes: Sequence[str]) -> str:
    """Reason why attributes of an element, which a dialect defines, are left out."""
    dialect = definition(element, attributes[0])
    if len(attributes) == 1:
        return f"attribute {attributes[0]!r} of <{element}>, which {dialect} has, is performed by no body"
    names = f"{', '.join(map(repr, attributes[:-1]))} and {attributes[-1]!r}"
    return f"attributes {names} of <{element}>: {dialect} has this, but no body performs it"


def is_defined(table: str, lexeme: str) -> bool:
    """Tell whether a dialect defines a lexeme. table: of a repertoire: gesture, head, face, facs, pose or stance."""
    return normal(lexeme) in _lexemes().get(table, frozenset())


@cache
def _lexemes() -> Mapping[str, frozenset[str]]:
    face, gesture, head = DRAFT["face"], DRAFT["gesture"], DRAFT["head"]
    return {
        "gesture": frozenset({*BML_1_0["gesture"]["lexeme"], *gesture["type"]} - {"POINT", "LEXICALIZED"}),
        "head": frozenset({*BML_1_0["head"]["lexeme"], *head["rotation"], *head["orientation"]} - {*"XYZ"}),
        "face": frozenset({*_FACES, *face["type"], *(shape for each in SHAPES for shape in shapes(each))} - {"FACS"}),
        "facs": frozenset(_UNITS),
        "pose": frozenset(BML_1_0["pose"]["lexeme"]),
        "stance": frozenset({*BML_1_0["stance"]["type"], *DRAFT["posture"]["stance"]}),
    }


SHAPES: Mapping[str, str] = {"eyebrow": "EYEBROWS", "eyelid": "EYELIDS", "mouth": "MOUTH"}
"""Attributes of a draft's face with a shape, and the word that its lexeme begins with: `EYEBROWS_POINT_UP`."""


def shapes(attribute: str) -> tuple[str, ...]:
    """List the lexemes of a draft's attribute of shapes."""
    return tuple(f"{SHAPES[attribute]}_{shape}" for shape in DRAFT["face"][attribute])
