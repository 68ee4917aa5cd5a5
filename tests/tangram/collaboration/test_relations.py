"""What touches what, from poses; and what the task makes of it."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas.tables import PiecePose, Relation, poses_touching, relation, relations
from engage_hri.schemas.world import Entity
from engage_hri.services.tangram.collaboration.pieces_in_view import has_been_placed
from engage_hri.services.tangram.collaboration.task import Goal, Instruction, check
from engage_hri.services.tangram.table import tangram_table

TABLE = tangram_table()
GOAL = {entity.id: entity for entity in TABLE.figure()}
START = {piece.id: TABLE.lying(piece, piece.start) for piece in TABLE.pieces}


def laid(piece: str, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Entity:
    """A piece as in the figure, but moved by x, y and turned by yaw degrees."""
    entity = GOAL[piece]
    px, py, pz = entity.position
    return replace(entity, position=(px + x, py + y, pz), yaw=entity.yaw + math.radians(yaw))


def test_at_the_start_nothing_touches_anything() -> None:
    assert relations(START.values()) == frozenset()


def test_a_relation_holds_both_ways_with_opposite_sides() -> None:
    assert relation(GOAL["blue-square"], GOAL["rectangle"]) == Relation("blue-square", "top", "rectangle")
    assert relation(GOAL["rectangle"], GOAL["blue-square"]) == Relation("rectangle", "bottom", "blue-square")


@pytest.mark.parametrize(
    ("x", "y", "yaw", "touching"),
    [(0.0, 0.0, 0.0, True), (-0.005, 0.005, 4.0, True), (-0.02, 0.0, 0.0, False), (0.0, 0.03, 0.0, False),
     (0.0, 0.0, 20.0, False), (0.0, 0.0, 90.0, True), (0.0, 0.0, 45.0, False)],
    ids=["exact", "almost", "gap", "shifted", "crooked", "turned by a right angle", "on a corner"],
)  # fmt: skip
def test_touching_allows_for_a_little_clumsiness(x: float, y: float, yaw: float, touching: bool) -> None:
    found = relation(laid("blue-square", x, y, yaw), GOAL["rectangle"])

    assert (found == Relation("blue-square", "top", "rectangle")) is touching


@settings(max_examples=60)
@given(st.sampled_from(sorted(GOAL)), st.sampled_from(sorted(GOAL)), st.floats(-180, 180))
def test_relations_do_not_depend_on_who_computed_the_pose(piece: str, landmark: str, yaw: float) -> None:
    """Wherever `poses_touching` lays a piece, the relation found there has the side that was asked for."""
    if piece == landmark:
        return
    base = TABLE.lying(TABLE.piece(landmark), PiecePose(0.5, 0.0, yaw))
    for side in ("top", "top right", "left", "bottom"):
        for pose in poses_touching(GOAL[piece], base, side):
            touching = relation(TABLE.lying(TABLE.piece(piece), pose), base)

            assert touching is not None
            assert touching.side == side


def test_the_base_alone_is_placed_at_the_start() -> None:
    assert Goal(TABLE).placed(START.values()) == {"rectangle"}


def test_everything_is_placed_in_the_finished_figure() -> None:
    goal = Goal(TABLE)

    assert goal.placed(GOAL.values()) == set(GOAL)
    assert goal.next(tuple(GOAL.values())) is None


def test_a_piece_beside_a_misplaced_one_is_not_placed() -> None:
    pieces = GOAL | {"yellow-triangle": START["yellow-triangle"]}

    placed = Goal(TABLE).placed(pieces.values())

    assert placed == set(GOAL) - {"yellow-triangle", "red-square", "pink-square", "pink-triangle", "purple-triangle"}


def test_the_task_asks_for_all_nine_pieces_and_never_beside_one_that_is_not_there() -> None:
    goal, pieces, asked = Goal(TABLE), dict(START), []
    while instruction := goal.next(tuple(pieces.values())):
        wanted = instruction.wanted
        assert wanted.landmark in goal.placed(pieces.values())
        asked.append(wanted.piece)
        pieces[wanted.piece] = GOAL[wanted.piece]

    assert sorted(asked) == sorted(set(GOAL) - {"rectangle"})


def test_a_piece_given_up_is_not_asked_for_again() -> None:
    goal = Goal(TABLE)
    first = goal.next(tuple(START.values()))
    assert first is not None

    second = goal.next(tuple(START.values()), {first.wanted.piece})

    assert second is not None
    assert second.wanted.piece != first.wanted.piece


WANTED = Relation("purple-triangle", "top right", "pink-square")
ELSEWHERE = Relation("purple-triangle", "top right", "trapezoid")


def with_triangle_at(where: Relation) -> list[Entity]:
    piece = TABLE.piece(where.piece)
    pose = next(iter(poses_touching(GOAL[where.piece], GOAL[where.landmark], where.side)))
    return [entity for id, entity in GOAL.items() if id != where.piece] + [TABLE.lying(piece, pose)]


def test_a_placement_is_right_where_it_was_asked_for() -> None:
    assert check(Instruction(wanted=WANTED), with_triangle_at(WANTED)).right


def test_step_19_is_wrong_by_the_figure_but_the_replay_accepts_it() -> None:
    pieces = with_triangle_at(ELSEWHERE)

    assert not check(Instruction(wanted=WANTED), pieces).right
    assert check(Instruction(wanted=WANTED, also=(ELSEWHERE,)), pieces).right


def test_a_check_tells_where_the_piece_lies_instead() -> None:
    assert ELSEWHERE in check(Instruction(wanted=WANTED), with_triangle_at(ELSEWHERE)).found


def test_a_piece_that_is_not_seen_is_not_right() -> None:
    assert not check(Instruction(wanted=WANTED), [GOAL["pink-square"]]).right


@pytest.mark.parametrize(
    ("now", "placed"),
    [
        (laid("blue-square"), False),
        (laid("blue-square", x=0.005), False),
        (laid("blue-square", x=0.05), True),
        (laid("blue-square", yaw=90.0), True),
        (replace(laid("blue-square", x=0.05), velocity=(0.2, 0.0, 0.0)), False),
    ],
    ids=["untouched", "noise", "moved", "turned in place", "still moving"],
)
def test_a_piece_is_placed_once_it_rests_elsewhere(now: Entity, placed: bool) -> None:
    assert has_been_placed("blue-square", [GOAL["blue-square"]], [now]) is placed


@pytest.mark.parametrize(
    ("before", "after", "placed"),
    [(50.0, 50.0, False), (50.0, 55.0, False), (50.0, -50.0, True), (178.0, -178.0, False)],
)
def test_how_far_a_piece_was_turned_counts_from_how_it_lay(before: float, after: float, placed: bool) -> None:
    then, now = laid("blue-square", yaw=before), laid("blue-square", yaw=after)

    assert has_been_placed("blue-square", [then], [now]) is placed


def test_a_piece_that_is_hidden_is_not_placed_yet() -> None:
    assert not has_been_placed("blue-square", [GOAL["blue-square"]], [])
