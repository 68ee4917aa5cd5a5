"""The transcript of thesis Appendix B as a script. The robot's words are the source's; steps 7-17 are ours.

The id of a fragment, and of the block of its connection events, is its step; it ends in `ours` where the source has
no such step.
"""

from engage_hri.schemas.footprints import Side
from engage_hri.schemas.relations import Relation
from engage_hri.services.tangram.collaboration.plans import Manager, Turn
from engage_hri.services.tangram.collaboration.task import Instruction

AS_IN_STEP_19 = Relation("purple-triangle", "top right", "trapezoid")
"""Place where the human puts the piece, against step 18; the robot says "good" in step 20 all the same."""


def asks(step: str, piece: str, side: Side, landmark: str, deictic: str = "", *also: Relation) -> Turn:
    """A request for a placement. deictic: the word that may stand for the piece. also: other places that will do."""
    wanted = Relation(piece, side, landmark)
    return Turn(step=step, instruction=Instruction(wanted=wanted, deictic=deictic, also=also))


def turns(manager: Manager) -> tuple[Turn, ...]:
    """The robot's turns in order; the human's steps (1, 6, 19, 22, 26) lie between them."""
    return (
        Turn(step="step-2", say=("Hello, let's make a tangram.",)),
        Turn(step="step-3", say=manager.introduction(), look=False),
        Turn(step="step-4", say=("Okay, let's start.",)),
        asks("step-5", "blue-square", "top", "rectangle"),
        *OURS,
        asks("step-18", "purple-triangle", "top right", "pink-square", "that", AS_IN_STEP_19),
        Turn(step="step-20"),
        asks("step-21", "green-square", "left", "blue-square", "this"),
        Turn(step="step-23"),
        Turn(step="step-24", say=("Look, we made an anchor.",), look=False),
        Turn(step="step-25", say=("Thanks for playing. That was fun, goodbye.",), look=False),
    )


OURS = (
    Turn(step="step-7-ours"),
    asks("step-8-ours", "trapezoid", "top", "blue-square"),
    Turn(step="step-9-ours"),
    asks("step-10-ours", "yellow-triangle", "bottom", "rectangle"),
    Turn(step="step-11-ours"),
    asks("step-12-ours", "red-square", "bottom left", "yellow-triangle"),
    Turn(step="step-13-ours"),
    asks("step-14-ours", "pink-square", "bottom right", "yellow-triangle"),
    Turn(step="step-15-ours"),
    asks("step-16-ours", "pink-triangle", "top left", "red-square"),
    asks("step-17-ours", "purple-square", "right", "blue-square"),
)
