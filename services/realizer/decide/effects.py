"""What is to be done: the realizer's decisions, as its shell carries them out."""

from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.decide.patience import Late, Stalled

Pace = tuple[tuple[str, Seconds], ...]
"""Sync points and their instants, by loop time, where a behavior's own pace would miss them. Empty: as is natural."""


class Begin(Struct, frozen=True):
    """Start `behavior`; it may go through `through` without asking. pace: see `Pace`; empty: as is natural."""

    behavior: str
    through: str
    pace: Pace = ()


class Extend(Struct, frozen=True):
    """`behavior` may now go through `through`, and is to come to its points as `pace` says."""

    behavior: str
    through: str
    pace: Pace = ()


Effect = Begin | Extend | Late | Stalled
