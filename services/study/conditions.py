"""The conditions of the study, each as settings of the configuration. Thesis, chapter 5.

The policies know nothing of a study: a condition is a configuration that any robot could be given.
"""

from collections.abc import Mapping
from typing import Literal, get_args

Condition = Literal["operational", "degraded-generation", "degraded-recognition"]
CONDITIONS: tuple[Condition, ...] = get_args(Condition)
BASELINE: Condition = "operational"
"""What the others are compared with."""

WORSE: Mapping[str, tuple[str, ...]] = {
    "operational": (),
    "degraded-generation": (),
    "degraded-recognition": (
        # "Connection events are not recognised well": filled from the faults of the simulated perception.
    ),
}
"""What else makes a condition worse, besides what `generation.condition` does. Weaker than the user's settings."""
