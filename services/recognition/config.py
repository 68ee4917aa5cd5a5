"""Settings of recognition: time limits, resolution, windows. Defaults: design page and Table 2.1."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.units import Degrees, Probability, Seconds, positive

GazeResolution = Literal["object", "table"]


GAZE_MARGIN: Degrees = 1.0
"""Angle by which another target must be nearer to the direction of a gaze than the present one before it takes over:
without it a look between two things would flutter. Ours."""
HYSTERESIS: Probability = 0.05
"""Distance by which the estimate of engagement passes a threshold before the level changes. Ours."""


class Sensing(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings for making looks of raw perception. Raises ValueError if out of range."""

    gaze_half_angle: Degrees = 5.0
    """Half angle of the gaze cone: what is farther off the head's direction is not looked at. Right for eye trackers;
    where only the nose is seen take 10, and `gaze_resolution` `table`."""

    def __post_init__(self) -> None:
        positive(self, ("gaze_half_angle",), "sensing.")
        if not self.gaze_half_angle + GAZE_MARGIN < 90:
            raise ValueError(f"sensing.gaze_half_angle must be less than {90 - GAZE_MARGIN:g} degrees")


class RecognitionConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of recognition. Raises ValueError for a limit that is not positive or thresholds out of order."""

    gaze_resolution: GazeResolution = "object"
    """Resolution of looks. `table`: one at the table or anything on it counts for any object there (poor vision)."""
    directed_gaze_limit: Seconds = 2.5
    """Time limit, from the latest of the event's start, gaze on target, point stroke and phrase start."""
    mutual_facial_gaze_limit: Seconds = 1.9
    """Time limit; the longest failed one in Table 2.1 is 1.8 s."""
    adjacency_pair_limit: Seconds = 6.0
    """Time limit from the end of the turn, for an answer in words or gestures. In a public study of turn-taking half
    of the people answered a product robot within 1.5 s. Their times are log-normal: 98 of 100 are within this."""
    third_turn_limit: Seconds = 1.5
    """Time after an answer of the robot in which the person may close the exchange; later is a new turn."""
    manipulation_limit: Seconds = 8.0
    """Time limit from the end of the turn, when the manipulation of an object is accepted as the answer."""
    backchannel_limit: Seconds = 0.8
    """Longest speech that is still a backchannel."""
    least_confidence: Probability = 0.4
    """Least confidence of an observation: a beginning below is ignored, a thing below counts as covered. Ours."""
    memory: str = ""
    """File in which recognition keeps its counts and open pairs, so that they go on when its process has ended and is
    started again on this machine. Empty: they begin anew."""
    sensing: Sensing = Sensing()
    """Settings for raw perception."""
    window: Seconds = 30.0
    """Length of the window of the recent statistics."""
    reference_mtbce: Seconds = 5.7
    """Pace to compare with until a person has shown five events: mean time between connection events, Table 2.1."""
    engaged_from: Probability = 0.5
    """Estimate from which a person is engaged: for example in contact all the time, while events fail. Ours."""
    disengaged_below: Probability = 0.25
    """Estimate below which a person is disengaged; between the two, engaging or disengaging. Ours."""

    def __post_init__(self) -> None:
        positive(self, (
            "directed_gaze_limit", "mutual_facial_gaze_limit", "adjacency_pair_limit", "third_turn_limit",
            "manipulation_limit", "backchannel_limit", "window", "reference_mtbce",
        ))  # fmt: skip
        if not 0 <= self.disengaged_below + HYSTERESIS <= self.engaged_from - HYSTERESIS <= 1:
            raise ValueError(f"engaged_from must be at least {2 * HYSTERESIS:g} above disengaged_below")
