"""Rounds of planning: with which estimates, and with which order of behaviors, a block is planned once more."""

import pytest
from msgspec.structs import replace

from engage_hri.schemas.body import Estimate, EstimateBehaviors, EstimateItem, PlannedTime
from engage_hri.services.realizer.plan.agreement import Rounds
from engage_hri.services.realizer.plan.plan import Plan
from tests.realizer.fake_body import FakeBody
from tests.realizer.planning import LEFT, LEFT_TOO, SPEECH, plan, timed
from tests.realizer.stage import block

FIRST = FakeBody().estimate(LEFT)
PLAN = plan(block((LEFT,)))
QUEUE = plan(block((LEFT, timed(LEFT_TOO, start="0.25"), timed(SPEECH, start="0"))))
"""The first, of which nobody says when it comes, waits for the second one's arm."""


def asked(at: float) -> EstimateBehaviors:
    """About a plan in which the arm sets out at `at`."""
    return EstimateBehaviors(items=(EstimateItem(behavior=LEFT, times=(PlannedTime(sync="start", at=at),)),))


def told(ready: float) -> tuple[Estimate, ...]:
    """An answer of the body: the arm takes so long until it is ready."""
    first, *rest = FIRST.phases
    return (replace(FIRST, phases=(replace(first, shortest=ready, natural=ready, longest=ready), *rest)),)


def next_ones(*said: tuple[float, float], made: Plan = PLAN, rounds: Rounds | None = None) -> list[float]:
    """Seconds to be planned with next, after each question (about a start at that time) and its answer."""
    rounds = rounds or Rounds(EstimateBehaviors(items=()), told(1.0))
    found = []
    for at, answer in said:
        assert rounds.close(made, asked(at), told(answer)) is None
        found.append(rounds.estimates[0].phases[0].natural)
    return found


def test_the_first_answers_are_taken_as_they_are_and_later_ones_half_way() -> None:
    """Or where a line through the last two says, if these are off in two ways: here that is half-way, too."""
    assert next_ones((1.0, 2.0), (2.0, 1.0), (3.0, 2.0), (4.0, 3.0)) == [2.0, 1.0, 1.5, 2.25]


def test_the_answer_to_the_same_question_again_is_tried_as_it_is_once() -> None:
    assert next_ones((1.0, 2.0), (2.0, 1.0), (3.0, 2.0), (3.0, 4.0), (3.0, 2.0)) == pytest.approx(
        [2.0, 1.0, 1.5, 4.0, 26 / 9]
    )


def test_that_a_question_came_again_while_answers_were_taken_as_they_are_does_not_count() -> None:
    assert next_ones((1.0, 2.0), (1.0, 1.5), (3.0, 2.5), (3.0, 4.0)) == pytest.approx([2.0, 1.5, 11 / 6, 4.0])


def test_who_waited_in_a_plan_waits_in_all_once_answers_are_taken_half_way() -> None:
    assert QUEUE.turns
    rounds = Rounds(EstimateBehaviors(items=()), told(1.0))
    next_ones((1.0, 2.0), (2.0, 1.0), made=QUEUE, rounds=rounds)
    assert not rounds.turns
    next_ones((3.0, 2.0), made=QUEUE, rounds=rounds)
    assert rounds.turns == QUEUE.turns
    rounds.let_go()
    next_ones((4.0, 3.0), made=QUEUE, rounds=rounds)
    assert not rounds.turns
