"""From head poses to looks: cone, extents, hysteresis, dwell, lost faces, covered pieces; exact times."""

import math
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, HeadPose
from engage_hri.schemas.world import Entity, World
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.perceive.attention import Attention
from engage_hri.services.recognition.perceive.onsets import DWELL
from tests.recognition.observations import HUMAN, ROBOT, stamp
from tests.recognition.raw import EMPTY, EYES, PLACES, Watch, face, frames, piece, pose, table, turned

TICK = 0.05


def ticks(start, end):
    return [round(start + TICK * index, 6) for index in range(round((end - start) / TICK))]


# -- dwell ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("last", "looks"), [(1.149, []), (1.15, [("look", "blue", 1.0)])])
def test_a_look_counts_after_the_dwell_from_its_first_pose_on(last, looks):
    watch = Watch()
    watch.looks("blue", 1.0, 1.1, last)

    assert watch.of("look") == looks


def test_one_pose_and_then_none_is_no_look():
    watch = Watch()
    watch.looks("blue", 1.0)
    watch.until(1.4)

    assert watch.of("look") == []


def test_a_glitch_shorter_than_the_dwell_changes_nothing():
    watch = Watch()
    watch.looks("blue", *ticks(1.0, 2.0))
    watch.looks("red", 2.0, 2.05, 2.1, 2.149)
    watch.looks("blue", *ticks(2.15, 3.0))

    assert watch.of("look") == [("look", "blue", 1.0)]


def test_a_look_ends_where_the_gaze_left_and_the_next_begins_where_it_came_to_stay():
    watch = Watch()
    watch.looks("blue", *ticks(1.0, 2.0))
    watch.looks("green", 2.0, 2.05)
    watch.looks("table", 2.1, 2.14)
    watch.looks("red", *ticks(2.2, 2.4))

    assert watch.of("look")[1:] == [("look ends", "blue", 2.0), ("look", "red", 2.2)]


def test_a_gaze_that_wanders_has_left_though_it_is_nowhere_yet():
    watch = Watch()
    watch.looks("blue", *ticks(1.0, 2.0))
    for at, target in ((2.0, "red"), (2.1, "robot"), (2.149, "table")):
        watch.looks(target, at)
    before = watch.of("look")[1:]
    watch.looks("red", 2.15)

    assert before == []
    assert watch.of("look")[1:] == [("look ends", "blue", 2.0)]


def test_a_lost_pose_is_bridged():
    watch = Watch()
    watch.looks("blue", 1.0, 1.4, 1.8)

    assert watch.of("look") == [("look", "blue", 1.0)]


# -- what the gaze is on ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("target", ["blue", "red", "green", "table", "", ROBOT])
def test_everything_can_be_looked_at(target):
    watch = Watch()
    watch.looks(target, *ticks(1.0, 1.2))

    assert watch.of("look") == [("look", target, 1.0)]


def test_a_persons_face_can_be_looked_at_by_others_and_moves_with_the_head():
    watch = Watch()
    watch.sees(0.1, face("ann", (1.2, 0.9, 1.2)))
    moved = (1.2, 1.4, 1.2)
    watch.looks(EYES, *ticks(0.5, 0.7), actor="ann", eyes=moved)
    watch.looks(moved, *ticks(1.0, 1.2))

    assert watch.of("look")[-1] == ("look", "ann", 1.0)


@pytest.mark.parametrize(("off", "target"), [(4.9, "blue"), (5.1, "")])
def test_the_cone_reaches_from_the_extent_of_a_thing(off, target):
    """The ball has a radius of 5 cm, which are 2.87 degrees at 1 m."""
    watch = Watch()
    place = (EYES[0], EYES[1] + 1.0, EYES[2])
    watch.feed(World(entities=(Entity(id="blue", kind="object", position=place, radius=0.05),)), 0.1)
    angle = math.degrees(math.asin(0.05)) + off
    watch.looks(turned(place, angle), *ticks(1.0, 1.2))

    assert watch.of("look") == [("look", target, 1.0)]


@pytest.mark.parametrize(("edge", "target"), [(0.99, "a"), (1.01, "table")])
def test_a_footprint_reaches_to_its_edges(edge, target):
    """A square tile of 2 m side, seen from 1 m above its edge: the cone is so narrow that its edge decides."""
    watch = Watch(gaze_half_angle=0.01)
    corners = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))
    tile = Entity(id="a", kind="object", position=(5.0, 0.0, 0.0), footprint=corners, yaw=math.pi / 2)
    wide = Entity(
        id="table", kind="surface", position=(5.0, 0.0, -0.001), footprint=((9, 9), (-9, 9), (-9, -9), (9, -9))
    )
    watch.feed(World(entities=(tile, wide)), 0.1)
    watch.looks((5.0, edge, 0.0), *ticks(1.0, 1.2), eyes=(5.0, 1.0, 1.0))

    assert watch.of("look") == [("look", target, 1.0)]


def test_of_two_things_in_the_gaze_the_nearer_is_in_front():
    watch = Watch()
    far, near = (EYES[0], 2.0, 1.2), (EYES[0], 1.0, 1.2)
    balls = tuple(Entity(id=id, kind="object", position=at, radius=0.1) for id, at in (("far", far), ("near", near)))
    watch.feed(World(entities=balls), 0.1)
    watch.looks(far, *ticks(1.0, 1.2))

    assert watch.of("look") == [("look", "near", 1.0)]


def test_hands_are_not_looked_at_but_what_they_reach_for():
    watch = Watch()
    above = (PLACES["blue"][0], PLACES["blue"][1], 0.73)
    watch.sees(0.1, Entity(id="h", kind="hand", owner=HUMAN, position=above))
    watch.looks(above, *ticks(1.0, 1.2))

    assert watch.of("look") == [("look", "blue", 1.0)]


def test_at_resolution_table_things_are_what_they_lie_on():
    watch = Watch("table")
    watch.looks("blue", *ticks(1.0, 2.0))
    watch.looks("red", *ticks(2.0, 3.0))
    watch.looks(ROBOT, *ticks(3.0, 4.0))

    assert watch.of("look") == [("look", "table", 1.0), ("look ends", "table", 3.0), ("look", ROBOT, 3.0)]


# -- hysteresis -------------------------------------------------------------------------------------------------


def balls(*sides):
    """Small things 1 m in front of the eyes, degrees to the side."""
    ahead = (EYES[0], EYES[1] + 1.0, EYES[2])
    return World(
        entities=tuple(
            Entity(id=id, kind="object", position=turned(ahead, side)) for id, side in zip("ab", sides, strict=True)
        )
    )


@pytest.mark.parametrize(("side", "target"), [(2.0 + 0.49, "a"), (2.0 + 0.51, "b")])
def test_the_present_target_stays_until_another_is_nearer_by_the_margin(side, target):
    """Between things 4 degrees apart; at s from one it is 4 - s from the other: the margin of 1 is reached at 2.5."""
    watch = Watch()
    watch.feed(balls(0.0, 4.0), 0.1)
    ahead = (EYES[0], EYES[1] + 1.0, EYES[2])
    watch.looks(ahead, *ticks(1.0, 2.0))
    watch.looks(turned(ahead, side), *ticks(2.0, 3.0))

    assert watch.of("look")[-1][:2] == ("look", target)


@pytest.mark.parametrize(("side", "target"), [(5.99, "a"), (6.01, "")])
def test_the_present_target_stays_until_the_gaze_is_out_of_the_cone_by_the_margin(side, target):
    watch = Watch()
    watch.feed(balls(0.0, 40.0), 0.1)
    ahead = (EYES[0], EYES[1] + 1.0, EYES[2])
    watch.looks(ahead, *ticks(1.0, 2.0))
    watch.looks(turned(ahead, -side), *ticks(2.0, 3.0))

    assert watch.of("look")[-1][:2] == ("look", target)


# -- faults -----------------------------------------------------------------------------------------------------


def test_a_face_out_of_sight_for_two_seconds_is_lost_from_its_last_pose_on():
    watch = Watch()
    watch.looks("blue", *ticks(1.0, 2.05))
    deadline = watch.attention.deadline
    watch.until(3.999)
    before = list(watch.told)
    watch.until(4.0)

    assert deadline == pytest.approx(4.0)
    assert before == [("found", HUMAN, 1.0), ("look", "blue", 1.0)]
    assert watch.told[2:] == [("lost", HUMAN, 2.0)]
    assert watch.attention.deadline is None


def test_a_face_found_within_two_seconds_has_never_been_away():
    watch = Watch()
    watch.looks("blue", *ticks(1.0, 2.05))
    watch.looks("blue", *ticks(3.99, 4.5))

    assert watch.told == [("found", HUMAN, 1.0), ("look", "blue", 1.0)]


def test_a_face_that_comes_back_is_found_and_looks_anew():
    watch = Watch()
    watch.looks("blue", *ticks(1.0, 2.05))
    watch.looks("blue", *ticks(4.1, 4.3))

    assert watch.told[2:] == [("lost", HUMAN, 2.0), ("found", HUMAN, 4.1), ("look", "blue", 4.1)]


def test_who_is_heard_has_not_gone_but_looks_nowhere():
    watch = Watch()
    watch.looks("blue", *ticks(1.0, 2.05))
    watch.hears(True, *ticks(1.8, 4.0))
    watch.hears(False, *ticks(4.0, 4.5))
    watch.until(5.999)
    before = watch.told[2:]
    watch.until(6.0)

    assert before == [("speak", "", 1.8), ("look ends", "blue", 2.0), ("speak ends", "", 4.0)]
    assert watch.told[-1] == ("lost", HUMAN, 4.0)


def test_late_double_and_doubtful_poses_are_dropped():
    watch = Watch()
    watch.looks("blue", *ticks(1.0, 2.0))
    watch.looks("red", 1.5, 1.7, 1.94, 1.95)
    watch.looks("red", *ticks(2.0, 2.4), confidence=0.39)

    assert watch.told == [("found", HUMAN, 1.0), ("look", "blue", 1.0)]


def test_a_look_is_as_sure_as_the_least_sure_pose_of_its_dwell():
    watch = Watch()
    for at, confidence in ((1.0, 0.9), (1.1, 0.6), (1.2, 0.8), (1.3, 0.5)):
        watch.looks("blue", at, confidence=confidence)
    look = watch.actions[1]

    assert isinstance(look, ActionBegan)
    assert look.confidence == 0.6


@pytest.mark.parametrize("how", ["missing", "faint"])
def test_a_covered_piece_is_looked_at_where_it_was_with_less_and_less_confidence(how):
    watch = Watch()
    faint = () if how == "missing" else (piece("blue", (0.1, 0.4, 0.7), confidence=0.3),)
    watch.sees(1.0, *faint, without="blue")
    looks = []
    for at in (6.0, 11.0, 15.0):
        watch.looks("blue", *ticks(at, at + 0.2))
        looks.append(watch.actions[-1])
        watch.looks("", *ticks(at + 0.2, at + 0.5))

    assert [(look.targets, round(look.confidence, 2)) for look in looks] == [  # type: ignore[union-attr]
        (("blue",), 0.7), (("blue",), 0.49), (("table",), 1.0),
    ]  # fmt: skip


def test_symbolic_looks_are_believed_and_the_head_is_no_longer_asked():
    watch = Watch()
    watch.looks("blue", *ticks(1.0, 1.5))
    watch.attention.take_report(ActionBegan(actor=HUMAN, action="look", at=stamp(1.5), targets=("red",)), 1.5)
    watch.looks("green", *ticks(1.55, 3.0))
    watch.hears(True, *ticks(1.55, 3.0))

    assert watch.told[2:] == [("speak", "", 1.55)]
    assert watch.attention.undecided == []


def test_heads_count_again_when_no_look_has_been_reported_for_a_while():
    """A look is always at something, if only away: who reports none any more has let a camera see the person."""
    watch = Watch()
    watch.attention.take_report(ActionBegan(actor=HUMAN, action="look", at=stamp(1.0), targets=("red",)), 1.0)
    watch.looks("green", *ticks(1.05, 9.0))
    watch.attention.take_report(ActionEnded(actor=HUMAN, action="look", at=stamp(9.0), targets=("red",)), 9.0)
    watch.looks("green", *ticks(9.05, 11.0))
    assert watch.of("look") == []
    watch.looks("green", *ticks(11.05, 12.0))
    assert watch.of("look") == [("look", "green", pytest.approx(11.05))]

    watch.attention.take_report(ActionBegan(actor=HUMAN, action="look", at=stamp(12.0), targets=("red",)), 12.0)
    watch.looks("blue", *ticks(12.05, 20.0))
    assert len(watch.of("look")) == 1


def test_who_is_told_to_come_and_go_is_not_lost_with_the_face():
    watch = Watch()
    watch.attention.take_report(ActorFound(actor=HUMAN, at=stamp(0.5)), 0.5)
    watch.looks("blue", *ticks(1.0, 2.05))
    watch.until(9.0)

    assert watch.told == [("look", "blue", 1.0), ("look ends", "blue", 2.0)]


def test_who_is_told_to_have_gone_and_is_seen_again_looks_anew():
    watch = Watch()
    watch.looks("blue", *ticks(1.0, 2.0))
    watch.attention.take_report(ActorLost(actor=HUMAN, at=stamp(2.0)), 2.0)
    watch.looks("blue", *ticks(2.5, 3.0))

    assert watch.told[2:] == [("look", "blue", 2.5)]


# -- whatever comes ---------------------------------------------------------------------------------------------

TARGETS = ("blue", "red", "green", "table", "", ROBOT)


def noisy_stream(seed, length):
    """Poses as they arrive: targets with noise, dropped, doubled, reordered, with gaps, some of them impossible."""
    random = Random(seed)
    arrivals = []
    at, target = 1.0, random.choice(TARGETS)
    for _ in range(length):
        at += random.choice((1 / 30, 1 / 30, 1 / 30, 0.1, 0.2, 0.7))
        if random.random() < 0.15:
            target = random.choice(TARGETS)
        one = pose(target, at, confidence=random.choice((1.0, 0.8, 0.5, 0.2)))
        noisy = tuple(part + random.gauss(0.0, 0.05) for part in one.direction)
        if random.random() < 0.05:
            noisy = random.choice(((0.0, 0.0, 0.0), (math.nan, 0.0, 0.0), (math.inf, 1.0, 0.0), (1e300, 0.0, 1e-300)))
        one = HeadPose(actor=HUMAN, position=one.position, direction=noisy, at=one.at, confidence=one.confidence)  # type: ignore[arg-type]
        late = random.choice((0.0, 0.0, 0.0, 0.05, 0.3))
        arrivals += [(at + late, one)] * random.choice((0, 1, 1, 1, 1, 2))
    return sorted(arrivals, key=lambda arrival: arrival[0])


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 150), st.sampled_from(("object", "table")))
def test_looks_of_any_stream_alternate_and_never_flicker_faster_than_the_dwell(seed, length, resolution):
    config = RecognitionConfig(gaze_resolution=resolution)
    attention = Attention(ROBOT, config)
    actions = attention.feed(table(), 0.0)
    for arrival, one in noisy_stream(seed, length):
        actions += attention.advance(arrival)
        actions += attention.feed(one, one.at.seconds)
    actions += attention.advance(1000.0)

    present, before, there = None, 0.0, False
    for action in actions:
        at = action.at.seconds
        assert at >= before, "in order"
        match action:
            case ActorFound():
                assert not there
                there = True
            case ActorLost():
                assert there
                there, present = False, None
            case ActionBegan():
                assert there
                assert present is None
                present = (action.targets, at)
            case ActionEnded():
                assert present is not None
                assert action.targets == present[0]
                assert at - present[1] >= DWELL - 1e-6
                present = None
        before = at
    assert not there
    assert attention.deadline is None
    assert attention.undecided == []


def test_frames_of_all_rates_agree():
    told = []
    for rate in (10.0, 15.0, 30.0, 60.0):
        watch = Watch()
        for start, target in ((1.0, "blue"), (2.0, ROBOT), (3.0, ""), (4.0, "table")):
            watch.looks(target, *frames(start, start + 1.0, rate))
        told.append(watch.of("look"))

    assert told == [told[0]] * 4


def test_an_empty_world_has_nothing_to_look_at_but_the_robot():
    watch = Watch()
    watch.attention = Attention(ROBOT, RecognitionConfig())
    watch.looks(EMPTY, *ticks(1.0, 2.0))
    watch.looks(ROBOT, *ticks(2.0, 3.0))

    assert watch.of("look") == [("look", "", 1.0), ("look ends", "", 2.0), ("look", ROBOT, 2.0)]
