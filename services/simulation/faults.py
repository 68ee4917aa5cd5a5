"""What goes wrong between the table as it is and the table as it is seen (thesis 5.4.2).

Pure. Chance comes from outside, a source of its own for each fault: turning one on does not change the others.
"""

import math
from collections.abc import Callable, Iterable

from msgspec.structs import replace

from engage_hri.schemas.units import Seconds, Vector
from engage_hri.schemas.world import Entity
from engage_hri.services.simulation.chance import Chance
from engage_hri.services.simulation.config import PerceptionFaults
from engage_hri.services.simulation.head import unit

FAINT = 0.3
"""Confidence in a thing that is where it was seen last, covered now."""


Chances = Callable[[str], Chance]
"""A source of chance for each name."""


class FaceLoss:
    """When the tracker has lost the face. Ask with times that do not go backward."""

    def __init__(self, faults: PerceptionFaults, chance: Chance) -> None:
        self._faults = faults
        self._chance = chance
        self._since: Seconds = math.inf
        self._until: Seconds = -math.inf

    def begin(self, now: Seconds) -> None:
        """A face is there from now on."""
        self._plan(now)

    def lost(self, now: Seconds) -> bool:
        while now >= self._until and now >= self._since:
            self._plan(self._until)
        return now >= self._since

    def _plan(self, after: Seconds) -> None:
        if self._faults.lost_faces:
            self._since = after + self._chance.expovariate(self._faults.lost_faces / 60.0)
            self._until = self._since + self._chance.uniform(*self._faults.lost_for)


class TableVision:
    """The things on the table as a camera sees them. It keeps in mind where it has seen them."""

    def __init__(self, faults: PerceptionFaults, chance: Chance) -> None:
        self._faults = faults
        self._chance = chance
        self._seen: dict[str, Entity] = {}

    def see(self, entities: Iterable[Entity]) -> tuple[Entity, ...]:
        """What the camera makes of them in one frame."""
        things = tuple(entities)
        hands = [thing.position for thing in things if thing.kind == "hand"]
        return tuple(seen for thing in things if (seen := self._piece(thing, hands)) is not None)

    def _piece(self, thing: Entity, hands: list[Vector]) -> Entity | None:
        if thing.kind != "object":
            return thing
        if any(math.dist(hand[:2], thing.position[:2]) < self._faults.occlusion for hand in hands):
            last = self._seen.get(thing.id)
            return replace(last, confidence=FAINT) if last and self._faults.covered == "faint" else None
        seen = self._seen[thing.id] = self._misjudged(thing)
        return seen

    def _misjudged(self, piece: Entity) -> Entity:
        if not self._faults.position and not self._faults.yaw:
            return piece
        x, y, z = piece.position
        x += self._chance.gauss(0.0, self._faults.position)
        y += self._chance.gauss(0.0, self._faults.position)
        turned = math.radians(self._chance.gauss(0.0, self._faults.yaw))
        return replace(piece, position=(x, y, z), yaw=math.remainder(piece.yaw + turned, math.tau))


def off_by(direction: Vector, deviation: float, chance: Chance) -> Vector:
    """A unit vector near `direction`. deviation: radians, standard, about each axis across it."""
    if not deviation:
        return direction
    x, y, z = (part + chance.gauss(0.0, deviation) for part in direction)
    return unit((x, y, z))
