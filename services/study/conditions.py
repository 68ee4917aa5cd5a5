"""The conditions of the study, each as settings of the configuration. Thesis, chapter 5.

The policies know nothing of a study: a condition is a configuration that any robot could be given.
"""

from collections.abc import Mapping
from typing import Literal, get_args

Condition = Literal["operational", "degraded-generation", "degraded-recognition"]
CONDITIONS: tuple[Condition, ...] = get_args(Condition)
BASELINE: Condition = "operational"
DEGRADED = tuple(condition for condition in CONDITIONS if condition != BASELINE)
"""What is compared with it."""

WORSE: Mapping[str, tuple[str, ...]] = {
    "operational": (),
    "degraded-generation": (),
    "degraded-recognition": (
        "simulation.faults.missed_look=0.5",
        "simulation.faults.wrong_look=0.3",
        "simulation.faults.dropped_speech=0.5",
    ),
}
"""What makes a condition worse, besides what `generation.condition` does; weaker than the user's own settings.

Degraded recognition: the thesis names the condition and leaves it to another. Ours is poor perception. Of half the
person's looks nothing is noticed, of the others three in ten are taken for a look at something near, half of what
they say is not heard. The robot's own behavior is the full one, but it rests on that.
"""
