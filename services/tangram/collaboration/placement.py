"""Test of whether a piece has been laid down anew. Pure."""

import math
from collections.abc import Iterable

from engage_hri.schemas.units import Meters, Radians
from engage_hri.schemas.world import Entity

MOVED: Meters = 0.015
TURNED: Radians = math.radians(10.0)
RESTING = 0.01
"""Metres per second: a piece that is faster is moving."""
TRUSTED = 0.5
"""Least confidence of a piece that counts as seen."""


def is_moving(piece: Entity) -> bool:
    return math.hypot(*piece.velocity) > RESTING


def has_been_placed(piece: str, before: Iterable[Entity], now: Iterable[Entity]) -> bool:
    """True if the piece rests at another place, or turned otherwise, than `before`. False while it is not seen."""
    old = next((entity for entity in before if entity.id == piece), None)
    new = next((entity for entity in now if entity.id == piece), None)
    if new is None or is_moving(new) or new.confidence < TRUSTED:
        return False
    if old is None:
        return True
    turned = abs(math.remainder(new.yaw - old.yaw, math.tau))
    return math.dist(new.position, old.position) > MOVED or turned > TURNED
