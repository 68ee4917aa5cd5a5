"""Settings of the simulated person, table and cameras."""

import math
from typing import Literal

from msgspec import Struct

from engage_hri.schemas.ranges import not_negative, positive, shares
from engage_hri.schemas.units import Degrees, Meters, Probability, Seconds

HumanKind = Literal["appendix-b", "misplacing", "listening", "stochastic", "attentive", "none"]


class PerceptionFaults(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Faults of cameras and microphones (thesis 5.4.2), drawn from `simulation.seed`. All are off by default.

    If any fault makes the view unsteady, the cameras report at every `frame`, not only when something moves. Messages
    that come twice, late or never are faults of the bus.
    """

    gaze: Degrees = 0.0
    """Standard deviation of the head's direction about each axis, drawn for each frame; for `raw` only."""
    wrong_look: Probability = 0.0
    """Share of the looks that are reported at the nearest other thing; for `symbolic` only."""
    missed_look: Probability = 0.0
    """Share of the looks that are not reported at all; for `symbolic` only."""
    dropped_frames: Probability = 0.0
    """Share of the frames that never come, drawn for camera and microphone separately."""
    lost_faces: float = 0.0
    """Number of times per minute that the face is lost."""
    lost_for: tuple[Seconds, Seconds] = (0.1, 0.4)
    """Shortest and longest time that it then takes to find it again."""
    occlusion: Meters = 0.0
    """Distance from the center of a hand within which it covers a piece; 0: hands are transparent."""
    covered: Literal["faint", "missing"] = "faint"
    """Report of a covered piece: `faint` is as last seen, with a confidence of 0.3; `missing` is none."""
    position: Meters = 0.0
    """Standard deviation of x and y of each piece, drawn for each frame. Edge detection has about 0.005."""
    yaw: Degrees = 0.0
    """Standard deviation of its angle. From 12 degrees on, "top" is now and then "top left"."""
    dropped_speech: Probability = 0.0
    """Share of the person's utterances that are not heard."""

    def __post_init__(self) -> None:
        not_negative(self, ("gaze", "lost_faces", "occlusion", "position", "yaw"), "simulation.faults.")
        shares(self, ("wrong_look", "missed_look", "dropped_frames", "dropped_speech"), "simulation.faults.")
        if not 0 <= self.lost_for[0] <= self.lost_for[1] < math.inf:
            raise ValueError(f"simulation.faults.lost_for must be shortest and longest, not {self.lost_for}")

    @property
    def unsteady(self) -> bool:
        """True if frames differ even when nothing moves."""
        return any((self.dropped_frames, self.lost_faces, self.occlusion, self.position, self.yaw))


class Habits(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Habits of the stochastic person ("they" below). Delays are least, mean and longest, in seconds."""

    follows_point: Probability = 0.929
    """Share of the robot's points that they follow with a look. Table 2.1, directed gaze."""
    follows_look: Probability = 0.8
    """The same for looks without a point. Ours: the table does not separate gaze with and without pointing."""
    follow_delay: tuple[Seconds, Seconds, Seconds] = (0.0, 0.3, 2.0)
    """Delay from the robot's look or point to theirs. Table 2.1."""
    answers_look: Probability = 0.458
    """Share of the robot's looks at their face that they answer, times `propensity`. Table 2.1: facial gaze."""
    look_delay: tuple[Seconds, Seconds, Seconds] = (0.0, 0.7, 1.5)
    """Delay from the robot's look to theirs. Table 2.1."""
    answers_turn: Probability = 0.682
    """Share of the turns that they answer, or begin to carry out, in time. Table 2.1, adjacency pair. If they do
    not, and the turn was a request, they study the pieces first."""
    answer_delay: tuple[Seconds, Seconds, Seconds] = (0.0, 0.4, 1.1)
    """Delay from the end of the turn to the answer. Table 2.1."""
    study: tuple[Seconds, Seconds, Seconds] = (4.0, 9.0, 60.0)
    """Time for which they study the pieces: the busy regime. Thesis 2.3 has it; the numbers are ours."""
    busy_answers: Probability = 0.25
    """Factor on these three shares, and on what they do unasked, while they study or move pieces. Ours."""
    search: tuple[Seconds, Seconds, Seconds] = (0.3, 1.5, 6.0)
    """Time for which they search for a piece without having seen the robot point or look at it. Ours."""
    hears: Probability = 0.97
    """Share of the robot's utterances that they hear. Ours."""
    guesses: Probability = 0.5
    """Probability of a guess which piece "this" or "that" is, if they have not seen it shown; else they ask. Ours."""
    confuses: Probability = 0.06
    """Share of the pieces, not seen shown, that they confuse with one of the same color or shape. Ours."""
    confuses_shown: Probability = 0.01
    """The same for pieces that they have seen the robot show. Ours."""
    misplaces: Probability = 0.05
    """Share of the pieces that they lay on another side of the landmark than asked. Ours."""
    backchannels: Probability = 0.03
    """Share of the robot's words after which they nod, or say a brief word. Ours."""
    speaks: Probability = 0.3
    """Share of backchannels and answers that are words; the others are nods. Ours."""
    looks_up_every: Seconds = 12.0
    """Mean time between unasked looks at the robot's face, at a `propensity` of 1. Ours."""
    directs_every: Seconds = 45.0
    """Mean time between unasked looks or points at a piece, while the robot is silent. Ours."""
    points: Probability = 0.4
    """Share of these looks and points that are points. Ours."""
    glance: Seconds = 1.2
    """Length of a look at a face or a thing. Ours."""
    reports: Probability = 0.7
    """Share of the laid pieces after which they look at the robot's face, times `propensity`. Ours."""
    reciprocity: Probability = 0.05
    """Step of their propensity for looks at the robot's face, which begins at 1: an answered look moves it toward 2,
    another toward 0. Our assumption, after hypothesis 11 of the thesis; 0: eye contact changes nothing."""

    def __post_init__(self) -> None:
        place, durations = "simulation.stochastic.", ("looks_up_every", "directs_every", "glance")
        delays = [name for name in self.__struct_fields__ if isinstance(getattr(self, name), tuple)]
        for name in delays:
            least, mean, longest = getattr(self, name)
            if not 0 <= least < mean < longest < math.inf:
                raise ValueError(f"{place}{name}: 0 <= least < mean < longest, not {getattr(self, name)}")
        positive(self, durations, place)
        shares(self, [name for name in self.__struct_fields__ if name not in (*delays, *durations)], place)


class SimulationConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the simulation.

    human: `appendix-b` follows Appendix B by the ids of the robot's blocks; `misplacing` does too, but lays one
    piece wrongly; `listening` does what the robot's words say, whatever the manager's plan; `stochastic` too, with
    the habits, pace and mistakes of `stochastic`; `attentive` looks where the robot looks, meets its eyes, and nods
    when it has spoken, says yes to a question, or does what it asks for; `none` leaves the table alone.
    """

    human: HumanKind = "appendix-b"
    seed: int = 0
    """Seed of the person's reaction times and of the faults of perception."""
    jitter: Seconds = 0.03
    """Greatest deviation of reaction times, either way. The scenario's order has room for 0.1 s."""
    await_participants: tuple[str, ...] = ("control", "generation", "realizer", "recognition")
    """Participants that must be on the bus before the person comes. They may start in any order, hours apart."""
    entrance: Seconds = 0.0
    """Time from then until the person comes."""
    frame: Seconds = 1 / 15
    """Time between two reports of the world while something moves, and of raw perception while the person sits there.
    Perception cameras give 10..30 reports per second."""
    perception: Literal["symbolic", "raw"] = "symbolic"
    """Kind of reports. `symbolic`: looks, speech and manipulations as such. `raw`: only the head's pose, the voice,
    hands and pieces, from which recognition derives the rest."""
    head_turn: Seconds = 0.2
    """Time that the head takes to face another target; for `raw` only."""
    faults: PerceptionFaults = PerceptionFaults()
    """Faults of cameras and microphones."""
    stochastic: Habits = Habits()
    """Habits of the `stochastic` person."""
    hand_speed: Meters = 0.45
    """Mean speed over a movement, in m/s. Unhurried reaching at a table is about 0.4..0.8 m/s."""
    shortest_movement: Seconds = 0.6
    """Least time of a hand's movement."""

    def __post_init__(self) -> None:
        positive(self, ("frame", "hand_speed", "shortest_movement"), "simulation.")
        not_negative(self, ("entrance", "jitter", "head_turn"), "simulation.")
