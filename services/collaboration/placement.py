"""When a piece has been laid down anew. Pure."""

import math
from collections.abc import Iterable

from engage_hri.schemas.units import Meters, Radians
from engage_hri.schemas.world import Entity

MOVED: Meters = 0.015
TURNED: Radians = math.radians(10.0)
RESTING = 0.01
"""m/s"""
TRUSTED = 0.5
"""Least confidence in a piece that is really seen."""


def is_moving(piece: Entity) -> bool:
    return math.hypot(*piece.velocity) > RESTING


def has_been_placed(piece: str, before: Iterable[Entity], now: Iterable[Entity]) -> bool:
    """Does the piece rest where, or how, it did not lie `before`? False while it is not seen."""
    old = next((entity for entity in before if entity.id == piece), None)
    new = next((entity for entity in now if entity.id == piece), None)
    if new is None or is_moving(new) or new.confidence < TRUSTED:
        return False
    if old is None:
        return True
    turned = abs(math.remainder(new.yaw - old.yaw, math.tau))
    return math.dist(new.position, old.position) > MOVED or turned > TURNED
