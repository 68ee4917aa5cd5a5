"""Rays that are not known exactly: what they may be mistaken for grows with their error, and the choice with it."""

import math
from random import Random

import numpy as np
import pytest

from engage_hri.schemas.body import Ray
from engage_hri.schemas.world import Entity
from engage_hri.services.generation.references.pairs import laid_out
from tests.generation.tables import in_gaze_cone, in_pointing_cylinder
from tests.random_cases import share_of

EYES = Ray(origin=(0.0, 0.0, 1.0), axis=(0.0, 0.0, -1.0))
ARM = Ray(origin=(0.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0), tip=(0.25, 0.0, 0.0))


def thing(id: str, x: float, y: float, radius: float = 0.0) -> Entity:
    return Entity(id=id, kind="object", position=(x, y, 0.0), radius=radius)


def test_a_gaze_of_an_error_has_as_much_wider_a_cone() -> None:
    objects = laid_out([thing("near", 0.09, 0.0), thing("between", 0.15, 0.0), thing("far", 0.21, 0.0)])
    angle = math.atan(0.1)
    wider = Ray(origin=EYES.origin, axis=EYES.axis, error=math.atan(0.2) - angle)

    assert in_gaze_cone(EYES, angle, objects) == {"near"}
    assert in_gaze_cone(wider, angle, objects) == {"near", "between"}


def test_a_forearm_of_an_error_has_a_cylinder_that_widens_from_the_elbow() -> None:
    error = math.atan(0.1)
    wide = Ray(origin=ARM.origin, axis=ARM.axis, tip=ARM.tip, error=error)
    objects = laid_out([thing("inside", 0.5, 0.099), thing("outside", 0.5, 0.101), thing("farther", 0.9, 0.101)])

    assert in_pointing_cylinder(ARM, 0.05, objects) == frozenset()
    assert in_pointing_cylinder(wide, 0.05, objects) == {"inside", "farther"}
    assert in_pointing_cylinder(wide, 0.05, laid_out([thing("behind the hand", 0.2, 0.0)])) == frozenset()


@pytest.mark.parametrize("seed", range(share_of(20)))
def test_it_holds_whatever_an_arm_within_the_error_points_at(seed: int) -> None:
    """Oracle: arms turned at random within the error, each with a cylinder of its own."""
    chance = Random(seed)
    error, radius = math.radians(chance.uniform(0.5, 10.0)), 0.05
    objects = laid_out([thing(str(n), chance.uniform(0.3, 1.2), chance.uniform(-0.4, 0.4), 0.02) for n in range(60)])
    wide = in_pointing_cylinder(Ray(origin=ARM.origin, axis=ARM.axis, tip=ARM.tip, error=error), radius, objects)
    for _ in range(200):
        off, around = error * math.sqrt(chance.random()), chance.uniform(0.0, math.tau)
        axis = (math.cos(off), math.sin(off) * math.cos(around), math.sin(off) * math.sin(around))
        tip = tuple((0.25 * np.array(axis)).tolist())
        assert in_pointing_cylinder(Ray(origin=ARM.origin, axis=axis, tip=tip), radius, objects) <= wide  # type: ignore[arg-type]
    assert in_pointing_cylinder(ARM, radius, objects) <= wide
