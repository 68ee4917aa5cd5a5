"""What can be set in recognition: time limits, resolution, windows. Defaults: design page and Table 2.1."""

from typing import Literal

from msgspec import Struct

from schemas.behaviors import Action
from schemas.units import Probability, Seconds

GazeResolution = Literal["object", "table"]


class RecognitionConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Raises ValueError for a limit that is not positive or thresholds out of order."""

    gaze_resolution: GazeResolution = "object"
    """`table`: a person's look at the table or anything on it counts as a look at any object there (poor vision)."""
    directed_gaze_limit: Seconds = 2.5
    """From the latest of the event's start, gaze on target, point stroke and phrase start."""
    mutual_facial_gaze_limit: Seconds = 1.9
    """Longest failed one in Table 2.1 is 1.8 s."""
    adjacency_pair_limit: Seconds = 1.5
    """From the end of the turn, for an answer in words or gestures."""
    manipulation_limit: Seconds = 8.0
    """From the end of the turn, when the manipulation of an object is accepted as the answer."""
    accept: tuple[Action, ...] = ("speak", "nod", "shake", "point")
    """What answers a robot's adjacency pair whose request does not say."""
    turn_patience: Seconds = 12.0
    """How long after the robot's last word its unfinished turn is believed in; longer than generation's 10 s."""
    backchannel_limit: Seconds = 0.8
    """Longest speech that is still a backchannel."""
    direct_by_look: Seconds = 0.6
    """How long a person looks at an object before that directs the robot's gaze."""
    after_robot_directed: Seconds = 2.0
    """A look that follows a robot's directed gaze to the same object so closely is no direction of its own."""
    lost_face_grace: Seconds = 0.5
    """A face lost for less has not gone."""
    window: Seconds = 30.0
    """Of the recent statistics."""
    reference_mtbce: Seconds = 5.7
    """Table 2.1; the pace to compare with until `enough_events` have been seen."""
    enough_events: int = 5
    """How many connection events make a mean of a person's own; at least 2. Ours."""
    engaged_from: Probability = 0.5
    """The estimate from which a person is engaged: all events good but half as fast as usual, say. Ours."""
    disengaged_below: Probability = 0.25
    """The estimate below which a person is disengaged; between the two, weakening. Ours."""
    hysteresis: Probability = 0.05
    """How far the estimate passes a threshold before the level changes."""

    def __post_init__(self) -> None:
        positive = (
            "directed_gaze_limit", "mutual_facial_gaze_limit", "adjacency_pair_limit", "manipulation_limit",
            "turn_patience", "backchannel_limit", "direct_by_look", "window", "reference_mtbce",
        )  # fmt: skip
        for name in positive:
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be greater than 0 s, not {getattr(self, name)}")
        for name in ("after_robot_directed", "lost_face_grace", "hysteresis"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must not be negative, but is {getattr(self, name)}")
        if not 0 <= self.disengaged_below + self.hysteresis <= self.engaged_from - self.hysteresis <= 1:
            raise ValueError("thresholds overlap: disengaged_below + hysteresis <= engaged_from - hysteresis")
        if self.enough_events < 2:
            raise ValueError("enough_events must be at least 2: one event has no time between events")
        if not self.accept:
            raise ValueError("accept must name at least one action")
