"""Quantities with their units in the type, instants that name their clock, and checks of a configuration's numbers.

Each check is for a `__post_init__`, and raises ValueError with field and value. place: prefix of the field's name in
the message: `simulation.`.
"""

from collections.abc import Callable, Iterable
from math import isfinite
from typing import Annotated

from msgspec import Meta, Struct

Seconds = Annotated[float, Meta(description="seconds")]
A_DAY = 86_400.0
Duration = Annotated[float, Meta(ge=0, le=A_DAY, description="seconds")]
"""Seconds that something takes: 0 to one day."""
Radians = Annotated[float, Meta(description="radians")]
Degrees = Annotated[float, Meta(description="degrees")]
Meters = Annotated[float, Meta(description="metres")]
Probability = Annotated[float, Meta(ge=0, le=1, description="0..1")]

FARTHEST = 1e6
"""Metres to the farthest place; geometry fails with larger numbers, and with nan."""
Coordinate = Annotated[float, Meta(ge=-FARTHEST, le=FARTHEST)]
Extent = Annotated[float, Meta(ge=0, le=FARTHEST, description="metres")]
Heading = Annotated[float, Meta(ge=-FARTHEST, le=FARTHEST, description="radians")]
Named = Annotated[str, Meta(min_length=1)]
Vector = tuple[Coordinate, Coordinate, Coordinate]
"""Metres: x ahead of the robot, y to its left, z up; origin on the floor below the robot.

A message whose vector has a part beyond `FARTHEST`, or one that is no number, is refused where it is decoded.
"""


def plus(one: Vector, other: Vector) -> Vector:
    """Sum of two vectors."""
    return (one[0] + other[0], one[1] + other[1], one[2] + other[2])


def minus(one: Vector, other: Vector) -> Vector:
    """Difference of two vectors: the way from the other to the one."""
    return (one[0] - other[0], one[1] - other[1], one[2] - other[2])


def times(vector: Vector, factor: float) -> Vector:
    """The vector, as many times as long."""
    return (vector[0] * factor, vector[1] * factor, vector[2] * factor)


def between(start: Vector, end: Vector, share: float) -> Vector:
    """Place on the straight way from `start` to `end`, after a share of it."""
    return plus(start, times(minus(end, start), share))


LATEST = 1e12
"""Seconds: the latest instant of any clock, in some 30 000 years."""


class Stamp(Struct, frozen=True, array_like=True):
    """An instant on a named clock. Instants of different clocks compare only through `Bus.local`.

    A message with an instant that is not finite is refused where it is decoded: such an instant is neither before nor
    after another, and waiting for it would never end.
    """

    clock: str
    seconds: Annotated[float, Meta(ge=-LATEST, le=LATEST, description="seconds")]


def span(seconds: Seconds) -> str:
    """Write a time in days, in hours if it is below two days, or in minutes if it is below two hours."""
    minutes = round(seconds / 60)
    if minutes >= 2880:
        return f"{round(minutes / 60) // 24} days"
    if minutes >= 120:
        return f"{round(minutes / 60)} hours"
    return f"{minutes} minutes" if minutes > 1 else "a minute"


def positive(config: object, names: Iterable[str], place: str = "") -> None:
    _require(config, names, place, lambda value: value > 0, "be positive")


def not_negative(config: object, names: Iterable[str], place: str = "") -> None:
    _require(config, names, place, lambda value: value >= 0, "not be negative")


def shares(config: object, names: Iterable[str], place: str = "") -> None:
    _require(config, names, place, lambda value: 0 <= value <= 1, "be in 0..1")


def inner_shares(config: object, names: Iterable[str], place: str = "") -> None:
    """Require numbers between 0 and 1, without the two ends."""
    _require(config, names, place, lambda value: 0 < value < 1, "be in (0, 1)")


def _require(config: object, names: Iterable[str], place: str, holds: Callable[[float], bool], rule: str) -> None:
    for name in names:
        value = getattr(config, name)
        if not isfinite(value):
            raise ValueError(f"{place}{name} must be a finite number, not {value}")
        if not holds(value):
            raise ValueError(f"{place}{name} must {rule}, not {value}")
