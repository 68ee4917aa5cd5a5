"""Faults between the table as it is and the table as it is seen (thesis 5.4.2).

Pure. Each fault has its own source of chance, given from outside: turning one on does not change the others.
"""

import math
from collections.abc import Callable, Iterable

from msgspec.structs import replace

from engage_hri.schemas.units import Seconds, Vector
from engage_hri.schemas.world import Entity
from engage_hri.services.simulation.chance import Chance
from engage_hri.services.tangram.people.config import PerceptionFaults
from engage_hri.services.tangram.people.head import unit

FAINT = 0.3
"""Confidence in a covered thing, reported where it was seen last."""
Chances = Callable[[str], Chance]
"""Function from a name to a source of chance of its own."""


class FaceLoss:
    """Losses of the face by the tracker. Times must not go backward."""

    def __init__(self, faults: PerceptionFaults, chance: Chance) -> None:
        self._faults = faults
        self._chance = chance
        self._since: Seconds = math.inf
        self._until: Seconds = -math.inf

    def begin(self, now: Seconds) -> None:
        """Begin with a face that is there from now on."""
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
    """View of the things on the table by a camera, which remembers where it has last seen each."""

    def __init__(self, faults: PerceptionFaults, chance: Chance) -> None:
        self._faults = faults
        self._chance = chance
        self._seen: dict[str, Entity] = {}

    def see(self, entities: Iterable[Entity]) -> tuple[Entity, ...]:
        """The entities as the camera reports them in one frame."""
        things = tuple(entities)
        hands = [thing.position for thing in things if thing.kind == "hand"]
        return tuple(seen for thing in things if (seen := self._piece(thing, hands)) is not None)

    def _piece(self, thing: Entity, hands: list[Vector]) -> Entity | None:
        if thing.kind != "object":
            return thing
        if any(math.dist(hand[:2], thing.position[:2]) < self._faults.occlusion for hand in hands):
            last = self._seen.get(thing.id)
            return replace(last, confidence=FAINT) if last and self._faults.covered == "faint" else None
        seen = self._seen[thing.id] = self._mismeasured(thing)
        return seen

    def _mismeasured(self, piece: Entity) -> Entity:
        if not self._faults.position and not self._faults.yaw:
            return piece
        x, y, z = piece.position
        x += self._chance.gauss(0.0, self._faults.position)
        y += self._chance.gauss(0.0, self._faults.position)
        turned = math.radians(self._chance.gauss(0.0, self._faults.yaw))
        return replace(piece, position=(x, y, z), yaw=math.remainder(piece.yaw + turned, math.tau))


def deviated(direction: Vector, deviation: float, chance: Chance) -> Vector:
    """A unit vector near `direction`. deviation: standard deviation about each axis across it, in radians."""
    if not deviation:
        return direction
    x, y, z = (part + chance.gauss(0.0, deviation) for part in direction)
    return unit((x, y, z))
