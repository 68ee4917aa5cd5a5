"""Quantities with their units in the type, and instants that say whose clock they were read from."""

from typing import Annotated

from msgspec import Meta, Struct

Seconds = Annotated[float, Meta(description="seconds")]
Radians = Annotated[float, Meta(description="radians")]
Degrees = Annotated[float, Meta(description="degrees")]
Meters = Annotated[float, Meta(description="metres")]
Probability = Annotated[float, Meta(ge=0, le=1, description="0..1")]

Vector = tuple[float, float, float]
"""Metres: x ahead of the robot, y to its left, z up; origin on the floor below the robot."""


class Stamp(Struct, frozen=True, array_like=True):
    """An instant, on a named clock. Instants of different clocks compare only through `Bus.local`."""

    clock: str
    seconds: Seconds
