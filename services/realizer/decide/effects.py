"""Decisions as values: what `Decisions.advance` says is to be done."""

from msgspec import Struct

from engage_hri.services.realizer.decide.lateness import Late, Stalled
from engage_hri.services.realizer.foresee.expectations import Pace


class Begin(Struct, frozen=True):
    """Start `behavior`; it may go through `through` without asking."""

    behavior: str
    through: str
    pace: Pace = ()


class Extend(Struct, frozen=True):
    """Let `behavior` go through `through` now, and come to its points as `pace` says.

    held: wait where it next can, whatever `through` says.
    """

    behavior: str
    through: str
    pace: Pace = ()
    held: bool = False


Effect = Begin | Extend | Late | Stalled
