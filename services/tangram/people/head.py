"""Head of a simulated person: turned toward the target of its look, or on the way there.

Pure; directions are unit vectors in the robot's frame.
"""

import math

from engage_hri.schemas.units import Seconds, Vector, minus
from engage_hri.services.tangram.people.table import Table, minimum_jerk

ASIDE: Vector = (-0.3, 0.95, 0.1)
"""Direction of a look at nothing: past the robot's shoulder."""


class Sightlines:
    """Directions from the eyes of the person at the table to the robot, the table and the pieces.

    robot: its actor id. robot_eyes: place of its eyes; above its origin until the place is known.
    """

    def __init__(self, table: Table, robot: str) -> None:
        self._table = table
        self._robot = robot
        self.person = table.layout.person.id
        self.eyes = table.layout.person.face
        self.robot_eyes: Vector = (0.0, 0.0, self.eyes[2])

    def to(self, target: str, now: Seconds) -> Vector:
        """Direction of an entity; `ASIDE` if it is unknown. That of the table is a spot where nothing lies."""
        place = self._places(now).get(target)
        return _toward(place, self.eyes) if place is not None else unit(ASIDE)

    def beside(self, target: str, now: Seconds) -> str:
        """Id of the entity that appears nearest to `target`, and so may be taken for it."""
        goal = self.to(target, now)
        others = {id: _toward(place, self.eyes) for id, place in self._places(now).items() if id != target}
        return min(others, key=lambda id: angle(others[id], goal))

    def _places(self, now: Seconds) -> dict[str, Vector]:
        surface = self._table.layout.surface
        pieces = {piece.id: piece.position for piece in self._table.pieces(now)}
        return {self._robot: self.robot_eyes, surface.id: surface.free, **pieces}


class SimulatedHead:
    """A head that turns. turning: time that it takes to face another target, however far that is."""

    def __init__(self, turning: Seconds) -> None:
        self._turning = turning
        self._from: Vector = (0.0, 0.0, 0.0)
        self._since: Seconds = -math.inf

    def turn(self, facing: Vector, now: Seconds) -> None:
        """Begin to turn away from `facing`."""
        self._from, self._since = facing, now

    def facing(self, goal: Vector, now: Seconds) -> Vector:
        """Direction of the head on its way to `goal`, which may move."""
        if now >= self._since + self._turning:
            return goal
        return _between(self._from, goal, minimum_jerk((now - self._since) / self._turning))


def unit(vector: Vector) -> Vector:
    """The unit vector in the same direction. Raises ZeroDivisionError if the length is 0."""
    length = math.hypot(*vector)
    return (vector[0] / length, vector[1] / length, vector[2] / length)


def angle(one: Vector, other: Vector) -> float:
    """Radians between two unit vectors."""
    return math.acos(max(-1.0, min(1.0, sum(a * b for a, b in zip(one, other, strict=True)))))


def _toward(place: Vector, eyes: Vector) -> Vector:
    return unit(minus(place, eyes))


def _between(one: Vector, other: Vector, part: float) -> Vector:
    """Direction on the great circle from `one` to `other`, after `part` of the way."""
    whole = angle(one, other)
    if math.sin(whole) < 1e-6:  # no way to go, or no way that is the shortest
        return other
    first, second = math.sin((1.0 - part) * whole), math.sin(part * whole)
    x, y, z = (first * a + second * b for a, b in zip(one, other, strict=True))
    return unit((x, y, z))
