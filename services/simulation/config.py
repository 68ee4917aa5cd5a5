"""How the simulated human and table behave."""

import math
from typing import Literal

from msgspec import Struct

from engage_hri.schemas.ranges import not_negative, positive, shares
from engage_hri.schemas.units import Degrees, Meters, Probability, Seconds

HumanKind = Literal["scripted", "misplacing", "listening", "stochastic", "attentive", "none"]


class PerceptionFaults(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What cameras and microphones get wrong (thesis 5.4.2), drawn from `simulation.seed`. All off by default.

    With any fault in what is seen the cameras report at every `frame`, not only when something moves. Messages that
    come twice, late or never are the bus' faults.
    """

    gaze: Degrees = 0.0
    """`raw`: standard deviation of the head's direction, about each axis, anew in each frame."""
    wrong_look: Probability = 0.0
    """`symbolic`: how often a look is reported at the nearest other thing."""
    missed_look: Probability = 0.0
    """`symbolic`: how often a look is not reported at all."""
    dropped_frames: Probability = 0.0
    """Share of the frames that never come, of camera and microphone each by itself."""
    lost_faces: float = 0.0
    """How often a minute the face is lost."""
    lost_for: tuple[Seconds, Seconds] = (0.1, 0.4)
    """Shortest and longest time that it then takes to find it again."""
    occlusion: Meters = 0.0
    """How near a hand's center has to be to that of a piece to cover it; 0: hands are transparent."""
    covered: Literal["faint", "missing"] = "faint"
    """What becomes of a covered piece in the world: it stays as last seen, with a confidence of 0.3, or is gone."""
    position: Meters = 0.0
    """Standard deviation of x and y of each piece, anew in each frame. 0.005 is what edge detection gives."""
    yaw: Degrees = 0.0
    """The same of its angle. From 12 degrees on, "top" is now and then "top left"."""
    dropped_speech: Probability = 0.0
    """How often an utterance of the person is not heard."""

    def __post_init__(self) -> None:
        not_negative(self, ("gaze", "lost_faces", "occlusion", "position", "yaw"), "simulation.faults.")
        shares(self, ("wrong_look", "missed_look", "dropped_frames", "dropped_speech"), "simulation.faults.")
        if not 0 <= self.lost_for[0] <= self.lost_for[1] < math.inf:
            raise ValueError(f"simulation.faults.lost_for must be shortest and longest, not {self.lost_for}")

    @property
    def unsteady(self) -> bool:
        """Does what is seen differ from frame to frame by itself?"""
        return any((self.dropped_frames, self.lost_faces, self.occlusion, self.position, self.yaw))


class Habits(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the stochastic person does, how fast and how well. Delays are least, mean and longest, in seconds."""

    follows_point: Probability = 0.929
    """How often they look where the robot points. Table 2.1, directed gaze."""
    follows_look: Probability = 0.8
    """The same where it only looks. Ours: the table does not tell gaze with pointing from gaze without."""
    follow_delay: tuple[Seconds, Seconds, Seconds] = (0.0, 0.3, 2.0)
    """From the robot's look or point to theirs. Table 2.1."""
    answers_look: Probability = 0.458
    """How often they look back when the robot looks at their face, times `propensity`. Table 2.1: facial gaze."""
    look_delay: tuple[Seconds, Seconds, Seconds] = (0.0, 0.7, 1.5)
    """From the robot's look to theirs. Table 2.1."""
    answers_turn: Probability = 0.682
    """How often they answer a turn, or begin what it asks for, in time. Table 2.1, adjacency pair. Where they don't
    they study the pieces first, if the turn was a request."""
    answer_delay: tuple[Seconds, Seconds, Seconds] = (0.0, 0.4, 1.1)
    """From the end of the turn. Table 2.1."""
    study: tuple[Seconds, Seconds, Seconds] = (4.0, 9.0, 60.0)
    """How long they study the pieces: the busy regime. Thesis 2.3 has it; the numbers are ours."""
    busy_answers: Probability = 0.25
    """What is left of these three, and of what they do of their own accord, while they study or move pieces. Ours."""
    search: tuple[Seconds, Seconds, Seconds] = (0.3, 1.5, 6.0)
    """How long they look for a piece that they have not seen the robot point or look at. Ours."""
    hears: Probability = 0.97
    """How often they hear what the robot says. Ours."""
    guesses: Probability = 0.5
    """How often they take some piece for "this" or "that" when they have not seen which; else they ask. Ours."""
    confuses: Probability = 0.06
    """How often they then take another one of the same color or shape. Ours."""
    confuses_shown: Probability = 0.01
    """The same where they have seen it. Ours."""
    misplaces: Probability = 0.05
    """How often they lay a piece on another side of the landmark than asked. Ours."""
    backchannels: Probability = 0.03
    """After each word they hear: how often they nod, or say a brief word. Ours."""
    speaks: Probability = 0.3
    """Share of backchannels and answers that are words; the others are nods. Ours."""
    looks_up_every: Seconds = 12.0
    """Mean time between looks at the robot's face of their own accord, at a `propensity` of 1. Ours."""
    directs_every: Seconds = 45.0
    """Mean time between looks or points at a piece of their own accord, while the robot is silent. Ours."""
    points: Probability = 0.4
    """Share of those that are points. Ours."""
    glance: Seconds = 1.2
    """How long they look at a face or a thing. Ours."""
    reports: Probability = 0.7
    """How often they look up at the robot's face when a piece is laid, times `propensity`. Ours."""
    reciprocity: Probability = 0.05
    """How much an answered look at the robot's face moves their propensity for such looks from 1 toward 2, and an
    unanswered one toward 0. Our assumption, after hypothesis 11 of the thesis; 0: eye contact changes nothing."""

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
    """human: `scripted` follows Appendix B by the ids of the robot's blocks; `misplacing` does too, but lays one
    piece wrongly; `listening` does what the robot's words say, whatever the manager's plan; `stochastic` too, with
    the habits, pace and mistakes of `stochastic`; `attentive` looks where the robot looks, meets its eyes, and nods
    when it has spoken or does what it asks for; `none` leaves the table alone.
    """

    human: HumanKind = "scripted"
    seed: int = 0
    """Of the person's reaction times and of what perception gets wrong."""
    jitter: Seconds = 0.03
    """Reaction times vary by up to this, either way. The scenario's order has room for 0.1 s."""
    await_participants: tuple[str, ...] = ("control", "generation", "realizer", "recognition")
    """The person comes when these are on the bus. Their services may start in any order, hours apart."""
    entrance: Seconds = 1.0
    """From then until the person comes."""
    frame: Seconds = 1 / 15
    """Between two reports of the world while something moves, and of raw perception all the while the person sits
    there. Perception cameras give 10..30 per second."""
    perception: Literal["symbolic", "raw"] = "symbolic"
    """`symbolic`: looks, speech and manipulations are reported as such. `raw`: only the head's pose, the voice, hands
    and pieces; what that means is for recognition to find out."""
    head_turn: Seconds = 0.2
    """`raw`: how long the head takes to face something else."""
    faults: PerceptionFaults = PerceptionFaults()
    """What cameras and microphones get wrong."""
    stochastic: Habits = Habits()
    """Of the person `stochastic`."""
    hand_speed: Meters = 0.45
    """m/s, mean over a movement. Unhurried reaching at a table is about 0.4..0.8 m/s."""
    shortest_movement: Seconds = 0.6
    """A hand's movement takes at least this."""

    def __post_init__(self) -> None:
        positive(self, ("frame", "hand_speed", "shortest_movement"), "simulation.")
        not_negative(self, ("entrance", "jitter", "head_turn"), "simulation.")
