"""Hands over a drawn table: found by where they come from, whatever their skin, and told as hands of a person."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from engage_hri.schemas.units import Stamp
from engage_hri.schemas.world import Entity, World
from engage_hri.services.perception.pieces.keeping import HandKeeper, PieceKeeper
from engage_hri.services.perception.pieces.spotting import SpottedHand, SpottedPiece, SpottedPieces
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.perceive.manipulation import Manipulation
from tests.perception.pieces.tables import SKINS, STARTS, TABLE, Hand, Light, Pose, drawn, layout
from tests.perception.pieces.test_finding import beside, finder

AHEAD = Hand((0.62, 0.12))
MIDDLE = 0.04
"""Metres from the middle of the palm to that of the hand with its fingers."""
ANN, BOB = (Entity(id=id, kind="person", position=(1.3, left, 1.2)) for id, left in (("ann", 0.3), ("bob", -0.3)))


@pytest.mark.parametrize("skin", range(len(SKINS)))
@pytest.mark.parametrize("light", [Light(1.0, 4), Light(0.6, 15)], ids=str)
def test_a_hand_is_found_where_it_is_whatever_its_skin(skin: int, light: Light):
    looks, hand = finder(), AHEAD._replace(turn=0.2, skin=skin)
    middle = hand.at[0] - MIDDLE * math.cos(hand.turn), hand.at[1] - MIDDLE * math.sin(hand.turn)

    assert looks.find(drawn(STARTS, light=light, seed=skin)).hands == ()
    [found] = looks.find(drawn(STARTS, light=light, hands=[hand], seed=skin, take=1)).hands
    assert math.dist((found.x, found.y), middle) < 0.06
    assert found.from_x > 0.9
    assert looks.find(drawn(STARTS, light=light, seed=skin, take=2)).hands == ()


def test_two_hands_are_two_and_a_piece_that_one_of_them_holds_is_none():
    looks, (x, y, turn) = finder(), STARTS["purple-square"]
    looks.find(drawn(STARTS, seed=3))
    left, right = Hand((0.8, -0.25)), Hand((x + 0.1, y))
    found = looks.find(drawn({**STARTS, "purple-square": (x - 0.04, y, turn)}, hands=[left, right], seed=3)).hands

    assert len(found) == 2
    assert min(math.dist((each.x, each.y), (x + 0.06, y)) for each in found) < 0.06


def test_a_piece_that_lies_elsewhere_and_what_has_laid_it_there_long_ago_are_no_hands():
    looks = finder()
    looks.find(drawn(STARTS, seed=5))
    after = {**STARTS, "blue-square": (0.62, 0.3, 0.4)}

    assert looks.find(drawn(after, seed=5, take=1)).hands == ()
    assert looks.find(drawn(STARTS, light=Light(0.7, 8), seed=5, take=2)).hands == ()


def spotted(x: float, y: float, comes: tuple[float, float]) -> SpottedHand:
    return SpottedHand(x, y, *comes)


def test_a_hand_is_of_the_person_from_whose_side_it_comes_and_keeps_its_id_while_it_moves():
    keeper = HandKeeper(TABLE)
    told = [
        keeper.feed(
            [spotted(0.8 - 0.1 * k, 0.2, (0.98, 0.25)), spotted(0.7, -0.2, (0.98, -0.2))], (ANN, BOB), 0.5 * k
        )
        for k in range(3)
    ]

    assert [[(each.id, each.owner) for each in hands] for hands in told] == [
        [("ann-hand", "ann"), ("bob-hand", "bob")]
    ] * 3
    assert told[2][0].velocity == pytest.approx((-0.2, 0.0, 0.0))


def test_two_hands_of_one_person_are_two_and_one_that_comes_anew_is_told_anew():
    keeper, comes = HandKeeper(TABLE), (0.98, 0.0)
    both = keeper.feed([spotted(0.8, 0.2, comes), spotted(0.8, -0.2, comes)], (ANN,), 0.0)
    one = keeper.feed([spotted(0.8, -0.2, comes)], (ANN,), 0.2)

    assert [each.id for each in both] == ["ann-hand", "ann-hand-2"]
    assert [each.id for each in one] == ["ann-hand-2"]
    assert keeper.feed([], (ANN,), 0.4) == ()


def test_the_arm_of_the_robot_itself_is_not_told_and_that_of_nobody_has_no_owner():
    keeper = HandKeeper(TABLE)

    assert keeper.feed([spotted(0.5, 0.0, (0.27, 0.1))], (ANN,), 0.0) == ()
    [hand] = keeper.feed([spotted(0.8, 0.0, (0.98, 0.1))], (), 0.5)
    assert (hand.id, hand.owner) == ("hand", "")


def test_a_piece_that_is_carried_before_a_slow_camera_is_an_act_of_who_carries_it():
    """Two pictures a second: the hand comes, has laid the piece 25 cm away by the next picture, and goes."""
    looks, pieces, hands = finder(), PieceKeeper(TABLE), HandKeeper(TABLE)
    manipulation, (x, y, _) = Manipulation("robot", RecognitionConfig()), STARTS["blue-square"]
    there = {**STARTS, "blue-square": (0.74, 0.0, 0.3)}
    film: list[tuple[dict[str, Pose], tuple[float, float] | None]] = [
        (STARTS, None), (STARTS, None), (STARTS, (x + 0.3, y)), (STARTS, (x + 0.1, y)), (there, (0.84, 0.0)),
        (there, (0.95, -0.1)), (there, None), (there, None),
    ]  # fmt: skip
    told = []
    for number, (poses, at) in enumerate(film):
        now = number / 2
        seen = looks.find(drawn(poses, hands=[Hand(at)] if at else [], seed=1, take=number))
        spotted = SpottedPieces(at=Stamp("", now), **seen._asdict())
        entities = (ANN, *pieces.feed(spotted, now), *hands.feed(spotted.hands, (ANN,), now))
        told += manipulation.feed(World(entities=entities), now)

    assert [each.actor for each in told] == ["ann", "ann"]
    assert [(change.began, change.action, change.targets) for each in told for change in each.changes] == [
        (True, "act", ("blue-square",)), (False, "act", ("blue-square",))
    ]  # fmt: skip


@pytest.mark.parametrize("skin", range(len(SKINS)))
def test_what_a_hand_holds_is_found_and_is_not_the_hand(skin: int):
    looks, (x, y, turn) = finder(), (0.711, 0.127, 1.667)
    hand = Hand((x + 0.1, y), above=0.03, skin=skin)
    looks.find(drawn(STARTS, seed=skin))
    seen = looks.find(drawn({**STARTS, "yellow-triangle": (x, y, turn)}, hands=[hand], seed=skin, take=1))

    [held] = [each for each in seen.pieces if each.id == "yellow-triangle"]
    assert math.dist((held.x, held.y), (x, y)) < 0.003
    [found] = seen.hands
    assert math.dist((found.x, found.y), (hand.at[0] - MIDDLE, y)) < 0.06


@pytest.mark.parametrize("number", [3, 13])
def test_a_piece_under_a_hand_is_told_where_it_lies_or_not_at_all(number: int):
    """The foot of a wall looks like the edge of a top, and half a square is a triangle: both were told as sure."""
    chance = np.random.default_rng([99, number])
    truth = layout(chance)
    laid = [*truth][int(chance.integers(len(truth)))]
    skin, light = int(chance.integers(4)), Light(chance.choice([0.6, 1.0, 1.0, 1.3]), chance.choice([4.0, 8.0, 15.0]))
    x, y, _ = truth[laid]
    at = (x + chance.uniform(0.075, 0.11), y + chance.normal(0, 0.01))
    hand = Hand(at, chance.normal(0, 0.25), skin, chance.uniform(0.012, 0.04))
    looks, before = finder(), {id: pose for id, pose in truth.items() if id != laid}
    looks.find(drawn(before, light=light, seed=number))
    pieces = looks.find(drawn(truth, light=light, hands=[hand], seed=number, take=1)).pieces

    assert len(pieces) > 3
    assert beside({piece.id: piece for piece in pieces}, truth) < 5


def test_a_pale_hand_that_stays_does_not_become_the_table():
    """Its skin is like the wood in this light."""
    looks, hand = finder(), Hand((0.48, 0.21), above=0.03)
    looks.find(drawn(STARTS, seed=1))
    found = [looks.find(drawn(STARTS, hands=[hand], seed=1, take=take)).hands for take in range(1, 4)]

    assert all(math.dist((each.x, each.y), (0.48 - MIDDLE, 0.21)) < 0.04 for [each] in found)


Place = tuple[float, float] | None


def acts(film: Sequence[tuple[Place, Place]]) -> list[tuple[bool, float]]:
    """When ann's acts with a square begin and end. film: where it is seen, and her hand; two pictures a second."""
    pieces, hands, manipulation = PieceKeeper(TABLE), HandKeeper(TABLE), Manipulation("robot", RecognitionConfig())
    told = []
    for number, (piece, hand) in enumerate(film):
        now = number / 2
        seen = (SpottedPiece("blue-square", *piece, 0.3),) if piece is not None else ()
        palms = (spotted(*hand, (0.98, 0.2)),) if hand is not None else ()
        bare = () if seen else ("blue-square",)
        shown = pieces.feed(SpottedPieces(at=Stamp("", now), pieces=seen, bare=bare, hands=palms), now)
        known = hands.feed(palms, (ANN,), now)
        told += manipulation.feed(World(entities=(ANN, *shown, *known)), now)
    return [(change.began, change.at) for each in told for change in each.changes]


def test_a_piece_that_is_on_its_way_for_several_pictures_is_one_act():
    way = [0.56, 0.56, 0.56, 0.64, 0.72, 0.80, 0.80, 0.80]

    assert acts([((x, 0.0), (x + 0.05, 0.0)) for x in way]) == [(True, 1.0), (False, 2.5)]


def test_a_piece_that_is_gone_with_the_hand_in_the_next_picture_was_taken_by_it():
    there, beside, away, hand = (0.56, 0.0), (0.6, 0.0), (0.6, 0.25), (0.65, 0.12)

    assert acts([(there, beside)] * 3 + [(None, hand)] + [((0.56, 0.25), away)] * 3) == [(True, 1.0), (False, 2.0)]


@pytest.mark.parametrize("is_bare", [False, True])
def test_a_piece_that_is_seen_again_where_a_hand_has_laid_it_was_moved_by_it(is_bare: bool):
    there, beside, lays, leaves = (0.56, 0.0), (0.6, 0.0), (0.6, 0.25), (0.8, 0.2)
    away = [(None, lays)] * (3 if is_bare else 1)
    film = [*[(there, beside)] * 3, *away, ((0.56, 0.25), leaves), ((0.56, 0.25), None), ((0.56, 0.25), None)]
    laid = 1.5 + len(away) / 2

    assert acts(film) == [(True, 1.0), (False, laid)]
