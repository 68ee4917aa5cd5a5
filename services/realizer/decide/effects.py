"""Decisions as values: what `Decisions.advance` says is to be done."""

from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.decide.lateness import Late, Stalled

Pace = tuple[tuple[str, Seconds], ...]
"""Sync points and their instants, by loop time, where the behavior's natural pace would miss them; else empty."""


class Begin(Struct, frozen=True):
    """Start `behavior`; it may go through `through` without asking."""

    behavior: str
    through: str
    pace: Pace = ()


class Extend(Struct, frozen=True):
    """Let `behavior` go through `through` now, and come to its points as `pace` says."""

    behavior: str
    through: str
    pace: Pace = ()


Effect = Begin | Extend | Late | Stalled
