"""Settings of recognition: time limits, resolution, windows. Defaults: design page and Table 2.1."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.ranges import not_negative, positive
from engage_hri.schemas.units import Degrees, Meters, Probability, Seconds, Vector
from engage_hri.services.runtime.absent import FORGOTTEN_AFTER

GazeResolution = Literal["object", "table"]


class Sensing(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings for making looks, speech and manipulations of raw perception. Raises ValueError if out of range."""

    gaze_half_angle: Degrees = 5.0
    """Half angle of the gaze cone: what is farther off the head's direction is not looked at. Right for eye trackers;
    where only the nose is seen take 10, and `gaze_resolution` `table`."""
    gaze_margin: Degrees = 1.0
    """Angle by which another target must be nearer to the direction than the present one before it takes over."""
    dwell: Seconds = 0.15
    """Time for which the gaze stays on a target before that is a look, and off it before the look is over."""
    face_radius: Meters = 0.12
    """Radius of the faces of people and of the robot, around the point between the eyes."""
    robot_face: Vector = (0.05, 0.0, 1.17)
    """Place of the robot's eyes as long as its `RobotState` does not say it."""
    memory: Seconds = 10.0
    """Time in which the confidence in the place of a covered thing halves."""
    voice_onset: Seconds = 0.1
    """Shortest sound that counts as speech."""
    voice_pause: Seconds = 0.25
    """Shortest silence that ends speech."""
    voice_lost: Seconds = 0.5
    """Time without a voice level after which speech has ended, at the time of the last level."""
    hand_reach: Meters = 0.1
    """Greatest distance from the center of a hand to that of a piece that it moves."""
    moved: Meters = 0.025
    """Distance that a piece goes from its place, with a hand, before it counts as manipulated."""
    tremor: Meters = 0.01
    """Distance from its place within which a piece rests: the noise of vision."""
    smoothing: Seconds = 0.15
    """Time over which places of pieces are averaged."""
    rest: Seconds = 0.3
    """Time for which a piece rests before its manipulation is over."""
    oldest: Seconds = 0.5
    """Greatest age at which a head pose or a voice level that arrives still counts."""
    settling: Seconds = 0.35
    """Longest time for which events wait for raw perception that is undecided. Shorter than the realizer's
    grace (0.5 s)."""

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
    """Settings of recognition. Raises ValueError for a limit that is not positive or thresholds out of order."""

    gaze_resolution: GazeResolution = "object"
    """Resolution of looks. `table`: one at the table or anything on it counts for any object there (poor vision)."""
    directed_gaze_limit: Seconds = 2.5
    """Time limit, from the latest of the event's start, gaze on target, point stroke and phrase start."""
    mutual_facial_gaze_limit: Seconds = 1.9
    """Time limit; the longest failed one in Table 2.1 is 1.8 s."""
    adjacency_pair_limit: Seconds = 4.0
    """Time limit from the end of the turn, for an answer in words or gestures. In a public study of turn-taking 96 of
    100 people answered a product robot within it, and half of them within 1.5 s."""
    third_turn_limit: Seconds = 1.5
    """Time after an answer of the robot in which the person may close the exchange; later is a new turn."""
    manipulation_limit: Seconds = 8.0
    """Time limit from the end of the turn, when the manipulation of an object is accepted as the answer."""
    accept: tuple[Action, ...] = ("speak", "nod", "shake", "point")
    """Actions that answer an adjacency pair of the robot, unless its request names others."""
    turn_patience: Seconds = 12.0
    """Time after the robot's last word for which its unfinished turn still counts; longer than generation's 10 s.
    Also the time, after the limit, for which an anchor that does not come is waited for."""
    backchannel_limit: Seconds = 0.8
    """Longest speech that is still a backchannel."""
    direct_by_look: Seconds = 0.6
    """Time for which a person looks at an object before that directs the robot's gaze."""
    after_robot_directed: Seconds = 2.0
    """Time after a robot's directed gaze in which a look at the same object is no direction of its own."""
    least_confidence: Probability = 0.4
    """Least confidence of an observation: a beginning below is ignored, a thing below counts as covered. Ours."""
    words_margin: Seconds = 0.5
    """Time by which spoken words may miss the speech that they belong to: recognizers and voice detectors disagree
    about where speech begins and ends. Ours."""
    words_patience: Seconds = 10.0
    """Time after the end of an event for which it is told again, should its words become known or be corrected."""
    sensing: Sensing = Sensing()
    """Settings for raw perception."""
    look_break: Seconds = 0.15
    """Longest pause in a look: one that is reported to end and to begin again within it has gone on. What happens
    meanwhile waits for the decision."""
    longest_speech: Seconds = 60.0
    """Time after which speech is over if no report of its end has come. The next beginning ends it, too."""
    longest_gesture: Seconds = 10.0
    """The same for a nod, a shake or a point."""
    longest_manipulation: Seconds = 120.0
    """The same for a manipulation."""
    window: Seconds = 30.0
    """Length of the window of the recent statistics."""
    reference_mtbce: Seconds = 5.7
    """Pace to compare with until `enough_events` have been seen: mean time between connection events, Table 2.1."""
    enough_events: int = 5
    """Number of connection events from which a person's own mean counts; at least 2. Ours."""
    engaged_from: Probability = 0.5
    """Estimate from which a person is engaged: for example all events good, but half as fast as usual. Ours."""
    disengaged_below: Probability = 0.25
    """Estimate below which a person is disengaged; between the two, weakening. Ours."""
    hysteresis: Probability = 0.05
    """Distance by which the estimate passes a threshold before the level changes."""

    def __post_init__(self) -> None:
        positive(self, (
            "directed_gaze_limit", "mutual_facial_gaze_limit", "adjacency_pair_limit", "third_turn_limit",
            "manipulation_limit",
            "turn_patience", "backchannel_limit", "direct_by_look", "window", "reference_mtbce",
            "longest_speech", "longest_gesture", "longest_manipulation",
        ))  # fmt: skip
        not_negative(self, (
            "after_robot_directed", "hysteresis", "words_margin", "words_patience",
        ))  # fmt: skip
        if not 0 <= self.disengaged_below + self.hysteresis <= self.engaged_from - self.hysteresis <= 1:
            raise ValueError("thresholds overlap: disengaged_below + hysteresis <= engaged_from - hysteresis")
        if not 0 <= self.look_break <= self.sensing.settling:
            raise ValueError("look_break must not be negative, nor longer than sensing.settling")
        if max(self.after_robot_directed, self.direct_by_look) >= FORGOTTEN_AFTER:
            raise ValueError(
                f"after_robot_directed and direct_by_look must be less than {FORGOTTEN_AFTER:g} s: "
                "who has gone is then forgotten"
            )
        if self.enough_events < 2:
            raise ValueError("enough_events must be at least 2: one event has no time between events")
        if not self.accept:
            raise ValueError("accept must name at least one action")
