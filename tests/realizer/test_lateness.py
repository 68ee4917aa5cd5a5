"""Who is late, once, and who is given up, once: each at its instant."""

import pytest

from engage_hri.schemas.behaviors import Event, Gesture, Mark, Speech
from engage_hri.services.bus.deadlines import LATE, Sight
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.decide.decisions import (
    STALL_FACTOR,
    Decisions,
    Extend,
    Late,
    LatenessWatch,
    Stalled,
)
from engage_hri.services.realizer.perform.behavior_run import event_deadline
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.points import Point
from tests.realizer.fake_body import FakeBody
from tests.realizer.stage import block

CONFIG = RealizerConfig(stall=3.0)


def test_what_does_not_come_is_late_once_and_given_up_once() -> None:
    watch = LatenessWatch(CONFIG, Sight("realizer"))
    watch.expect("b", "stroke", 1.0, 1.0, 0.0)

    assert watch.deadline == 2.5
    assert watch.overdue(2.4) == []
    assert watch.overdue(2.5) == [Late("b", "stroke", 1.5)]
    assert watch.deadline == 9.0
    assert watch.overdue(8.9) == []
    assert watch.overdue(9.0) == [Stalled("b", "stroke", 8.0)]
    assert watch.deadline is None


@pytest.mark.parametrize("waking", [2.6, 3.0, 9.0, 20.0, 1000.0])
def test_who_comes_to_look_long_after_hears_first_what_came_and_counts_on_from_there(waking: float) -> None:
    """Time for which one stood still oneself is nobody's delay. At 2.5 it is late, and 6.5 s after that stalled."""
    watch = LatenessWatch(CONFIG, sight := Sight("realizer"))
    watch.expect("b", "stroke", 1.0, 1.0, 0.0)

    assert watch.overdue(waking) == []
    assert sight.woke_at == pytest.approx(waking)
    heard = waking + LATE
    assert watch.overdue(heard - 0.01) == []
    assert watch.overdue(heard) == [Late("b", "stroke", heard - 1.0)]
    stalled = max(9.0 + sight.slept, heard)
    assert watch.deadline == pytest.approx(stalled)
    assert [type(each) for each in watch.overdue(stalled)] == [Stalled]


def test_a_report_that_is_late_when_it_is_first_expected_is_no_standstill() -> None:
    watch = LatenessWatch(CONFIG, sight := Sight("realizer"))
    watch.expect("b", "stroke", 1.0, 1.0, 30.0)

    assert [type(each) for each in watch.overdue(30.0)] == [Late, Stalled]
    assert sight.slept == 0.0


def test_what_is_expected_again_as_before_is_late_again() -> None:
    """As of a behavior that held for a while, and whose estimate has not changed."""
    watch = LatenessWatch(CONFIG, Sight("realizer"))
    watch.expect("b", "stroke", 1.0, 1.0, 0.0)
    watch.forget("b")
    assert watch.deadline is None

    watch.expect("b", "stroke", 1.0, 1.0, 0.0)

    assert watch.overdue(2.5) == [Late("b", "stroke", 1.5)]


def test_who_holds_where_it_may_pass_is_late_from_when_it_was_told_that() -> None:
    """Not from when something else about it was looked at again."""
    body = FakeBody()
    beat = Gesture(id="g", lexeme="BEAT", mode="RIGHT_HAND")
    authority = Decisions(plan_block(block((beat,)), [body.estimate(beat)]), 0.0, CONFIG)
    authority.follow([Point("g", "end")])
    authority.advance(0.0)
    authority.reach(Point("g", "start"), 0.0)
    authority.reach(Point("g", "ready"), 0.5)
    assert authority.advance(0.5) == [Extend("g", "stroke")]
    assert authority.advance(1.2) == [Extend("g", "end")]
    assert authority.advance(1.5) == [Late("g", "stroke_start", 0.75)]  # it was to begin its stroke at 0.75
    assert authority.advance(2.0) == []
    authority.arrive(Point("g", "stroke_start"), 2.1)

    stalled = 1.2 + CONFIG.stall + STALL_FACTOR * 0.25
    assert authority.advance(stalled - 0.01) == []
    assert [type(each) for each in authority.advance(stalled)] == [Stalled]


@pytest.mark.parametrize(
    ("reached", "since"),
    [
        ({}, 2.0),
        ({("s", "m"): 1.0}, 2.0),
        ({("s", "m"): 3.0}, 3.0),
        ({("s", "m"): 3.0, ("g", "stroke"): 5.0}, 5.0),
        ({("s", "m"): 5.0, ("g", "stroke"): 3.0}, 5.0),
    ],
)
def test_the_time_of_an_event_runs_from_its_start_or_the_last_anchor(
    reached: dict[tuple[str, str], float], since: float
) -> None:
    """An anchor that has not come by now does not count."""
    beat, words = Gesture(id="g", lexeme="BEAT"), Speech(id="s", text="one two", marks=(Mark("m", 3),))
    event = Event(id="e", kind="backchannel", responder="human", limit=4.0, anchors=("s:m", "g:stroke"))
    points = {Point("e", "start"): 2.0, **{Point(*point): at for point, at in reached.items()}}
    said = block((words, beat, event))

    assert event_deadline(event, said, points) == since + 4.5
