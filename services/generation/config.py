"""Every parameter of engagement generation: unit, default, source. Refused at start when it contradicts itself."""

from math import pi
from typing import Literal

from msgspec import Struct

from engage_hri.schemas.ranges import inner_shares, not_negative, positive
from engage_hri.schemas.units import Degrees, Meters, Probability, Radians, Seconds

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
    expected_delay: Seconds = 0.3
    """Expected delay of directed gaze, E[delay]: the mean of Table 2.1 (decision B7)."""

    words_between: float = 3.0
    """Words of plain speech between two references over which head and arm stay at the first one's target; after more
    they have gone home. Decision 0024; the number is ours."""

    gaze_half_angle: Radians | None = None
    """Half the angle of the robot's gaze cone as people perceive it, < pi/2. None: the body's own. Thesis 3.3.2."""
    pointing_radius: Meters | None = None
    """Radius of the cylinder around a pointing forearm. None: the body's own. Thesis 3.3.2."""
    figure_lead: Seconds = 2.0
    """Seconds from gaze on target to the stroke of the point in profile figure-3.3: the figure's own."""

    # Phrases for references that come without any: services/generation/references/phrases.py.
    phrase_attributes: tuple[PhraseAttribute, ...] = ("color", "shape", "feature", "size")
    """Attributes that proposed phrases may say beside the noun, the most preferred first: absolute before relative,
    as people do (Dale and Reiter 1995, after Pechmann 1989). `shape` only where the noun is something else."""
    this_within: Meters = 0.65
    """Distance from the robot up to which "this" is proposed; beyond: "that". Ours; Appendix B says both."""

    turn_silence: Seconds = 10.0
    """Silence after which an open turn closes as aborted. Ours."""
    low_end: bool = True
    """Say the last two words of a turn lower, thesis 3.3.1: the block's last speech gets prosodic markup."""
    barge_in: Seconds = 0.8
    """Seconds that the addressee speaks into the robot's speech before the robot gives up the turn; shorter is a
    backchannel, as the longest of Table 2.1."""
    decision_patience: Seconds = 8.0
    """Seconds after a block's end for which undecided connection events may delay the fragment's outcome. Ours."""
    words_patience: Seconds = 2.0
    """Seconds after the end of a spoken answer for which the outcome of the turn waits for its words, if somebody
    tells the words of that person: recognizers know them 0.3 to 2 s after they were said."""
    longest_answer: Seconds = 15.0
    """Seconds after the beginning of such an answer for which it waits for the end. Ours."""
    world_patience: Seconds = 5.0
    """Seconds that a fragment waits for a first report of the world, or for a person to speak to. Ours."""
    fragments: int = 200
    """Number of fragments that may be waiting or performed at once; one more is refused. Ours."""
    body_patience: Seconds = 5.0
    """Seconds that a reference waits for a body to say what motions cost. Ours."""

    # The arbiter of the head: generation, maintenance policy.
    dwell: Seconds = 0.3
    """Seconds that the head stays after its owner let go, before a lower claim gets it. Ours."""
    glance_factor: float = 1.0
    """Factor k: a glance is due after k times the mean time between connection events. Thesis 3.3.4 has 1."""
    mtbce_prior: Seconds = 5.7
    """The mean until `mtbce_events` connection events were seen. Table 2.1."""
    mtbce_low: Seconds = 3.0
    """Least value that the recent mean counts as. Ours."""
    mtbce_high: Seconds = 15.0
    """Greatest value that the recent mean counts as. Ours."""
    mtbce_events: int = 5
    """Number of connection events, without the robot's glances, from which on the mean is believed. Ours."""
    glance_duration: Seconds = 0.9
    """Seconds that a glance at the face lasts before the head goes back. Ours."""
    response_hold: Seconds = 0.8
    """Seconds that shared gaze lasts before the response lets go. Thesis 3.3.3 names no time; ours."""
    hand_speed: float = 0.05
    """Speed in m/s above which a hand counts as moving. Ours."""
    hand_onset: Seconds = 0.2
    """Seconds that a hand moves before the head tracks it. Thesis 3.3.4 tracks hands; the number is ours."""
    hand_stillness: Seconds = 0.8
    """Seconds that a hand is still before the head leaves it. Ours."""
    retry: Seconds = 1.0
    """Pause before a gaze shift that failed is tried again. Ours."""

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
        positive(self, _POSITIVE)
        not_negative(self, _NOT_NEGATIVE)
        if len(set(self.phrase_attributes)) < len(self.phrase_attributes):
            raise ValueError(f"phrase_attributes names one twice: {', '.join(self.phrase_attributes)}")
        if self.mtbce_low > self.mtbce_high:
            raise ValueError(f"mtbce_low {self.mtbce_low} is above mtbce_high {self.mtbce_high}")
        if self.gaze_half_angle is not None and not 0 < self.gaze_half_angle < pi / 2:
            raise ValueError(f"gaze_half_angle must be between 0 and pi/2 radians, not {self.gaze_half_angle}")
        if self.pointing_radius is not None:
            positive(self, ("pointing_radius",))

    @property
    def speech_only(self) -> bool:
        """True if the robot is to say the task's words and to do nothing else."""
        return self.condition == "degraded-generation"

    def head_cost(self, degrees: Degrees) -> Seconds:
        return self.seconds_per_head_degree * degrees

    def arm_cost(self, degrees: Degrees) -> Seconds:
        return self.seconds_per_arm_degree * degrees


_POSITIVE = (
    "turn_silence", "barge_in", "decision_patience", "longest_answer", "world_patience", "glance_factor",
    "mtbce_prior", "mtbce_low",
    "glance_duration", "response_hold", "retry", "fragments",
)  # fmt: skip
_NOT_NEGATIVE = (
    "seconds_per_head_degree", "seconds_per_arm_degree", "seconds_per_word", "wait_weight", "expected_delay",
    "figure_lead", "this_within", "dwell", "hand_speed", "hand_onset", "hand_stillness",
    "mtbce_events", "body_patience", "words_between", "words_patience",
)  # fmt: skip
