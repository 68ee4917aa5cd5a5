"""Where a look comes to rest whose trunk is going to be elsewhere: on the same place."""

import pytest

from engage_hri.schemas.units import Vector
from engage_hri.services.control.figure.course import Aim, Course, Trunk
from engage_hri.services.control.figure.head import NECK, going_to

PLACES: list[Vector] = [(0.7, 0.2, 0.9), (1.0, -0.3, 1.2), (0.6, 0.0, 0.8)]
TRUNKS: list[Trunk] = [(0.0, 0.0), (0.25, 0.0), (-0.2, 0.1), (0.1, -0.05)]


def look(target: Vector, trunk: Trunk) -> Course:
    aim = Aim(target=target, trunk=trunk)
    on_target = dict(zip(NECK, aim.angles(trunk), strict=True))
    return Course(parts=("head",), joints=NECK, legs=(), points=(), on_target=on_target, aim=aim)


@pytest.mark.parametrize("there", TRUNKS)
@pytest.mark.parametrize("here", TRUNKS)
@pytest.mark.parametrize("target", PLACES)
def test_a_look_goes_to_the_same_place_from_another_place_of_the_trunk(
    target: Vector, here: Trunk, there: Trunk
) -> None:
    expected = Aim(target=target, trunk=there).angles(there)

    assert going_to(look(target, here), look((1.0, 0.0, 1.2), there)) == pytest.approx(expected)
