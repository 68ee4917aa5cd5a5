"""The rules of Appendix A, twice: those of the house, and those that the tests of pieces recompute from its text."""

import math
from itertools import combinations

import cv2
import numpy as np

from engage_hri.schemas.tables import PiecePose, relations
from engage_hri.services.tangram.collaboration.task import Goal
from tests.perception.pieces import appendix_a
from tests.perception.pieces.tables import GOALS, TABLE, Pose, corners, layout


def of_the_house(poses: dict[str, Pose]) -> set[tuple[str, str, str]]:
    pieces = {piece.id: piece for piece in TABLE.pieces}
    lying = [TABLE.lying(pieces[id], PiecePose(x, y, math.degrees(turn))) for id, (x, y, turn) in poses.items()]
    return {(each.piece, each.side, each.landmark) for each in relations(lying)}


def test_both_find_the_same_on_tables_that_people_lay():
    number = 0
    for seed in range(60):
        poses = layout(np.random.default_rng(seed))
        expected = appendix_a.relations(poses)
        number += len(expected)

        assert of_the_house(poses) == expected

    assert number > 400


def test_no_piece_of_a_drawn_table_lies_in_another():
    def into(a: str, b: str, poses: dict[str, Pose]) -> float:
        one, other = (np.float32(1000 * corners(id, poses[id])) for id in (a, b))  # millimetres
        return cv2.intersectConvexConvex(one, other)[0]

    tables = [layout(np.random.default_rng(seed)) for seed in range(40)]

    assert max(into(a, b, poses) for poses in tables for a, b in combinations(poses, 2)) < 15
    assert into("rectangle", "blue-square", GOALS | {"blue-square": GOALS["rectangle"]}) > 1000


def test_both_find_all_that_touches_in_the_figure():
    found = appendix_a.relations(GOALS)

    assert found == of_the_house(GOALS)
    assert ("blue-square", "top", "rectangle") in found
    assert found == {(each.piece, each.side, each.landmark) for each in Goal(TABLE).relations}
