"""Conditions of the study, each as settings of the configuration. Thesis, chapter 5.

The policies know nothing of a study: a condition is a configuration that any robot could be given.
"""

from collections.abc import Mapping
from typing import Literal, get_args

Condition = Literal["operational", "degraded-generation", "degraded-recognition"]
CONDITIONS: tuple[Condition, ...] = get_args(Condition)
BASELINE: Condition = "operational"
DEGRADED = tuple(condition for condition in CONDITIONS if condition != BASELINE)
"""Conditions that are compared with the baseline."""

DEGRADATIONS: Mapping[str, tuple[str, ...]] = {
    "operational": (),
    "degraded-generation": (),
    "degraded-recognition": (
        "simulation.faults.missed_look=0.5",
        "simulation.faults.wrong_look=0.3",
        "simulation.faults.dropped_speech=0.5",
    ),
}
"""Settings that make a condition worse, besides `generation.condition`; weaker than the user's own settings.

Degraded recognition is only named in the thesis. Here it is poor perception: half of the person's looks are not
noticed, three in ten of the others are taken for a look at something near, and half of the person's utterances are
not heard. The robot's own behavior is complete, but rests on this perception.
"""
