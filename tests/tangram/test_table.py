"""The table's data fits together: the figure is a figure, and nothing lies on anything else."""

from itertools import combinations

import pytest

from engage_hri.schemas.tables import PiecePose, edges, overlap, poses_touching, touches
from engage_hri.schemas.world import Entity
from engage_hri.services.simulation.still import table_world
from engage_hri.services.tangram.people.table import Table
from engage_hri.services.tangram.table import tangram_table

TABLE = tangram_table()
START = {piece.id: TABLE.lying(piece, piece.start) for piece in TABLE.pieces}
GOAL = {entity.id: entity for entity in TABLE.figure()}


def side_of(piece: Entity, landmark: Entity) -> str | None:
    return next((f.side for f in edges(landmark) for e in edges(piece) if touches(e, f)), None)


def test_color_and_shape_name_each_of_the_ten_pieces() -> None:
    assert len({(piece.color, piece.shape) for piece in TABLE.pieces}) == len(TABLE.pieces) == 10


@pytest.mark.parametrize("layout", [START, GOAL], ids=["start", "figure"])
def test_no_piece_lies_on_another(layout: dict[str, Entity]) -> None:
    assert [pair for pair in combinations(layout, 2) if overlap(layout[pair[0]], layout[pair[1]])] == []


@pytest.mark.parametrize("layout", [START, GOAL], ids=["start", "figure"])
def test_every_piece_is_within_the_robots_half_of_the_table(layout: dict[str, Entity]) -> None:
    assert all(0.35 <= x <= 0.75 and abs(y) < 0.4 for x, y, _ in (piece.position for piece in layout.values()))


@pytest.mark.parametrize(
    ("piece", "side", "landmark"),
    [
        ("blue-square", "top", "rectangle"),
        ("trapezoid", "top", "blue-square"),
        ("yellow-triangle", "bottom", "rectangle"),
        ("red-square", "bottom left", "yellow-triangle"),
        ("pink-square", "bottom right", "yellow-triangle"),
        ("pink-triangle", "top left", "red-square"),
        ("purple-square", "right", "blue-square"),
        ("purple-triangle", "top right", "pink-square"),
        ("green-square", "left", "blue-square"),
    ],
)
def test_the_figure_has_the_touching_edges_of_appendix_b(piece: str, side: str, landmark: str) -> None:
    assert side_of(GOAL[piece], GOAL[landmark]) == side


def test_step_19_has_a_place_that_is_not_the_one_asked_for_in_step_18() -> None:
    triangle, trapezoid = GOAL["purple-triangle"], GOAL["trapezoid"]
    elsewhere = [
        TABLE.lying(TABLE.piece("purple-triangle"), pose) for pose in poses_touching(triangle, trapezoid, "top right")
    ]
    others = [piece for id, piece in GOAL.items() if id not in ("purple-triangle", "green-square")]

    assert any(not any(overlap(placed, other) for other in others) for placed in elsewhere)


def test_a_piece_laid_where_poses_touching_says_touches_there() -> None:
    blue, rectangle = TABLE.piece("blue-square"), GOAL["rectangle"]

    poses = list(poses_touching(START["blue-square"], rectangle, "top"))

    assert len(poses) == 4
    assert all(side_of(TABLE.lying(blue, pose), rectangle) == "top" for pose in poses)


def test_a_longer_edge_does_not_touch_a_shorter_one() -> None:
    green = TABLE.piece("green-square")

    assert side_of(TABLE.lying(green, PiecePose(0.55, 0.07)), GOAL["rectangle"]) is None


def test_the_world_of_the_core_is_this_table_at_the_start() -> None:
    table = Table(TABLE)
    table.seated = True

    assert table_world().entities == table.entities(0.0)
