"""Configuration of the collaboration manager: how it plays the tangram."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.ranges import inner_shares, not_negative
from engage_hri.schemas.units import Probability, Seconds


class CollaborationConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The section `collaboration`. mode: `scripted` plays Appendix B; `task` chooses pieces and words itself."""

    mode: Literal["scripted", "task"] = "scripted"
    placement: Seconds = 15.0
    """Time that the person has to place a piece before the robot asks again."""
    attempts: int = 3
    """Number of times that the robot asks for one placement before it goes on without."""
    steady: Seconds = 0.5
    """Time that a piece must rest in view, with no hand over it, before the robot believes where it lies."""
    patience: Seconds = 2.0
    """Time that the robot waits for a hand to go away before it judges what lies where."""
    settle: Seconds = 0.75
    """Time from when a placement is seen until the robot speaks: the person looks up, and the robot looks back."""
    pause: Seconds = 0.4
    """Time between two turns of the robot."""
    thinking: Seconds = 1.0
    """Time between "Ummmm," and "good."."""
    arrival: Seconds = 4.0
    """Time from when a person is seen until the robot greets them."""
    farewell: Seconds = 15.0
    """Time that the robot waits for the person to leave after its goodbye."""
    piece_reliability: Probability = 0.95
    """Least reliability of a reference to the piece to move, and to the trapezoid when introduced. Scenario page."""
    landmark_reliability: Probability = 0.85
    """Least reliability of a reference to a landmark, and to the rectangle when introduced."""

    def __post_init__(self) -> None:
        times = ("placement", "steady", "patience", "settle", "pause", "thinking", "arrival", "farewell")
        not_negative(self, times, "collaboration.")
        if self.attempts < 1:
            raise ValueError(f"collaboration.attempts must be at least 1, not {self.attempts}")
        inner_shares(self, ("piece_reliability", "landmark_reliability"), "collaboration.")
