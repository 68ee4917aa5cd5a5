"""What can be set in recognition: time limits, resolution, windows. Defaults: design page and Table 2.1."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.ranges import not_negative, positive
from engage_hri.schemas.units import Degrees, Meters, Probability, Seconds, Vector

GazeResolution = Literal["object", "table"]


class Sensing(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How raw perception becomes looks, speech and manipulations. Raises ValueError for what is out of range."""

    gaze_half_angle: Degrees = 5.0
    """Of the gaze cone: what is farther off the head's direction is not looked at. Right for eye trackers; where only
    the nose is seen take 10, and `gaze_resolution` `table`."""
    gaze_margin: Degrees = 1.0
    """How much nearer to the direction another target must be than the present one before it takes over."""
    dwell: Seconds = 0.15
    """How long the gaze stays on a target before that is a look, and off it before the look is over."""
    face_radius: Meters = 0.12
    """Of people and of the robot, around the point between the eyes."""
    robot_face: Vector = (0.05, 0.0, 1.17)
    """Where the robot's eyes are as long as its `RobotState` does not say it."""
    memory: Seconds = 10.0
    """In which the confidence in the place of a covered thing halves."""
    voice_onset: Seconds = 0.1
    """Shorter sounds are no speech."""
    voice_pause: Seconds = 0.25
    """A shorter silence does not end speech."""
    voice_lost: Seconds = 0.5
    """Without news of the voice for this long, speech has ended with the last."""
    hand_reach: Meters = 0.1
    """How near the center of a hand comes to that of a piece that it moves."""
    moved: Meters = 0.025
    """How far a piece has gone from its place, with a hand, before it is manipulated."""
    tremor: Meters = 0.01
    """Within this of its place a piece rests: the noise of vision."""
    smoothing: Seconds = 0.15
    """Over which places of pieces are averaged."""
    rest: Seconds = 0.3
    """How long a piece rests before its manipulation is over."""
    oldest: Seconds = 0.5
    """A head pose or a voice level that arrives later than this after its stamp is ignored."""
    settling: Seconds = 0.35
    """How long events wait, at most, for raw perception that has not made up its mind. Shorter than the realizer's
    `event_grace`."""

    def __post_init__(self) -> None:
        place = "sensing."
        positive(
            self, ("gaze_half_angle", "face_radius", "memory", "voice_lost", "hand_reach", "rest", "oldest"), place
        )
        not_negative(self, ("gaze_margin", "dwell", "voice_onset", "voice_pause", "smoothing", "settling"), place)
        if not self.gaze_half_angle + self.gaze_margin < 90:
            raise ValueError("sensing.gaze_half_angle and gaze_margin must be less than 90 degrees together")
        if not 0 <= self.tremor < self.moved:
            raise ValueError("sensing.tremor must be less than sensing.moved, and not negative")


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
    """How long after the robot's last word its unfinished turn is believed in; longer than generation's 10 s.
    After the limit, an anchor that does not come is waited for as long."""
    backchannel_limit: Seconds = 0.8
    """Longest speech that is still a backchannel."""
    direct_by_look: Seconds = 0.6
    """How long a person looks at an object before that directs the robot's gaze."""
    after_robot_directed: Seconds = 2.0
    """A look that follows a robot's directed gaze to the same object so closely is no direction of its own."""
    least_confidence: Probability = 0.4
    """What is observed to begin with less is ignored, and a thing in the world with less counts as covered. Ours."""
    sensing: Sensing = Sensing()
    """For raw perception."""
    lost_face_grace: Seconds = 0.5
    """A face lost for less has not gone."""
    look_break: Seconds = 0.15
    """A look that is said to end and follows again within this has gone on. What happens meanwhile waits for it."""
    forgotten_after: Seconds = 600.0
    """Who has been gone for this long, or not been told of by anybody, is forgotten: with the same id comes somebody
    new. What they have done stays in the statistics of all together."""
    longest_speech: Seconds = 60.0
    """Speech whose end nobody has told of by then is over. The next beginning ends it, too."""
    longest_gesture: Seconds = 10.0
    """The same of a nod, a shake or a point."""
    longest_manipulation: Seconds = 120.0
    """The same of a manipulation."""
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
        positive(self, (
            "directed_gaze_limit", "mutual_facial_gaze_limit", "adjacency_pair_limit", "manipulation_limit",
            "turn_patience", "backchannel_limit", "direct_by_look", "window", "reference_mtbce",
            "longest_speech", "longest_gesture", "longest_manipulation",
        ))  # fmt: skip
        not_negative(self, ("after_robot_directed", "lost_face_grace", "hysteresis"))
        if not 0 <= self.disengaged_below + self.hysteresis <= self.engaged_from - self.hysteresis <= 1:
            raise ValueError("thresholds overlap: disengaged_below + hysteresis <= engaged_from - hysteresis")
        if not 0 <= self.look_break <= self.sensing.settling:
            raise ValueError("look_break must not be negative, nor longer than sensing.settling")
        if not self.forgotten_after > max(self.lost_face_grace, self.after_robot_directed, self.direct_by_look):
            raise ValueError(
                "forgotten_after must be greater than lost_face_grace, after_robot_directed and direct_by_look"
            )
        if self.enough_events < 2:
            raise ValueError("enough_events must be at least 2: one event has no time between events")
        if not self.accept:
            raise ValueError("accept must name at least one action")
