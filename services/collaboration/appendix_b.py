"""The transcript of thesis Appendix B as a script. The robot's words are the source's; steps 7-17 are ours."""

from services.collaboration.plans import Manager, Turn
from services.collaboration.relations import Relation
from services.collaboration.task import Instruction


def turns(manager: Manager) -> tuple[Turn, ...]:
    """The robot's turns in order; the human's steps (1, 6, 19, 22, 26) lie between them."""
    return (
        Turn(step="step-2", say=("Hello, let's make a tangram.",)),
        Turn(step="step-3", say=manager.introduction(), look=False),
        Turn(step="step-4", say=("Okay, let's start.",)),
        Turn(step="step-5", instruction=Instruction(wanted=Relation("blue-square", "top", "rectangle"))),
        *OURS,
        # The human of step 19 puts it at the top right of the trapezoid, and the robot of step 20 says "good".
        Turn(
            step="step-18",
            instruction=Instruction(
                wanted=Relation("purple-triangle", "top right", "pink-square"),
                deictic="that",
                also=(Relation("purple-triangle", "top right", "trapezoid"),),
            ),
        ),
        Turn(step="step-20"),
        Turn(
            step="step-21",
            instruction=Instruction(wanted=Relation("green-square", "left", "blue-square"), deictic="this"),
        ),
        Turn(step="step-23"),
        Turn(step="step-24", say=("Look, we made an anchor.",), look=False),
        Turn(step="step-25", say=("Thanks for playing. That was fun, goodbye.",), look=False),
    )


OURS = (
    Turn(step="step-7"),
    Turn(step="step-8", instruction=Instruction(wanted=Relation("trapezoid", "top", "blue-square"))),
    Turn(step="step-9"),
    Turn(step="step-10", instruction=Instruction(wanted=Relation("yellow-triangle", "bottom", "rectangle"))),
    Turn(step="step-11"),
    Turn(step="step-12", instruction=Instruction(wanted=Relation("red-square", "bottom left", "yellow-triangle"))),
    Turn(step="step-13"),
    Turn(step="step-14", instruction=Instruction(wanted=Relation("pink-square", "bottom right", "yellow-triangle"))),
    Turn(step="step-15"),
    Turn(step="step-16", instruction=Instruction(wanted=Relation("pink-triangle", "top left", "red-square"))),
    Turn(step="step-17", instruction=Instruction(wanted=Relation("purple-square", "right", "blue-square"))),
)
