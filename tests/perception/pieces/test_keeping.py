"""Pieces as they are told: steady while they rest, covered, taken, moved."""

import math
from itertools import pairwise

import numpy as np
import pytest

from engage_hri.schemas.tables import PiecePose, Relation, relations
from engage_hri.schemas.units import Stamp
from engage_hri.schemas.world import Entity
from engage_hri.services.perception.pieces.keeping import COVERED, PieceKeeper
from engage_hri.services.perception.pieces.spotting import SpottedHand, SpottedPiece, SpottedPieces
from tests.perception.pieces.tables import GOALS, TABLE, Pose

RATE = 5.0


class Shown:
    """A table that is shown, picture after picture."""

    def __init__(self) -> None:
        self.keeper, self.number = PieceKeeper(TABLE), 0

    def __call__(
        self,
        poses: dict[str, Pose],
        bare: tuple[str, ...] = (),
        seen: float = 1.0,
        hands: tuple[SpottedHand, ...] = (),
    ) -> dict[str, Entity]:
        at = self.number / RATE
        self.number += 1
        pieces = tuple(SpottedPiece(id, *pose, seen) for id, pose in poses.items())
        told = self.keeper.feed(SpottedPieces(at=Stamp("", at), pieces=pieces, bare=bare, hands=hands), at)
        return {each.id: each for each in told}


def lying(poses: dict[str, Pose]) -> list[Entity]:
    pieces = {piece.id: piece for piece in TABLE.pieces}
    return [TABLE.lying(pieces[id], PiecePose(x, y, math.degrees(turn))) for id, (x, y, turn) in poses.items()]


def measured(poses: dict[str, Pose], rng: np.random.Generator, place: float = 0.001) -> dict[str, Pose]:
    """Poses with errors of measuring: a millimetre each way, and a degree."""
    return {
        id: (x + rng.normal(0, place), y + rng.normal(0, place), turn + math.radians(rng.normal(0, 1000 * place)))
        for id, (x, y, turn) in poses.items()
    }


def at_the_border() -> dict[str, Pose]:
    """The rectangle turned until its top is nearly its top left, and the blue square on it."""
    turn = math.radians(21.9)
    c, s = math.cos(turn), math.sin(turn)
    x, y, _ = GOALS["rectangle"]
    away = np.array(GOALS["blue-square"][:2]) - [x, y]
    return {
        "rectangle": (x, y, turn),
        "blue-square": (x + c * away[0] - s * away[1], y + s * away[0] + c * away[1], turn),
    }


def test_a_millimetre_of_noise_changes_no_relation():
    """By itself each picture has `top` now and `top left` then; what is told keeps one of them."""
    rng, shown = np.random.default_rng(5), Shown()
    once, told = set[frozenset[Relation]](), list[frozenset[Relation]]()
    for number in range(100):
        poses = measured(at_the_border(), rng)
        once.add(relations(lying(poses)))
        entities = shown(poses)
        if number > 25:  # five seconds
            told.append(relations(entities.values()))

    assert len(once) > 1
    assert len({*told}) == 1
    assert len(told[0]) == 2


def test_a_piece_that_rests_is_told_as_resting_and_its_place_is_mended():
    rng, shown = np.random.default_rng(2), Shown()
    shown({"rectangle": GOALS["rectangle"]})
    told = [shown(measured({"rectangle": GOALS["rectangle"]}, rng))["rectangle"] for _ in range(40)]
    places = [each.position for each in told]

    assert {each.velocity for each in told} == {(0.0, 0.0, 0.0)}
    assert len({*places}) < 6
    assert places[-1][:2] == pytest.approx(GOALS["rectangle"][:2], abs=0.0012)


def test_one_picture_alone_moves_nothing():
    shown, there = Shown(), {"rectangle": GOALS["rectangle"]}
    assert shown(there) == {}
    before = shown(there)
    wrong = shown({"rectangle": (0.7, 0.2, 1.0)})
    after = shown(there)

    assert before == wrong == after
    assert [*before] == ["rectangle"]


def test_a_piece_that_is_carried_moves_and_then_rests_where_it_was_laid():
    shown, told = Shown(), []
    shown({"rectangle": (0.5, 0.0, 0.0)})
    for number in range(20):
        x = 0.5 + 0.2 * min(max(number - 5, 0), 8) / 8
        told.append(shown({"rectangle": (x, 0.0, 0.0)})["rectangle"])

    speeds = [each.velocity[0] for each in told]
    assert max(speeds) == pytest.approx(0.2 / 8 * RATE, rel=0.01)
    assert told[-1].velocity == (0.0, 0.0, 0.0)
    assert told[-1].position[0] == pytest.approx(0.7, abs=0.002)
    assert all(b.position[0] >= a.position[0] for a, b in pairwise(told))


def test_a_covered_piece_stays_as_covered():
    shown, there = Shown(), {"rectangle": GOALS["rectangle"], "trapezoid": GOALS["trapezoid"]}
    for _ in range(4):
        before = shown(there)
    for _ in range(10):
        told = shown({"rectangle": GOALS["rectangle"]})
    again = shown(there)

    assert before["trapezoid"].confidence == 1.0
    assert told["trapezoid"].confidence == COVERED
    assert told["trapezoid"].position == before["trapezoid"].position
    assert told["rectangle"].confidence == 1.0
    assert again["trapezoid"].confidence == 1.0


def test_a_piece_is_not_covered_by_a_single_picture():
    shown, there = Shown(), {"rectangle": GOALS["rectangle"]}
    for _ in range(2):
        shown(there)

    assert shown({})["rectangle"].confidence == 1.0


def test_a_piece_that_a_hand_covers_in_part_stays_where_it_was():
    shown, (x, y, turn) = Shown(), GOALS["rectangle"]
    for _ in range(4):
        before = shown({"rectangle": (x, y, turn)})
    for _ in range(5):
        told = shown({"rectangle": (x + 0.007, y, turn)}, seen=0.6)
    moved = shown({"rectangle": (x + 0.05, y, turn)}, seen=0.6)
    moved = shown({"rectangle": (x + 0.05, y, turn)}, seen=0.6)

    assert told["rectangle"].position == before["rectangle"].position
    assert moved["rectangle"].position[0] == pytest.approx(x + 0.05)
    assert moved["rectangle"].confidence < 1.0


def test_half_of_a_square_beside_a_hand_is_no_triangle():
    square, shown = {"pink-square": (0.6, 0.0, 0.3)}, Shown()
    half = {"pink-triangle": (0.61, 0.004, 1.2)}
    hand = SpottedHand(0.64, 0.0, 0.97, 0.0)
    for _ in range(3):
        told = shown(square)
    for _ in range(5):
        told = shown(half, hands=(hand,))

    assert [*told] == ["pink-square"]
    assert told["pink-square"].position[:2] == (0.6, 0.0)
    for _ in range(3):
        told = shown(half)  # the hand has gone: it has laid the one there, and has the other

    assert "pink-triangle" in told


def test_a_piece_in_the_hand_is_left_out():
    shown, there = Shown(), {"rectangle": GOALS["rectangle"]}
    for _ in range(4):
        shown(there)
    told = [shown({}, bare=("rectangle",)) for _ in range(5)]

    assert "rectangle" in told[0]
    assert told[-1] == {}


def test_a_square_keeps_its_turn_when_it_is_measured_by_another_corner():
    shown, (x, y, _) = Shown(), GOALS["blue-square"]
    turns = [0.1, 0.1, 0.1 + math.pi / 2, 0.1 - math.pi, 0.1]
    told = [shown({"blue-square": (x, y, turn)}) for turn in turns][1:]

    assert [each["blue-square"].yaw for each in told] == pytest.approx([0.1] * 4)


def test_a_triangle_that_is_turned_has_been_turned():
    shown, (x, y, _) = Shown(), GOALS["yellow-triangle"]
    for turn in (0.1, 0.1, 0.1 + math.pi / 2, 0.1 + math.pi / 2):
        told = shown({"yellow-triangle": (x, y, turn)})

    assert told["yellow-triangle"].yaw == pytest.approx(0.1 + math.pi / 2)
