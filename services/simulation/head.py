"""Where a person's head is turned: toward what they look at, and on the way there past what lies between.

Pure; directions are unit vectors in the robot's frame.
"""

import math

from engage_hri.schemas.units import Seconds, Vector
from engage_hri.services.simulation.table import Table, minimum_jerk

ASIDE: Vector = (-0.3, 0.95, 0.1)
"""Toward nothing: past the robot's shoulder."""


class Sightlines:
    """From the eyes of the person at the table to what there is.

    robot: its actor id. robot_eyes: where the person looks who looks at it; above its origin until that is known.
    """

    def __init__(self, table: Table, robot: str) -> None:
        self._table = table
        self._robot = robot
        self.person = table.layout.person.id
        self.eyes = table.layout.person.face
        self.robot_eyes: Vector = (0.0, 0.0, self.eyes[2])

    def to(self, target: str, now: Seconds) -> Vector:
        """Direction of an entity; aside for what there is not. Who looks at the table looks where nothing lies."""
        place = self._places(now).get(target)
        return _toward(place, self.eyes) if place is not None else unit(ASIDE)

    def beside(self, target: str, now: Seconds) -> str:
        """What else is nearest to that, seen from here; what a look at it is taken for."""
        goal = self.to(target, now)
        others = {id: _toward(place, self.eyes) for id, place in self._places(now).items() if id != target}
        return min(others, key=lambda id: angle(others[id], goal))

    def _places(self, now: Seconds) -> dict[str, Vector]:
        surface = self._table.layout.surface
        pieces = {piece.id: piece.position for piece in self._table.pieces(now)}
        return {self._robot: self.robot_eyes, surface.id: surface.free, **pieces}


class SimulatedHead:
    """turning: how long it takes to face something else, however far it is."""

    def __init__(self, turning: Seconds) -> None:
        self._turning = turning
        self._from: Vector = (0.0, 0.0, 0.0)
        self._since: Seconds = -math.inf

    def turn(self, facing: Vector, now: Seconds) -> None:
        """Begin to turn away from `facing`."""
        self._from, self._since = facing, now

    def facing(self, goal: Vector, now: Seconds) -> Vector:
        """Where it points on its way to `goal`, which may move."""
        if now >= self._since + self._turning:
            return goal
        return _between(self._from, goal, minimum_jerk((now - self._since) / self._turning))


def unit(vector: Vector) -> Vector:
    """Raises ZeroDivisionError for one without length."""
    length = math.hypot(*vector)
    return (vector[0] / length, vector[1] / length, vector[2] / length)


def angle(one: Vector, other: Vector) -> float:
    """Radians between two unit vectors."""
    return math.acos(max(-1.0, min(1.0, sum(a * b for a, b in zip(one, other, strict=True)))))


def _toward(place: Vector, eyes: Vector) -> Vector:
    return unit((place[0] - eyes[0], place[1] - eyes[1], place[2] - eyes[2]))


def _between(one: Vector, other: Vector, part: float) -> Vector:
    """On the great circle from `one` to `other`."""
    whole = angle(one, other)
    if math.sin(whole) < 1e-6:  # no way to go, or no way that is the shortest
        return other
    first, second = math.sin((1.0 - part) * whole), math.sin(part * whole)
    x, y, z = (first * a + second * b for a, b in zip(one, other, strict=True))
    return unit((x, y, z))
