"""Blocks and fragments that a manager might write. They are valid: the attack is what is done to them later."""

from collections.abc import Sequence
from itertools import pairwise

from engage_hri.schemas.behaviors import (
    After,
    BlockBehavior,
    Constraint,
    FaceLexeme,
    FragmentBehavior,
    Gaze,
    GazeShift,
    Gesture,
    Head,
    Mark,
    Pointing,
    Reference,
    Speech,
    Synchronize,
    Wait,
)
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.fragments import TurnFragment, TurnStatus
from tests.rigs.hostile.chance import Chance, happens

TEXT = "Please move the blue piece"


def block(chance: Chance, id: str, entities: Sequence[str]) -> Block:
    """Make a block of one to four behaviors. entities: ids of what the world holds."""
    behaviors = tuple(_behavior(chance, f"b{n}", entities) for n in range(1, chance.randrange(2, 6)))
    return Block(
        id=id,
        behaviors=behaviors,
        constraints=_constraints(chance, [behavior.id for behavior in behaviors]),
        composition=chance.choice(("MERGE", "MERGE", "MERGE", "APPEND", "REPLACE")),
    )


def fragment(chance: Chance, id: str, entities: Sequence[str]) -> TurnFragment:
    behaviors: list[FragmentBehavior] = [Speech(id="words", text=TEXT)]
    if happens(chance, 0.5):
        behaviors.append(Reference(id="it", target=chance.choice(entities)))
    status: TurnStatus = chance.choice(("full", "full", "beginning", "end", "backchannel"))
    return TurnFragment(id=id, turn_status=status, behaviors=tuple(behaviors))


def _behavior(chance: Chance, id: str, entities: Sequence[str]) -> BlockBehavior:
    target, is_required = chance.choice(entities), happens(chance, 0.2)
    match chance.randrange(0, 9):
        case 0 | 1:
            return Gaze(id=id, target=target, required=is_required)
        case 2:
            return GazeShift(id=id, target=target)
        case 3:
            return Pointing(id=id, target=target, required=is_required)
        case 4:
            return Gesture(id=id, lexeme="BEAT", required=is_required)
        case 5:
            return Head(id=id, lexeme="NOD")
        case 6:
            return FaceLexeme(id=id, lexeme="SMILE")
        case 7:
            return Wait(id=id, duration=chance.uniform(0.0, 2.0))
    return Speech(id=id, text=TEXT, marks=(Mark("m1", 7), Mark("m2", 12)))


def _constraints(chance: Chance, ids: Sequence[str]) -> tuple[Constraint, ...]:
    operators: list[Synchronize | After] = []
    for earlier, later in pairwise(ids):
        if happens(chance, 0.5):
            ref, syncs = f"{earlier}:{chance.choice(('start', 'end'))}", (f"{later}:start",)
            is_tied = happens(chance, 0.5)
            operators.append(Synchronize(ref=ref, syncs=syncs) if is_tied else After(ref=ref, syncs=syncs))
    return (Constraint(id="c1", operators=tuple(operators)),) if operators else ()
