"""Hands move pieces smoothly, and nothing jumps."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.tables import PiecePose
from engage_hri.services.tangram.people.table import PieceRested, Table
from engage_hri.services.tangram.table import tangram_table


def table() -> Table:
    return Table(tangram_table(), hand_speed=0.5, shortest_movement=0.6)


def test_a_piece_lies_where_it_was_laid() -> None:
    scene = table()

    end = scene.carry("blue-square", PiecePose(0.48, 0.0, 90.0), 1.0)
    rested = scene.settle(end)

    lies = scene.piece("blue-square", end + 1.0)
    assert rested == [PieceRested("blue-square", end)]
    assert lies.position == pytest.approx((0.48, 0.0, 0.72))
    assert math.degrees(lies.yaw) == pytest.approx(90.0)
    assert lies.velocity == (0.0, 0.0, 0.0)


def test_reaching_moves_the_hand_but_not_the_piece() -> None:
    scene = table()
    before = scene.piece("blue-square", 0.0)

    end = scene.reach("blue-square", 0.0)

    assert scene.settle(end) == []
    assert scene.piece("blue-square", end) == before
    assert math.dist(scene.hand("left", end)[:2], before.position[:2]) == pytest.approx(0.0)


def test_a_far_movement_takes_longer_than_a_near_one() -> None:
    near = table().carry("blue-square", PiecePose(0.55, -0.2), 0.0)
    far = table().carry("blue-square", PiecePose(0.40, 0.39), 0.0)

    assert near == 0.6
    assert far == pytest.approx(math.hypot(0.16, 0.60) / 0.5)


def test_the_person_and_their_hands_are_seen_only_while_they_sit_there() -> None:
    scene = table()
    assert {entity.kind for entity in scene.entities(0.0)} == {"object", "surface"}

    scene.seated = True

    assert {entity.id for entity in scene.entities(0.0) if entity.owner == "human"} == {
        "human-left-hand",
        "human-right-hand",
    }


def test_an_unknown_piece_is_an_error() -> None:
    with pytest.raises(KeyError, match="hexagon"):
        table().reach("hexagon", 0.0)


@settings(max_examples=50)
@given(st.floats(0.35, 0.75), st.floats(-0.4, 0.4), st.floats(-180, 180), st.integers(1, 60))
def test_velocity_is_the_derivative_of_position(x: float, y: float, yaw: float, part: int) -> None:
    scene = table()
    end = scene.carry("red-square", PiecePose(x, y, yaw), 0.0)
    now, step = end * part / 61, 1e-6

    before, piece, after = (scene.piece("red-square", at) for at in (now - step, now, now + step))

    slope = [(b - a) / (2 * step) for a, b in zip(before.position, after.position, strict=True)]
    assert piece.velocity == pytest.approx(slope, abs=1e-3)
