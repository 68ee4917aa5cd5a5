"""Shifts of the head, and the looks before, over and after them: planned as a body performs them."""

from collections.abc import Sequence

import pytest

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, HeadDirectionShift, Mark, Speech
from engage_hri.schemas.body import Estimate, Phase
from engage_hri.services.control.config import Variability
from engage_hri.services.realizer.points import Point
from tests.realizer.planning import at, plan, timed, warnings
from tests.realizer.stage import after, block, together
from tests.realizer.test_simulated_body import robot

SHIFT = GazeShift(id="g", target="a")
OTHER = HeadDirectionShift(id="h", target="b")
LOOK = Gaze(id="z", target="human")
SLOWER = Estimate(
    behavior="g", feasible=True, parts=("head",), phases=(Phase(since="start", to="end", shortest=0.5, natural=1.0),)
)
WORDS = Speech(id="s", text="one two three", marks=(Mark("m", 7),))


def test_a_shift_is_not_ended_by_another_before_it_has_come_to_its_target() -> None:
    made = plan(block((timed(SHIFT, start="0"), timed(OTHER, start="0.25"))))

    assert warnings(made) == [("IMPOSSIBLE_TO_SCHEDULE", "h")]
    assert at(made, "g:end") == 1.0


def test_a_shift_that_need_not_begin_at_once_waits_for_the_one_before() -> None:
    made = plan(block((timed(SHIFT, start="0"), OTHER)))

    assert made.problems == ()
    assert at(made, "g:end") == at(made, "h:start") == 1.0


def test_the_end_of_a_shift_that_is_asked_for_is_waited_for() -> None:
    made = plan(block((timed(SHIFT, start="0", end="3"), WORDS, LOOK), together("z:stroke", "s:m")), SLOWER)

    assert made.problems == ()
    assert at(made, "g:end") == at(made, "z:start") == 3.0
    assert at(made, "z:stroke") == at(made, "s:m") == 3.5


def test_of_two_shifts_at_fixed_times_the_later_is_dropped() -> None:
    made = plan(block((timed(SHIFT, start="0", end="3"), timed(OTHER, start="1"))), SLOWER)

    assert warnings(made) == [("IMPOSSIBLE_TO_SCHEDULE", "h")]
    assert at(made, "g:end") == 3.0


@pytest.mark.parametrize("behaviors", [(SHIFT, LOOK), (LOOK, SHIFT)])
def test_a_look_lies_over_a_shift_of_the_same_instant(behaviors: Sequence[BlockBehavior]) -> None:
    made = plan(block((*behaviors, WORDS)))

    assert made.problems == ()
    assert at(made, "g:start") == at(made, "g:end") == at(made, "z:start") == 0.0


def test_a_shift_beneath_a_look_takes_nothing_from_it() -> None:
    made = plan(block((timed(LOOK, relax="3"), timed(SHIFT, start="1"), WORDS), after("g:end", "s:start")))

    assert made.problems == ()
    assert at(made, "z:relax") == 3.0
    assert at(made, "g:start") == at(made, "g:end") == at(made, "s:start") == 1.0


@pytest.mark.parametrize("shift", [SHIFT, OTHER])
def test_who_takes_over_a_shift_is_no_look_so_the_shift_is_not_at_its_end(shift: BlockBehavior) -> None:
    made = plan(block((shift, timed(LOOK, start="3"), WORDS)))

    assert made.kept[shift.id] == Point(shift.id, "end")


TIMED = [
    (timed(SHIFT, start="0", end="3"), timed(LOOK, stroke="s:m", relax="6"), WORDS),
    (SHIFT, timed(LOOK, start="0", relax="1.5"), timed(Gaze(id="y", target="b"), start="3", stroke_end="6")),
    (timed(LOOK, start="0", relax="2"), timed(SHIFT, start="1"), timed(Gaze(id="y", target="b"), start="4")),
    (timed(LOOK, start="0", relax="5"), timed(SHIFT, start="1", end="4"), timed(WORDS, start="g:end")),
    (timed(LOOK, relax="1"), timed(OTHER, start="2"), timed(SHIFT, start="3"), timed(WORDS, start="g:end")),
]


@pytest.mark.parametrize("behaviors", TIMED)
async def test_looks_before_and_after_shifts_take_as_long_as_planned(behaviors: Sequence[BlockBehavior]) -> None:
    async with robot(Variability(seed=0, noise=0.0)) as seen:
        await seen.perform(block(behaviors))

    homes = {"z:end", "y:end"}  # of the way home the estimate does not know where that will be
    times = {name: each for name, each in seen.times().items() if name not in homes}
    assert len(times) > 8
    assert {name: each.time for name, each in times.items()} == pytest.approx(
        {name: each.predicted for name, each in times.items()}, abs=1e-6
    )
    assert seen.kinds() == []


@pytest.mark.parametrize(("one", "other"), [(SHIFT, OTHER), (OTHER, SHIFT)])
async def test_a_shift_a_look_and_another_shift_at_one_time(one: BlockBehavior, other: BlockBehavior) -> None:
    """The look ends the first shift, the second is beneath the look: nobody waits, and nothing is lost."""
    one, other, look = (timed(each, start="0") for each in (one, other, LOOK))
    async with robot(Variability(seed=0, noise=0.0)) as seen:
        outcome = await seen.perform(block((one, look, other)))

    assert outcome is not None
    assert outcome.dropped == ()
    assert [seen.times()[name].time for name in (f"{one.id}:end", "z:start", f"{other.id}:end")] == [0.0, 0.0, 0.0]
    assert seen.kinds() == []
