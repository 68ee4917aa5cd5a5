"""How the simulated human and table behave."""

from typing import Literal

from msgspec import Struct

from schemas.units import Meters, Seconds

HumanKind = Literal["scripted", "misplacing", "listening", "none"]


class SimulationConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """human: `scripted` follows Appendix B by the ids of the robot's blocks; `misplacing` does too, but lays one
    piece wrongly; `listening` does what the robot's words say, whatever the manager's plan; `none` leaves the
    table alone.
    """

    human: HumanKind = "scripted"
    seed: int = 0
    """Of the person's reaction times."""
    jitter: Seconds = 0.03
    """Reaction times vary by up to this, either way. The scenario's order has room for 0.1 s."""
    await_participants: tuple[str, ...] = ("control", "generation", "realizer", "recognition")
    """The person comes when these are on the bus. Their services may start in any order, hours apart."""
    entrance: Seconds = 1.0
    """From then until the person comes."""
    frame: Seconds = 1 / 15
    """Between two reports of the world while something moves. Perception cameras give 10..30 per second."""
    hand_speed: Meters = 0.45
    """m/s, mean over a movement. Unhurried reaching at a table is about 0.4..0.8 m/s."""
    shortest_movement: Seconds = 0.6
    """A hand's movement takes at least this."""

    def __post_init__(self) -> None:
        for name in ("frame", "hand_speed", "shortest_movement"):
            if getattr(self, name) <= 0:
                raise ValueError(f"simulation.{name} must be positive, not {getattr(self, name)}")
        for name in ("entrance", "jitter"):
            if getattr(self, name) < 0:
                raise ValueError(f"simulation.{name} must not be negative, not {getattr(self, name)}")
