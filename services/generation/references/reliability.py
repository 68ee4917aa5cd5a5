"""Reliability of a reference, R(j, s) = 1 / (|D| + 1 / r), and of its channel, r of a gesture with a phrase."""

from engage_hri.schemas.fragments import GestureChoice
from engage_hri.schemas.units import Probability
from engage_hri.services.generation.config import GenerationConfig


def reliability(distractors: int, channel: Probability) -> Probability:
    """Likelihood that the reference is understood: 1 / (|D| + 1/r). Thesis 3.3.2.

    distractors: |D(j, s)|, objects besides the target still possible, >= 0.
    channel: r(j, s) in [0, 1); with 0 (neither gesture nor phrase) the reliability is 0, too (decision B2).
    Raises ValueError outside.
    """
    if distractors < 0:
        raise ValueError(f"{distractors} distractors")
    if not 0 <= channel < 1:
        raise ValueError(f"channel reliability {channel} is not in [0, 1)")
    return 1 / (distractors + 1 / channel) if channel else 0.0


def channel_reliability(gesture: GestureChoice, phrase: str, config: GenerationConfig) -> Probability:
    """Channel r(j, s) of a gesture with a phrase (empty: none), as configured. Thesis 3.3.2, decision B1."""
    r_gesture = {
        "none": 0.0,
        "gaze": config.gaze_reliability,
        "directed_gaze": config.directed_gaze_reliability,
        "directed_gaze_with_pointing": config.pointing_reliability,
    }[gesture]
    r_phrase = config.phrase_reliability if phrase else 0.0
    if config.channel == "sum":
        return r_gesture + r_phrase
    return 1 - (1 - r_gesture) * (1 - r_phrase)
