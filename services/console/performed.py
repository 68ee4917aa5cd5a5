"""Words for what the robot performs and no action tells of: gestures by name, faces, postures, turns of the head.

Looks, pointings, nods and speech are seen as actions (schemas/perception.py), whoever asks for them. Of the others
only those know the names who have the block.
"""

from collections.abc import Mapping
from typing import NamedTuple

from engage_hri.schemas.behavior_types import TYPES, dialect_sync, same_instant
from engage_hri.schemas.behaviors import (
    Behavior,
    Expression,
    Face,
    FaceFacs,
    FaceLexeme,
    FaceShift,
    Gaze,
    GazeShift,
    Gesture,
    Hand,
    Head,
    Locomotion,
    Pose,
    Posture,
    PostureShift,
    expressed,
    posed,
)
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import type_name
from engage_hri.schemas.vocabulary import normal

ACTIONS = ("NOD", "SHAKE")
"""Movements of the head of which actions tell."""

LACKS, NEAR = "this body has no", ", as near as it can"
"""Words of a warning of the body that performs something near, which it names itself, and those for the deed."""
HANDS: Mapping[Hand, str] = {
    "LEFT_HAND": " with the left hand", "RIGHT_HAND": " with the right hand", "BOTH_HANDS": " with both hands",
}  # fmt: skip


class Deed(NamedTuple):
    """Words for what the robot does in a behavior. sync: when it is seen, in the spelling of the block's dialect."""

    sync: str
    words: str

    def as_warned(self, warning: str) -> "Deed":
        """Tell that the body does only something near to it. warning: of kind DEGRADED, which says what it lacks."""
        return self._replace(words=f"{self.words}{NEAR}") if LACKS in warning else self


def deeds(thing: Block | TurnFragment) -> dict[tuple[str, str], Deed]:
    """List what is performed besides actions, by block and behavior. The block of a fragment has its id."""
    dialect = thing.dialect if isinstance(thing, Block) else "draft"
    found = {}
    for behavior in thing.behaviors:
        if words := _words(behavior):
            type = type_name(behavior)
            row = TYPES[type]
            seen = "stroke_start" if row.has_stroke else "stroke" if "stroke" in row.points else row.points[-1]
            sync = dialect_sync(same_instant(seen, type), type, dialect)
            found[thing.id, behavior.id] = Deed(sync or seen, words)
    return found


def _words(behavior: Behavior) -> str:
    """Say what the robot does; empty: actions tell of it, or there is nothing to see."""
    match behavior:
        case Gesture(lexeme=lexeme, mode=mode):
            return f"makes the gesture {lexeme}{HANDS[mode] if mode else ''}"
        case Head(lexeme=lexeme) if normal(lexeme) not in ACTIONS:
            return f"moves the head: {lexeme}"
        case Face() | FaceLexeme() | FaceFacs() | FaceShift():
            shown = " and ".join(filter(None, map(_expression, expressed(behavior))))
            return f"shows the face {shown}" if shown else ""
        case Posture() | PostureShift():
            poses = [" ".join(filter(None, (each.lexeme, each.part))) for each in posed(behavior)]
            taken = " and ".join(filter(None, (behavior.stance, *poses)))
            return f"takes the posture {taken}" if taken else ""
        case Pose(lexeme=lexeme, part=part):
            return f"takes the pose {' '.join(filter(None, (lexeme, part)))}"
        case Gaze() | GazeShift() if behavior.offset_angle:
            direction = f" {behavior.offset_direction}" if behavior.offset_direction else ""
            return f"looks {behavior.offset_angle:g}°{direction} of {behavior.target}"
        case Locomotion(target=target):
            return f"moves to {target}"
    return ""


def _expression(shown: Expression) -> str:
    name = shown.lexeme or (f"AU {shown.au}" if shown.au else "")
    return f"{name} {shown.side.lower()}" if name and shown.side != "BOTH" else name
