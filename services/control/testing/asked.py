"""Behaviors that the suite asks a body for, and the world in which their targets are. Pure."""

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.behaviors import (
    BlockBehavior,
    Expression,
    Face,
    FaceFacs,
    FaceLexeme,
    FaceShift,
    Gaze,
    GazeShift,
    Gesture,
    Head,
    HeadDirectionShift,
    Mark,
    Pointing,
    Pose,
    Posture,
    PostureShift,
    Speech,
    Wait,
)
from engage_hri.schemas.world import Entity, World

LOOKS = Gaze | GazeShift | HeadDirectionShift
AIMED = LOOKS | Pointing
WORLD = World(
    entities=(
        Entity(id="human", kind="person", position=(1.3, 0.0, 1.2)),
        Entity(id="near-right", kind="object", position=(0.45, -0.25, 0.73), radius=0.03),
        Entity(id="far-left", kind="object", position=(0.70, 0.30, 0.73), radius=0.03),
    )
)
BEHAVIORS: tuple[BlockBehavior, ...] = (
    Gaze(id="gaze", target="near-right"),
    GazeShift(id="gazeShift", target="far-left"),
    HeadDirectionShift(id="headDirectionShift", target="near-right"),
    Pointing(id="pointing", target="far-left"),
    Gesture(id="gesture", lexeme="BEAT"),
    Head(id="head", lexeme="NOD"),
    Head(id="nods", lexeme="NOD", repetition=3),
    Face(id="face", expressions=(Expression(lexeme="SMILE"), Expression(lexeme="RAISE_BROWS"))),
    FaceLexeme(id="faceLexeme", lexeme="SMILE"),
    FaceFacs(id="faceFacs", au=12),
    FaceShift(id="faceShift", lexeme="SMILE"),
    Posture(id="posture", lexeme="LEAN_FORWARD"),
    PostureShift(id="postureShift", lexeme="TURN_LEFT"),
    Pose(id="pose", lexeme="LEANING_BACKWARD"),
    Speech(id="speech", text="This piece, please.", marks=(Mark("m", 5),)),
    Wait(id="wait", duration=0.5),
)


def behaviors_in(world: World) -> tuple[BlockBehavior, ...]:
    """Direct the behaviors of the suite to what there is in another world: to its first and to its last object.

    world: at least one entity.
    """
    ids = [entity.id for entity in (*world.objects, *world.people, *world.entities)]
    last = ids[max(1, len(world.objects) - 1) % len(ids)]
    places = {"near-right": ids[0], "far-left": last}
    return tuple(replace(each, target=places[each.target]) if isinstance(each, AIMED) else each for each in BEHAVIORS)


HOLDS = {name: row.holds for name, row in TYPES.items() if row.holds}
"""Where each type can wait, as the realizer knows it."""
ONE_INSTANT = {name: row.one_instant for name, row in TYPES.items() if row.one_instant}
"""Points of a type that always coincide, as the realizer knows it."""
