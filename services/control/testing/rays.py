"""Angles and distances between rays and points. Pure."""

import math

from engage_hri.schemas.body import Ray
from engage_hri.schemas.units import Meters, Radians, Vector


def aside(ray: Ray, point: Vector) -> Radians:
    """Angle between a ray and the direction from its origin to a point."""
    way = [there - here for here, there in zip(ray.origin, point, strict=True)]
    along = sum(a * b for a, b in zip(ray.axis, way, strict=True))
    return math.acos(max(-1.0, min(1.0, along / math.hypot(*way))))


def angle(one: Vector, other: Vector) -> Radians:
    """Angle between two unit vectors."""
    return math.acos(max(-1.0, min(1.0, sum(a * b for a, b in zip(one, other, strict=True)))))


def beside(ray: Ray, point: Vector) -> Meters:
    """Distance by which a point lies beside a ray; inf behind it."""
    way = [there - here for here, there in zip(ray.origin, point, strict=True)]
    along = sum(a * b for a, b in zip(ray.axis, way, strict=True))
    return math.sqrt(max(0.0, sum(each * each for each in way) - along * along)) if along > 0 else math.inf
