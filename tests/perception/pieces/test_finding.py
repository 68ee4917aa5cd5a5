"""Pieces in drawn pictures of a table: where they lie, in any light, under a hand; what is not there is not told."""

import math
from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest

from engage_hri.services.perception.eyes.camera import StatedCamera
from engage_hri.services.perception.pieces.finding import FlatTable, PieceFinder, learned
from engage_hri.services.perception.pieces.spotting import SpottedPiece
from tests.perception.pieces.appendix_a import relations
from tests.perception.pieces.tables import (
    EYE,
    GOALS,
    STARTS,
    TABLE,
    Eye,
    Hand,
    Light,
    Picture,
    Pose,
    drawn,
    layout,
)

ALIKE = {form.id: form.turns_alike for form in TABLE.pieces}


@cache
def flat(eye: Eye = EYE) -> FlatTable:
    camera = StatedCamera(eye.field, eye.at, -eye.down, eye.left, eye.lean)
    return FlatTable(TABLE, camera, eye.width, eye.height)


def finder(eye: Eye = EYE) -> PieceFinder:
    return PieceFinder(TABLE, flat(eye), learned(drawn(STARTS, eye, seed=99), TABLE, flat(eye)))


def found(picture: Picture) -> dict[str, SpottedPiece]:
    return {piece.id: piece for piece in finder().find(picture).pieces}


def beside(pieces: Mapping[str, SpottedPiece], truth: Mapping[str, Pose]) -> float:
    """Largest distance of a piece from where it lies, millimetres; and none is turned by 3 degrees."""
    for id, piece in pieces.items():
        assert abs(math.remainder(piece.yaw - truth[id][2], math.tau / ALIKE[id])) < math.radians(3), id
    return 1000 * max(math.dist((piece.x, piece.y), truth[id][:2]) for id, piece in pieces.items())


@pytest.mark.parametrize("light", [Light(1.0, 4), Light(1.5, 20), Light(0.45, 20)], ids=str)
def test_all_pieces_are_found_to_millimetres_in_any_light(light: Light):
    truth = layout(np.random.default_rng(7))
    pieces = found(drawn(truth, light=light, seed=7))

    assert {*pieces} == {*truth}
    assert beside(pieces, truth) < 3


def test_another_camera_sees_the_same():
    eye = Eye(at=(0.1, 0.15, 1.45), down=52, left=-7, lean=4, field=62)
    pieces = {piece.id: piece for piece in finder(eye).find(drawn(GOALS, eye, seed=3)).pieces}

    assert {*pieces} == {*GOALS}
    assert beside(pieces, GOALS) < 2


def test_the_stated_spread_is_honest():
    """Of 30 pieces half and more lie within one deviation, and nearly all within three."""
    shares = []
    for number in range(3):
        truth = layout(np.random.default_rng(number))
        pieces = found(drawn(truth, light=Light(1.0, 15), seed=number))
        shares += [math.dist((each.x, each.y), truth[id][:2]) / each.spread for id, each in pieces.items()]

    assert len(shares) > 28
    assert 0.4 < np.mean(np.array(shares) < 1) < 0.95
    assert np.mean(np.array(shares) < 3) > 0.93


def test_a_hand_hides_what_is_under_it_and_nothing_else():
    looks, light, hand = finder(), Light(1.0, 8), Hand((0.52, 0.0), 0.2, 1)
    looks.find(drawn(GOALS, light=light, seed=2))
    seen = looks.find(drawn(GOALS, light=light, hands=[hand], seed=2, take=1))
    pieces = {piece.id: piece for piece in seen.pieces}

    hidden = {*GOALS} - {*pieces}
    assert {"rectangle", "blue-square"} & hidden
    assert len(hidden) < 6
    assert all(math.dist(GOALS[id][:2], hand.at) < 0.25 for id in hidden)
    assert beside(pieces, GOALS) < 3


def test_a_place_that_a_hand_covers_is_not_bare_and_one_from_which_a_piece_was_taken_is():
    looks, left = finder(), {id: pose for id, pose in STARTS.items() if id != "green-square"}
    looks.find(drawn(STARTS, seed=4))
    hidden = looks.find(drawn(STARTS, hands=[Hand(STARTS["green-square"][:2], 0.0, 2)], seed=4))
    taken = looks.find(drawn(left, seed=4))

    assert hidden.bare == ()
    assert taken.bare == ("green-square",)


def test_on_an_empty_table_nothing_lies_and_a_hand_is_no_piece():
    looks = finder()

    assert looks.find(drawn({}, light=Light(1.2, 15), seed=5)).pieces == ()
    for skin in range(4):
        assert looks.find(drawn({}, hands=[Hand((0.6, 0.1), 0.3, skin)], seed=skin)).pieces == ()


def test_two_pieces_of_one_color_that_touch_are_two():
    x, y, turn = GOALS["pink-square"]
    c, s = math.cos(turn), math.sin(turn)
    apart = 0.02475 + 0.01167  # from the middle of the square to its side, and from there to that of the triangle
    truth = GOALS | {"pink-triangle": (x + c * apart, y + s * apart, turn + math.pi)}
    short = {id: pose for id, pose in truth.items() if id.startswith("pink")}
    pieces = found(drawn(short, seed=6))

    assert {*pieces} == {*short}
    assert beside(pieces, short) < 3


def test_relations_are_those_of_the_table():
    truth = layout(np.random.default_rng(7))
    pieces = found(drawn(truth, light=Light(0.6, 12), seed=12))
    expected = relations(truth)

    assert len(expected) > 6
    assert relations({id: (each.x, each.y, each.yaw) for id, each in pieces.items()}) == expected
