"""Every parameter of engagement generation: unit, default, source. Refused at start when it contradicts itself."""

from math import isfinite
from typing import Literal

from msgspec import Struct

from schemas.units import Degrees, Meters, Probability, Radians, Seconds

Channel = Literal["sum", "independent"]
Profile = Literal["check-back", "figure-3.3"]
Condition = Literal["operational", "degraded-generation", "degraded-recognition"]
PhraseAttribute = Literal["size", "shape", "color", "feature"]


class GenerationConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Raises ValueError when a value is outside its range or the reliabilities leave (0, 1) (decision B1)."""

    condition: Condition = "operational"
    """Of the study, thesis chapter 5. degraded-generation: the task's own speech, the head to the upper right."""
    profile: Profile = "check-back"
    """How a chosen gesture and phrase are synchronized: as in Appendix B, or as in Fig. 3.3."""

    # Channel reliabilities, thesis 3.3.2. Defaults: those that give the gestures of Appendix B.
    channel: Channel = "sum"
    """How gesture and phrase add up: r(j) + r(s) (the thesis), or 1 - (1 - r(j))(1 - r(s))."""
    phrase_reliability: Probability = 0.70
    """rs: of a spoken phrase."""
    gaze_reliability: Probability = 0.10
    """rG: of a look."""
    directed_gaze_reliability: Probability = 0.20
    """rDG: of a look that waits for the other's."""
    pointing_reliability: Probability = 0.28
    """rDGP: of a directed gaze with pointing."""

    # Cost, thesis 3.3.2, in seconds (decision B6).
    seconds_per_head_degree: float = 1 / 100
    """kg, s/degree: 1 / head speed."""
    seconds_per_arm_degree: float = 1 / 60
    """kp, s/degree: 1 / arm speed."""
    seconds_per_word: float = 0.35
    """ks, s per unit of a phrase's cost: about one word."""
    wait_weight: float = 1.0
    """kw: what a second of waiting for shared gaze costs, in seconds (decision B7)."""
    expected_delay: Seconds = 0.3
    """E[delay] of directed gaze: the mean of Table 2.1."""

    gaze_half_angle: Radians | None = None
    """Of the robot's gaze cone as people perceive it. None: what the body says of itself."""
    pointing_radius: Meters | None = None
    """Of the cylinder around a pointing forearm. None: what the body says of itself."""
    figure_lead: Seconds = 2.0
    """From gaze on target to the stroke of the point in profile figure-3.3."""

    # Phrases for references that come without any: services/generation/phrases.py.
    phrase_attributes: tuple[PhraseAttribute, ...] = ("color", "shape", "feature", "size")
    """What proposed phrases may say beside the noun, the most preferred first: absolute before relative, as people
    do (Dale and Reiter 1995, after Pechmann 1989). `shape` only where the noun is something else."""
    this_within: Meters = 0.65
    """Proposed for what is so near to the robot: "this"; beyond: "that". Ours; both are said as in Appendix B."""

    turn_silence: Seconds = 10.0
    """How long an open turn may lie still before it closes as aborted."""
    barge_in: Seconds = 0.8
    """How long the addressee speaks into the robot's speech before it gives up the turn; shorter is a backchannel."""
    decision_patience: Seconds = 8.0
    """After a block's end: how long its undecided connection events may delay the fragment's outcome."""
    world_patience: Seconds = 5.0
    """How long a fragment waits for a first report of the world."""
    body_patience: Seconds = 5.0
    """How long a reference waits for a body to say what motions cost."""

    # The arbiter of the head: generation, maintenance policy.
    dwell: Seconds = 0.3
    """How long the head stays after its owner let go, before a lower claim gets it."""
    glance_factor: float = 1.0
    """k: a glance is due after k times the mean time between connection events."""
    mtbce_prior: Seconds = 5.7
    """Until `mtbce_events` connection events were seen. Section 2.3."""
    mtbce_low: Seconds = 3.0
    """The recent mean counts as no shorter than this. Ours."""
    mtbce_high: Seconds = 15.0
    """And as no longer than this. Ours."""
    mtbce_events: int = 5
    """How many connection events make a mean worth believing. Ours."""
    glance_duration: Seconds = 0.9
    """How long a glance at the face lasts before the head goes back. Ours."""
    response_hold: Seconds = 0.8
    """How long shared gaze lasts before the response lets go."""
    hand_speed: float = 0.05
    """m/s: a hand is moving above this."""
    hand_onset: Seconds = 0.2
    """How long a hand moves before the head tracks it. Section 3.3.4 tracks hands; the numbers are ours."""
    hand_stillness: Seconds = 0.8
    """How long it is still before the head leaves it. Ours."""
    face_lost: Seconds = 2.0
    """A face lost for longer is no longer tracked; the head holds its direction."""
    retry: Seconds = 1.0
    """Pause before a gaze shift that failed is tried again."""

    def __post_init__(self) -> None:
        gaze, directed, pointing = (
            self.gaze_reliability, self.directed_gaze_reliability, self.pointing_reliability,
        )  # fmt: skip
        if not 0 < gaze < directed < pointing < 1:
            raise ValueError(
                f"0 < gaze_reliability < directed_gaze_reliability < pointing_reliability < 1 does not hold: "
                f"{gaze}, {directed}, {pointing}"
            )
        if not 0 < self.phrase_reliability < 1:
            raise ValueError(f"phrase_reliability {self.phrase_reliability} is not in (0, 1)")
        if self.channel == "sum" and pointing + self.phrase_reliability >= 1:
            raise ValueError(
                f"pointing_reliability {pointing} + phrase_reliability {self.phrase_reliability} reaches 1: "
                'a channel cannot be certain; lower one or set channel = "independent"'
            )
        for name in self.__struct_fields__:
            value = getattr(self, name)
            if isinstance(value, float) and not isfinite(value):
                raise ValueError(f"{name} must be a finite number, not {value}")
        for name in _POSITIVE:
            if getattr(self, name) <= 0:
                raise ValueError(f"{name} must be positive, not {getattr(self, name)}")
        for name in _NOT_NEGATIVE:
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must not be negative, not {getattr(self, name)}")
        if len(set(self.phrase_attributes)) < len(self.phrase_attributes):
            raise ValueError(f"phrase_attributes names one twice: {', '.join(self.phrase_attributes)}")
        if self.mtbce_low > self.mtbce_high:
            raise ValueError(f"mtbce_low {self.mtbce_low} is above mtbce_high {self.mtbce_high}")
        for name in ("gaze_half_angle", "pointing_radius"):
            value = getattr(self, name)
            if value is not None and value <= 0:
                raise ValueError(f"{name} must be positive, not {value}")

    @property
    def speech_only(self) -> bool:
        """Is the robot to say the task's words and to do nothing else?"""
        return self.condition == "degraded-generation"

    def head_cost(self, degrees: Degrees) -> Seconds:
        return self.seconds_per_head_degree * degrees

    def arm_cost(self, degrees: Degrees) -> Seconds:
        return self.seconds_per_arm_degree * degrees


_POSITIVE = (
    "turn_silence", "barge_in", "decision_patience", "world_patience", "glance_factor", "mtbce_prior", "mtbce_low",
    "glance_duration", "response_hold", "retry",
)  # fmt: skip
_NOT_NEGATIVE = (
    "seconds_per_head_degree", "seconds_per_arm_degree", "seconds_per_word", "wait_weight", "expected_delay",
    "figure_lead", "this_within", "dwell", "hand_speed", "hand_onset", "hand_stillness", "face_lost",
    "mtbce_events",
)  # fmt: skip
