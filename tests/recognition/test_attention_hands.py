"""From hands and pieces to manipulations: who moves what, noise, covered pieces, several hands."""

import itertools
from random import Random

import pytest

from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.units import Vector
from tests.recognition.observations import HUMAN, ROBOT
from tests.recognition.raw import PLACES, Watch, frames, hand

FROM = PLACES["blue"]
TO: Vector = (0.3, -0.2, 0.7)
LAP: Vector = (1.1, -0.2, 0.68)


def between(a: Vector, b: Vector, share: float) -> Vector:
    part = min(1.0, max(0.0, share))
    smooth = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
    return tuple(one + smooth * (other - one) for one, other in zip(a, b, strict=True))  # type: ignore[return-value]


def above(place: Vector) -> Vector:
    return (place[0], place[1], place[2] + 0.03)


def carried(at: float) -> tuple[Vector, Vector]:
    """Hand and piece: it reaches until 2.0, carries from 2.2 to 3.2, withdraws from 3.4 to 4.4."""
    piece = between(FROM, TO, (at - 2.2) / 1.0)
    hand = above(piece)
    if at < 2.0:
        hand = between(LAP, above(FROM), at - 1.0)
    elif at > 3.4:
        hand = between(above(TO), LAP, at - 3.4)
    return hand, piece


@pytest.mark.parametrize("rate", [10.0, 15.0, 30.0])
def test_a_carried_piece_is_manipulated_from_when_it_moves_until_it_rests(rate):
    watch = Watch()
    for at in frames(1.0, 4.5, rate):
        palm, piece = carried(at)
        watch.sees(at, hand(palm), blue=piece)

    (began, ended) = watch.told
    assert (began[:2], ended[:2]) == (("act", "blue"), ("act ends", "blue"))
    assert 2.2 <= began[2] <= 2.45, "once it has left its place by the tremor"
    assert ended[2] == pytest.approx(3.2, abs=0.15)


def test_a_piece_that_rests_is_let_go_without_another_word_of_the_world():
    watch = Watch()
    for at in frames(1.0, 3.2):
        palm, piece = carried(at)
        watch.sees(at, hand(palm), blue=piece)
    deadline = watch.attention.deadline
    assert deadline is not None
    watch.until(deadline - 1e-3)
    before = watch.of("act ends")
    watch.until(deadline)

    assert before == []
    assert watch.of("act ends") == [("act ends", "blue", pytest.approx(deadline - 0.3, abs=1e-6))]


def test_a_hand_that_comes_rests_and_goes_moves_nothing():
    watch = Watch()
    for at in frames(1.0, 4.5):
        watch.sees(at, hand(carried(at)[0] if at < 2.0 or at > 3.4 else above(FROM)))

    assert watch.told == []


@pytest.mark.parametrize("seed", range(5))
def test_trembling_vision_moves_nothing_though_hands_pass(seed):
    random, watch = Random(seed), Watch()
    for at in frames(0.1, 60.0, 15.0):
        near = {id: tuple(part + random.gauss(0.0, 0.005) for part in place) for id, place in PLACES.items()}
        watch.sees(at, hand(between(LAP, above(FROM), abs(at % 2.0 - 1.0))), **near)  # type: ignore[arg-type]

    assert watch.told == []


def test_a_piece_that_once_seemed_elsewhere_is_manipulated_only_from_when_it_leaves():
    watch = Watch()
    for at in frames(0.1, 8.0, 15.0):
        palm, piece = carried(at - 3.0)
        off = 0.0 if at < 1.0 else 0.011 if at < 1.2 else 0.002
        watch.sees(at, hand(palm), blue=(piece[0] - off, piece[1], piece[2]))

    assert [told[:2] for told in watch.told] == [("act", "blue"), ("act ends", "blue")]
    assert 5.2 <= watch.told[0][2] <= 5.45


@pytest.mark.parametrize("seed", range(5))
def test_trembling_vision_sees_one_manipulation_as_one(seed):
    random, watch = Random(seed), Watch()
    for at in frames(0.1, 8.0, 15.0):
        palm, piece = carried(at)
        watch.sees(at, hand(palm), blue=tuple(part + random.gauss(0.0, 0.005) for part in piece))  # type: ignore[arg-type]

    assert [told[:2] for told in watch.told] == [("act", "blue"), ("act ends", "blue")]
    assert watch.told[0][2] == pytest.approx(2.2, abs=0.25)
    assert 3.0 < watch.told[1][2] < 4.0


def test_a_piece_that_moves_without_a_hand_is_nobodys_act():
    watch = Watch()
    for at in frames(1.0, 4.5):
        watch.sees(at, hand(LAP), blue=carried(at)[1])

    assert watch.told == []


def test_a_piece_that_jumps_under_a_resting_hand_is_nobodys_act():
    watch = Watch()
    for at in frames(1.0, 3.0):
        jumped = (FROM[0] + 0.05, FROM[1], FROM[2])
        watch.sees(at, hand(above(FROM)), blue=FROM if at < 2.0 else jumped)

    assert watch.told == []


def test_the_robots_own_hand_and_a_hand_of_nobody_make_no_act():
    for owner in (ROBOT, ""):
        watch = Watch()
        for at in frames(1.0, 4.5):
            palm, piece = carried(at)
            watch.sees(at, hand(palm, owner=owner), blue=piece)

        assert watch.told == []


def test_a_piece_that_is_covered_and_comes_to_light_where_it_was_has_not_moved():
    watch = Watch()
    for at in frames(1.0, 4.5):
        covered = 1.8 < at < 3.6
        watch.sees(at, hand(carried(at)[0] if not covered else above(FROM)), without="blue" if covered else "")

    assert watch.told == []


def test_a_piece_that_is_covered_and_comes_to_light_elsewhere_was_moved():
    watch = Watch()
    for at in frames(1.0, 6.0):
        palm, piece = carried(at)
        watch.sees(at, hand(palm), without="blue" if 1.8 < at < 3.8 else "", blue=piece)

    (began, ended) = watch.told
    assert began[:2] == ("act", "blue")
    assert began[2] == pytest.approx(2.6, abs=0.15), "when the hand had left its place"
    assert ended == ("act ends", "blue", pytest.approx(3.8, abs=0.04))


@pytest.mark.parametrize("hidden", [(2.6, 3.0), (2.6, 3.8), (3.1, 5.0)])
def test_a_piece_covered_on_its_way_goes_with_the_hand(hidden):
    watch = Watch()
    for at in frames(1.0, 6.0):
        palm, piece = carried(at)
        watch.sees(
            at,
            hand(palm if at < 3.4 else above(TO)),
            without="blue" if hidden[0] < at < hidden[1] else "",
            blue=piece,
        )

    assert [told[:2] for told in watch.told] == [("act", "blue"), ("act ends", "blue")]
    assert watch.told[1][2] == pytest.approx(3.2, abs=0.15)


def test_the_hand_that_goes_along_is_the_one():
    watch = Watch()
    for at in frames(1.0, 4.5):
        palm, piece = carried(at)
        other = hand((FROM[0], FROM[1] + 0.06, FROM[2]), owner="ann")
        watch.sees(at, other, hand(palm), blue=piece)

    assert [action.actor for action in watch.actions] == [HUMAN, HUMAN]  # type: ignore[union-attr]


def test_two_pieces_in_two_hands_are_one_manipulation_of_the_person():
    watch = Watch()
    for at in frames(1.0, 6.0):
        palm, piece = carried(at)
        palm_2, piece_2 = carried(at - 0.5)
        shift = PLACES["red"][1] - FROM[1]
        left = hand((palm_2[0], palm_2[1] + shift, palm_2[2]), side="left")
        watch.sees(at, hand(palm), left, blue=piece, red=(piece_2[0], piece_2[1] + shift, piece_2[2]))

    assert [told[:2] for told in watch.told] == [("act", "blue"), ("act ends", "blue")]
    assert watch.told[1][2] == pytest.approx(3.7, abs=0.15)


def test_a_world_that_comes_late_is_dropped():
    watch = Watch()
    for at in frames(1.0, 4.5):
        palm, piece = carried(at)
        watch.sees(at, hand(palm), blue=piece)
        watch.sees(at - 0.5, hand(palm), blue=FROM)

    assert len(watch.told) == 2


@pytest.mark.parametrize("seed", range(10))
def test_acts_of_any_stream_alternate(seed):
    random, watch = Random(seed), Watch()
    place, palm = FROM, above(FROM)
    for at in sorted(random.choices(frames(0.1, 30.0), k=400)):
        if random.random() < 0.5:
            palm = tuple(part + random.gauss(0.0, 0.03) for part in palm)  # type: ignore[assignment]
        if random.random() < 0.3:
            place = (palm[0], palm[1], 0.7)
        hands = () if random.random() < 0.2 else (hand(palm),)
        watch.sees(at, *hands, without=random.choice(("", "", "blue")), blue=place)
    watch.until(1000.0)

    kinds = [type(action) for action in watch.actions]
    assert kinds == [ActionBegan, ActionEnded] * (len(kinds) // 2)
    assert kinds
    assert all(one.at.seconds <= other.at.seconds for one, other in itertools.pairwise(watch.actions[::1]))
    assert watch.attention.deadline is None
