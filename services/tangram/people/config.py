"""Settings of the simulated person, table and cameras."""

import math
from typing import Literal

from msgspec import Struct

from engage_hri.schemas.units import Degrees, Meters, Probability, Seconds, not_negative, positive, shares
from engage_hri.services.simulation.party import NAMES

HumanKind = Literal["appendix-b", "misplacing", "listening", "stochastic", "attentive", "party", "none"]


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


class SimulationConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the simulation.

    human: `appendix-b` follows Appendix B by the ids of the robot's blocks; `misplacing` does too, but lays one
    piece wrongly; `listening` does what the robot's words say, whatever the manager's plan; `stochastic` too, with
    the habits, pace and mistakes of `Habits`; `attentive` looks where the robot looks, meets its eyes, and nods when
    it has spoken, says yes to a question, or does what it asks for; `party` is several people who talk among
    themselves, and answer what the robot asks them; `none` leaves the table alone.
    """

    human: HumanKind = "appendix-b"
    people: int = 2
    """Number of people of a `party`, 1 to 8."""
    seed: int = 0
    """Seed of the person's reaction times and of the faults of perception."""
    jitter: Seconds = 0.03
    """Greatest deviation of reaction times, either way. The scenario's order has room for 0.1 s."""
    entrance: Seconds = 0.0
    """Time from when all services of the robot are on the bus until the person comes."""
    frame: Seconds = 1 / 15
    """Time between two reports of the world while something moves, and of raw perception while the person sits there.
    Perception cameras give 10..30 reports per second."""
    perception: Literal["symbolic", "raw"] = "symbolic"
    """Kind of reports. `symbolic`: looks, speech and manipulations as such. `raw`: only the head's pose, the voice,
    hands and pieces, from which recognition derives the rest."""
    faults: PerceptionFaults = PerceptionFaults()
    """Faults of cameras and microphones."""
    reciprocity: Probability = 0.05
    """Step of the `stochastic` person's propensity for looks at the robot's face, which begins at 1: an answered look
    moves it toward 2, another toward 0. Our assumption, after hypothesis 11 of the thesis; 0: eye contact changes
    nothing, and the hypothesis must fail."""

    def __post_init__(self) -> None:
        positive(self, ("frame",), "simulation.")
        not_negative(self, ("entrance", "jitter"), "simulation.")
        shares(self, ("reciprocity",), "simulation.")
        if not 1 <= self.people <= len(NAMES):
            raise ValueError(f"simulation.people must be 1 to {len(NAMES)}, not {self.people}")
