"""Every parameter of engagement generation: unit, default, source. Refused at start when it contradicts itself."""

from math import pi
from typing import Literal

from msgspec import Struct

from engage_hri.schemas.units import (
    Meters,
    Probability,
    Radians,
    Seconds,
    inner_shares,
    not_negative,
    positive,
)

Channel = Literal["sum", "independent"]
Profile = Literal["check-back", "figure-3.3"]
Condition = Literal["operational", "degraded-generation", "degraded-recognition"]
PhraseAttribute = Literal["size", "shape", "color", "feature"]


class GenerationConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Parameters of generation. Raises ValueError when one is out of range (for reliabilities see decision B1)."""

    condition: Condition = "operational"
    """Condition of the study, thesis chapter 5. degraded-generation: the task's own speech, the head to the upper
    right. degraded-recognition: nothing changes here; the other service is to be configured worse."""
    profile: Profile = "check-back"
    """Timing of a chosen gesture and phrase: as in Appendix B (`check-back`), or as in Fig. 3.3."""

    # Channel reliabilities, thesis 3.3.2. Defaults: those that give the gestures of Appendix B.
    channel: Channel = "sum"
    """Sum of gesture and phrase: r(j) + r(s) < 1 (thesis 3.3.2), or 1 - (1 - r(j))(1 - r(s)) (decision B1)."""
    phrase_reliability: Probability = 0.70
    """Reliability rs of a spoken phrase, in (0, 1). This and the next three give the gestures of Appendix B."""
    gaze_reliability: Probability = 0.10
    """Reliability rG of a look, in (0, rDG)."""
    directed_gaze_reliability: Probability = 0.20
    """Reliability rDG of a look that waits for the other's, in (rG, rDGP)."""
    pointing_reliability: Probability = 0.28
    """Reliability rDGP of a directed gaze with pointing, in (rDG, 1)."""
    minimum_reliability: Probability = 0.85
    """Least reliability Rmin, in (0, 1), for references that come without one, as a language model's do. That of
    landmarks in Appendix B."""

    # Cost, thesis 3.3.2, in seconds (decision B6).
    seconds_per_head_degree: float = 1 / 100
    """Cost kg of turning the head, in s/degree: 1 / head speed. Cost is in seconds: decision B6."""
    seconds_per_arm_degree: float = 1 / 60
    """Cost kp of moving an arm, in s/degree: 1 / arm speed. Decision B6."""
    seconds_per_word: float = 0.35
    """Cost ks of speaking, in s per unit of a phrase's cost, which is about one word. Decision B6."""
    wait_weight: float = 1.0
    """Cost kw of a second of waiting for shared gaze, in s/s. Decision B7."""

    gaze_half_angle: Radians | None = None
    """Half the angle of the robot's gaze cone as people perceive it, < pi/2. None: the body's own. Thesis 3.3.2."""
    pointing_radius: Meters | None = None
    """Radius of the cylinder around a pointing forearm. None: the body's own. Thesis 3.3.2."""

    barge_in: Seconds | None = None
    """Seconds of voice after which who speaks into the robot's turn takes the floor, though recognition has not yet
    decided what it is. None: the robot waits for that in silence."""
    policies_off: tuple[str, ...] = ()
    """Names of policies that the robot does not follow. Of the head: "glance", "aversion" (it looks away from faces),
    "response", "mutual" (it keeps eyes that it has met), "listening" (it looks at who speaks), "hands", "face",
    "continuers" (it says "mm-hmm" to who speaks for long), "nods", "trunk" (it turns its trunk towards whom it speaks
    with). Of turns: "leaving" (a turn ends when its
    addressees have gone), "silence" (when its client sends no more), "interruption", "next-speaker" (to whom of
    several it gives the turn). Or one of an installed package."""
    continuers: tuple[str, ...] = ("mm-hmm", "uh-huh")
    """Words that the robot says, in turn, to who speaks to it for long. Policy "continuers"; other languages have
    other ones."""
    decision_patience: Seconds = 8.0
    """Seconds after a block's end for which undecided connection events may delay the fragment's outcome. Ours."""
    glance_factor: float = 1.0
    """Factor k: a glance is due after k times the mean time between connection events. Thesis 3.3.4 has 1."""

    def __post_init__(self) -> None:
        gaze, directed, pointing = (
            self.gaze_reliability, self.directed_gaze_reliability, self.pointing_reliability,
        )  # fmt: skip
        if not 0 < gaze < directed < pointing < 1:
            raise ValueError(
                f"0 < gaze_reliability < directed_gaze_reliability < pointing_reliability < 1 does not hold: "
                f"{gaze}, {directed}, {pointing}"
            )
        inner_shares(self, ("phrase_reliability", "minimum_reliability"))
        if self.channel == "sum" and pointing + self.phrase_reliability >= 1:
            raise ValueError(
                f"pointing_reliability {pointing} + phrase_reliability {self.phrase_reliability} reaches 1: "
                'a channel cannot be certain; lower one or set channel = "independent"'
            )
        positive(self, (*(("barge_in",) if self.barge_in is not None else ()), "decision_patience", "glance_factor"))
        not_negative(self, ("seconds_per_head_degree", "seconds_per_arm_degree", "seconds_per_word", "wait_weight"))
        if self.gaze_half_angle is not None and not 0 < self.gaze_half_angle < pi / 2:
            raise ValueError(f"gaze_half_angle must be between 0 and pi/2 radians, not {self.gaze_half_angle}")
        if self.pointing_radius is not None:
            positive(self, ("pointing_radius",))

    @property
    def speech_only(self) -> bool:
        """True if the robot is to say the task's words and to do nothing else."""
        return self.condition == "degraded-generation"
