"""Distractor sets from rays: the cone test against the conic on the table, the half-cylinder, corners and edges."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas.body import NoPointZone, Ray
from engage_hri.schemas.world import Entity
from engage_hri.services.generation.references.pairs import (
    angle_off_axis,
    in_zone,
    laid_out,
)
from tests.generation.tables import in_gaze_cone, in_pointing_cylinder

DOWN = Ray(origin=(0.0, 0.0, 1.0), axis=(0.0, 0.0, -1.0))
"""Straight down on a table at height 0: the cone cuts a circle of radius tan(half-angle)."""


def thing(id: str, x: float, y: float, **fields: object) -> Entity:
    return Entity(id=id, kind="object", position=(x, y, 0.0), **fields)  # type: ignore[arg-type]


def test_an_object_is_in_the_cone_when_its_centre_is() -> None:
    objects = [thing("in", 0.09, 0.0), thing("out", 0.11, 0.0)]

    assert in_gaze_cone(DOWN, math.atan(0.1), laid_out(objects)) == {"in"}


def test_an_object_is_in_the_cone_when_one_corner_is() -> None:
    square = ((0.03, 0.03), (-0.03, 0.03), (-0.03, -0.03), (0.03, -0.03))
    straight = thing("straight", 0.125, 0.0, footprint=square)
    corner_first = thing("turned", 0.0, 0.135, footprint=square, yaw=math.pi / 4)
    edge_first = thing("not-turned", 0.0, -0.135, footprint=square)

    assert in_gaze_cone(DOWN, math.atan(0.1), laid_out([straight, corner_first, edge_first])) == {
        "straight",
        "turned",
    }


def test_what_lies_behind_the_eyes_is_outside() -> None:
    above = Entity(id="lamp", kind="object", position=(0.0, 0.0, 2.0))

    assert in_gaze_cone(DOWN, 0.5, laid_out([above])) == frozenset()


@given(
    st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.2, 1.2), st.floats(0.05, 0.3), st.floats(0.05, 0.6)
)  # fmt: skip
def test_the_cone_test_is_the_conic_section(
    x: float, y: float, tilt: float, half_angle: float, height: float
) -> None:
    """On the table the cone's edge is where along^2 = distance^2 cos^2: a quadratic in x and y."""
    axis = (math.sin(tilt), 0.0, -math.cos(tilt))
    eyes = Ray(origin=(0.0, 0.0, height), axis=axis)
    along = x * axis[0] - height * axis[2]
    conic = along**2 - (x * x + y * y + height * height) * math.cos(half_angle) ** 2
    if abs(conic) < 1e-6:  # on the edge itself either is right
        return

    assert bool(in_gaze_cone(eyes, half_angle, laid_out([thing("o", x, y)]))) == (along > 0 and conic > 0)


def test_the_cylinder_begins_at_the_hand_and_grows_by_the_object() -> None:
    forearm = Ray(origin=(0.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0), tip=(0.3, 0.0, 0.0))
    objects = [
        thing("behind the hand", 0.2, 0.0),
        thing("just behind the hand", 0.299, 0.0),
        thing("at the hand", 0.3, 0.04),
        thing("just ahead of the hand", 0.301, 0.0),
        thing("ahead", 0.5, 0.04),
        thing("beside", 0.5, 0.08),
        thing("large", 0.5, -0.08, radius=0.03),
        thing("far ahead", 3.0, 0.0),
    ]

    assert in_pointing_cylinder(forearm, 0.05, laid_out(objects)) == {
        "at the hand",
        "just ahead of the hand",
        "ahead",
        "large",
        "far ahead",
    }


def test_without_a_radius_the_footprint_tells_how_large_an_object_is() -> None:
    assert thing("o", 0.0, 0.0, footprint=((0.03, 0.04), (-0.01, 0.0))).extent == pytest.approx(0.05)
    assert thing("o", 0.0, 0.0, footprint=((0.03, 0.04),), radius=0.2).extent == 0.2


def test_no_objects_no_distractors() -> None:
    assert in_gaze_cone(DOWN, 0.1, laid_out([])) == in_pointing_cylinder(DOWN, 0.1, laid_out([])) == frozenset()


def test_a_zone_ends_at_its_radius() -> None:
    zone = NoPointZone(center=(1.0, 0.0, 1.0), radius=0.2)

    assert in_zone((1.2, 0.0, 1.0), [zone])
    assert not in_zone((1.21, 0.0, 1.0), [zone])


def test_the_angle_off_the_axis_is_that_between_two_directions() -> None:
    assert angle_off_axis(DOWN, (1.0, 0.0, 0.0)) == pytest.approx(math.pi / 4)
    assert angle_off_axis(DOWN, DOWN.origin) == 0.0
