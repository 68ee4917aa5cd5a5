"""Two things at the very same instant, and numbers at the very edge: which of them counts."""

import math

import pytest

from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.limits import in_time
from engage_hri.services.recognition.events.presence import FacePresence
from engage_hri.services.recognition.perceive.attention import Attention
from engage_hri.services.recognition.recognizer import Recognizer
from engage_hri.services.recognition.statistics.tally import Starts
from tests.recognition.observations import HUMAN, ROBOT, Log, asked, stamp, world
from tests.recognition.raw import pose, table

BLUE = "blue-square"


def test_a_single_start_is_settled_too():
    """A start that becomes known later than `SETTLED` splits no gap, though only one start is older than that."""
    starts = Starts()
    for start in (0.0, 200.0, 330.0):
        starts.add(start)
    starts.add(100.0)

    assert (starts.count, starts.largest_difference) == (4, 200.0)


def presence() -> FacePresence:
    return FacePresence()


def test_who_is_found_and_lost_at_one_instant_is_lost():
    person = presence()
    person.found(1.0)
    person.lost(1.0)

    assert person.deadline == 3.0


def test_a_loss_that_is_told_twice_is_no_second_one_though_the_person_was_found_at_that_instant():
    person = presence()
    person.lost(1.0)
    person.found(1.0)
    person.lost(1.0)

    assert person.deadline == math.inf


def test_a_loss_from_before_the_person_was_seen_again_is_none():
    person = presence()
    person.seen(1.1)
    person.lost(1.0)

    assert person.deadline == math.inf


def test_a_loss_while_the_face_is_lost_is_none_later_either():
    person = presence()
    person.lost(1.0)
    person.lost(1.2)
    person.leave()
    person.seen(1.3)
    person.lost(1.2)

    assert person.deadline == math.inf


@pytest.mark.parametrize(("after", "directs"), [(2.0, False), (2.1, True)])
@pytest.mark.parametrize("start", [0.1, 0.3, 0.7, 1.1])
def test_a_look_at_the_very_limit_after_the_robots_directed_gaze_follows_it(
    start: float, after: float, directs: bool
):
    log = Log()
    log.requests_event("directed_gaze", start, BLUE)
    log.until(start + 3.0)
    ended = log.last("dg-1").at.seconds
    log.looks(HUMAN, BLUE, round(ended + after, 6))
    log.until(ended + 3.0)

    assert (log.states("dg-2") != []) == directs


def test_of_two_poses_at_one_instant_the_first_counts():
    attention = Attention(ROBOT, RecognitionConfig())
    attention.feed(table(), 0.0)
    attention.feed(pose("blue", 0.0), 0.0)
    attention.feed(pose("red", 0.0), 0.0)
    (look,) = attention.feed(pose("blue", 0.15), 0.15)

    assert (look.at, look.targets) == (stamp(0.0), ("blue",))  # type: ignore[union-attr]


def test_at_the_limit_is_in_time_and_beyond_it_is_not():
    assert 0.3 + 1.9 < 2.2
    assert in_time(2.2, 0.3 + 1.9)
    assert not in_time(2.2001, 0.3 + 1.9)


def test_of_two_answers_that_began_at_one_instant_the_one_observed_first_counts():
    log = asked(end=None)
    log.begins(HUMAN, "speak", 1.5)
    log.begins(HUMAN, "point", 1.5, BLUE)
    log.signals("ended", 4.0)

    assert log.succeeded("ap-1").response == "speak"


def test_two_points_at_one_instant_direct_both():
    log = Log()
    log.begins(HUMAN, "point", 1.0, BLUE)
    log.begins(HUMAN, "point", 1.0, "rectangle")

    assert [event.objects for event in log.events] == [(BLUE,), ("rectangle",)]


@pytest.mark.parametrize("no_time", [math.nan, math.inf, -math.inf])
def test_a_time_that_is_no_number_is_taken_for_now(no_time: float):
    recognizer = Recognizer(ROBOT, RecognitionConfig())
    recognizer.feed(world(), no_time, 0.0)
    (started,) = recognizer.feed(
        ActionBegan(actor=HUMAN, action="look", at=stamp(0.0), targets=(ROBOT,)), no_time, 1.0
    )

    assert isinstance(started, ConnectionEvent)
    assert (started.at, recognizer.deadline) == (stamp(1.0), 2.9)
