"""Fixed times and durations: holding, slower, faster, late; and estimates corrected by what was measured."""

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, Gesture, Head, Mark, Pointing, Speech
from engage_hri.schemas.blocks import PredictionFeedback
from engage_hri.schemas.body import Estimate
from engage_hri.services.control.config import Variability
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.decide.decisions import Begin, Decisions, Extend
from engage_hri.services.realizer.foresee.expectations import differ_noticeably
from engage_hri.services.realizer.plan.plan import BRIEF, slack
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.points import Point
from tests.realizer.fake_body import SEVEN, FakeBody, Script
from tests.realizer.planning import elastic, timed
from tests.realizer.stage import after, block, stage, together
from tests.realizer.test_simulated_body import robot

BEAT = Gesture(id="beat", lexeme="BEAT", mode="RIGHT_HAND")
"""Takes 2.25 s: 0.5, 0.25, 0.5, 0.25, 0.25, 0.5."""
SHIFT = GazeShift(id="shift", target="a")
"""Takes 1 s."""
STORY = Speech(id="s", text="one two", marks=(Mark("m", 3),))
ELASTIC = (0.5, 4.0)


async def test_longer_than_natural_holds_at_the_last_hold_point() -> None:
    async with stage(FakeBody(elastic=ELASTIC)) as seen:
        await seen.perform(block((BEAT,), together("beat:start", "1"), together("beat:end", "10")))

    assert (seen.times()["beat:start"], seen.times()["beat:end"]) == (1.0, 10.0)
    assert seen.body.stops == ["beat:stroke_end"]
    assert seen.warnings() == []


async def test_longer_than_natural_is_slower_where_nothing_can_hold() -> None:
    async with stage(FakeBody(elastic=ELASTIC)) as seen:
        await seen.perform(block((SHIFT,), together("shift:start", "1"), together("shift:end", "4")))

    assert seen.times() == {"shift:start": 1.0, "shift:end": 4.0}
    assert seen.warnings() == []


async def test_shorter_than_natural_is_faster_in_all_its_phases() -> None:
    async with stage(FakeBody(elastic=ELASTIC)) as seen:
        await seen.perform(block((BEAT,), together("beat:start", "1"), together("beat:end", "2.5")))

    times = seen.times()
    assert times["beat:start"] == 1.0
    assert times["beat:ready"] == pytest.approx(1.0 + 0.5 * 1.5 / 2.25)
    assert times["beat:end"] == pytest.approx(2.5)
    assert seen.warnings() == []
    assert seen.body.stops == []


@pytest.mark.parametrize("end", ["s:end", "s:end-0.1"])
async def test_who_meets_the_end_of_words_is_faster_though_they_have_begun(end: str) -> None:
    """The words take 0.79 s, the nod 1.07; words under way do not wait for it."""
    words = Speech(id="s", text="Third listed.")
    nod = timed(Head(id="n", lexeme="NOD"), start="s:start", end=end)
    async with robot(Variability(seed=0, noise=0.0)) as seen:
        await seen.ask(block((words, nod))).outcome

    meeting = seen.times()["s:end"].time - (0.1 if "-" in end else 0.0)
    assert seen.times()["n:end"].time == pytest.approx(meeting, abs=0.005)
    assert seen.kinds() == []


async def test_a_body_that_turns_out_slow_hurries_to_be_on_time() -> None:
    """Half as fast as estimated in its first phase; what is left it does in half the time that it would take."""
    slow = FakeBody({"beat": Script(slow=2.0)}, elastic=(0.25, 4.0))
    async with stage(slow) as seen:
        await seen.perform(block((BEAT,), together("beat:start", "0"), together("beat:end", "3")))

    assert seen.times()["beat:ready"] == 1.0
    assert seen.times()["beat:end"] == pytest.approx(3.0)
    assert seen.warnings() == []


async def test_what_turns_out_impossible_while_it_runs_is_late_and_says_so() -> None:
    async with stage(FakeBody({"beat": Script(slow=2.0)})) as seen:
        outcome = await seen.perform(block((BEAT, STORY), together("beat:start", "0"), together("beat:end", "3")))

    assert outcome.status == "done"
    assert seen.times()["beat:end"] == 4.5
    assert [(each.kind, each.behavior) for each in seen.warnings()] == [("LATE", "beat")]
    assert "1.50 s later" in seen.warnings()[0].message


async def test_an_absolute_time_that_nobody_shares_is_kept_by_its_own_behavior_alone() -> None:
    async with stage(FakeBody({"beat": Script(slow=1.25)}, elastic=ELASTIC)) as seen:
        await seen.perform(block((BEAT, STORY), together("beat:stroke", "1.25"), together("s:end", "4")))

    assert seen.times()["beat:stroke"] == pytest.approx(1.25)
    assert seen.times()["s:end"] == 4.0


async def test_a_slow_joint_is_expected_to_stay_slow() -> None:
    """The second gesture of the arm begins so much earlier that its stroke comes with the word."""
    first, second = Pointing(id="p1", target="a", mode="RIGHT_HAND"), Pointing(id="p2", target="b", mode="RIGHT_HAND")
    example = block((first, second, STORY), after("p1:end+1", "p2:start"), together("p2:stroke", "s:m"))
    async with stage(FakeBody({"p1": Script(slow=2.0), "p2": Script(slow=2.0)})) as seen:
        await seen.perform(example)

    assert seen.times()["p2:start"] == 5.5
    assert seen.times()["p2:stroke"] == seen.times()["s:m"] == 5.5 + 2 * 1.25
    assert seen.body.stops == []


async def test_who_is_overdue_is_not_waited_for_by_waking_all_the_time() -> None:
    """The speech is to begin a second before the stroke; each time it would, the arm is later still."""
    stuck = FakeBody({"p": Script(durations=(3.0, 0.25, 0.5, 0.25, 0.25, 0.5))})
    async with stage(stuck) as seen:
        await seen.perform(block((Pointing(id="p", target="a"), STORY), together("p:stroke_start+1.5", "s:m")))

    assert seen.times()["s:m"] - seen.times()["p:stroke_start"] == pytest.approx(1.5)
    predictions = [each for each in seen.feedback if isinstance(each, PredictionFeedback)]
    assert len(predictions) < 6


async def test_a_gaze_lingers_on_its_way_to_meet_a_word_that_is_late() -> None:
    """A second was planned from the first word to the second, on whose way the gaze begins."""
    story = Speech(id="s", text="one two three", marks=(Mark("m1", 3), Mark("m2", 7)))
    turning = (0.0, 0.0, 1.25, 0.0, 0.0, 0.5)
    slow = FakeBody({"s": Script(slow=1.5), "g": Script(durations=turning)}, {"g": turning}, elastic=(1.0, 4.0))
    async with stage(slow) as seen:
        await seen.perform(block((Gaze(id="g", target="a"), story), together("g:stroke", "s:m2")))

    assert seen.times()["g:start"] == 0.75
    assert seen.times()["g:stroke"] == seen.times()["s:m2"] == 3.0


async def test_an_utterance_under_way_pauses_at_a_word_gap_for_an_arm_that_is_late() -> None:
    late = FakeBody({"p": Script(durations=(0.5, 1.5, 0.5, 0.25, 0.25, 0.5))}, pauses=True)
    async with stage(late) as seen:
        await seen.perform(block((Pointing(id="p", target="a"), STORY), together("p:stroke", "s:m")))

    times = seen.times()
    assert times["s:start"] == 0.25
    assert times["p:stroke"] == times["s:m"] == 2.5
    assert seen.body.stops == ["s:m"]
    assert times["s:end"] == 3.5


async def test_an_utterance_on_time_never_pauses_and_one_that_has_not_begun_is_delayed() -> None:
    body = FakeBody(pauses=True)
    async with stage(body) as seen:
        await seen.perform(block((Pointing(id="p", target="a"), STORY), together("p:stroke", "s:m")))

    assert seen.times()["s:start"] == 0.25
    assert seen.times()["p:stroke"] == seen.times()["s:m"] == 1.25
    assert body.stops == []


async def test_an_arm_that_is_overdue_is_not_told_to_take_its_time() -> None:
    """That it is expected later does not mean that it should be."""
    story = Speech(id="s", text="one two", marks=(Mark("m", 3),))
    slow = FakeBody({"p": Script(slow=3.0)}, elastic=(0.5, 4.0))
    async with stage(slow) as seen:
        await seen.perform(block((Pointing(id="p", target="a"), story), together("p:stroke", "s:m")))

    assert seen.times()["p:ready"] == 3 * 0.5


async def test_who_is_too_late_for_what_came_before_it_says_so() -> None:
    """The other half of a constraint: the word was to come half a second after the stroke, and was there."""
    late = FakeBody({"p": Script(durations=(0.5, 0.25, 1.25, 0.25, 0.25, 0.5))})
    async with stage(late) as seen:
        await seen.perform(block((Pointing(id="p", target="a"), STORY), together("p:stroke+0.5", "s:m")))

    assert (seen.times()["p:stroke"], seen.times()["s:m"]) == (2.0, 1.75)
    assert [(each.kind, each.behavior, each.message) for each in seen.warnings()] == [
        ("LATE", "p", "stroke came 0.75 s later than it should be: p:stroke+0.5 = s:m")
    ]


def test_nobody_is_told_to_be_slower_than_its_body_can() -> None:
    """The words stop coming: the shift that ends with them is slowed down, but to no more than its longest time."""
    words = Speech(id="s", text="one two three four", marks=(Mark("a", 3), Mark("b", 7), Mark("c", 13)))
    body = FakeBody(elastic=(0.5, 1.5), estimates={"shift": (3.0,)})
    made = block((words, SHIFT), together("shift:end", "s:end"))
    authority = Decisions(plan_block(made, [body.estimate(each) for each in made.behaviors]), 0.0, RealizerConfig())
    told = []
    for now, point in (
        (0.0, "s:start"),
        (1.0, "s:a"),
        (1.0, "shift:start"),
        (2.2, ""),
        (2.6, ""),
        (3.2, ""),
        (3.5, ""),
    ):
        told += authority.advance(now)
        if point:
            authority.reach(Point(*point.split(":")), now)

    paces = [dict(each.pace)["end"] for each in told if isinstance(each, Extend) and each.behavior == "shift"]
    assert 4.0 < paces[0] < 5.5
    assert max(paces) == pytest.approx(1.0 + 1.5 * 3.0)


def test_only_who_waits_for_nobody_may_be_slower_so_as_not_to_stop() -> None:
    said = [FakeBody(elastic=ELASTIC).estimate(each) for each in (BEAT, STORY)]
    alone = plan_block(block((BEAT, STORY)), said)
    shared = plan_block(block((BEAT, STORY), together("beat:stroke_start", "s:start")), said)

    assert slack(alone, Point("beat", "stroke_start")) == BRIEF == 0.05
    assert slack(shared, Point("beat", "stroke_start")) == 0.0
    assert slack(shared, Point("beat", "stroke_end")) == BRIEF
    assert slack(alone, Point("beat", "stroke")) == 0.0  # it does not stop there in any case


def test_only_who_can_be_faster_is_told_to_hurry() -> None:
    """The two take 3 s one after the other, and have 2.75: the arm can be faster, the voice cannot."""
    arm = Pointing(id="p", target="a")
    said = elastic("s", ("start", "m", "end"), 0.5, 0.5, 0.5), elastic("p", SEVEN, 0.25, 0.5, 1.0)
    fixed = (together("s:end", "p:start"), together("p:stroke_end", "2.75"), together("s:start", "bml:start"))
    made = plan_block(block((STORY, arm), *fixed), said)
    decisions = Decisions(made, 0.0, RealizerConfig())

    assert (made.dropped, decisions.advance(0.0)) == ((), [Begin("s", "end")])  # at its own pace
    assert decisions.foresight.forecast is not None
    assert [decisions.foresight.forecast.is_hurried(id) for id in "sp"] == [False, True]


@pytest.mark.parametrize(
    ("one", "other", "differ"),
    [
        ({}, {}, False),
        ({}, {"end": 2.0}, True),
        ({"end": 2.0}, {}, True),
        ({"end": 2.0}, {"end": 2.015625}, False),
        ({"end": 2.0}, {"end": 2.03125}, True),
        ({"relax": 1.0}, {"relax": 1.0, "end": 2.0}, True),
        ({"relax": 1.0, "end": 2.0}, {"end": 2.0}, False),  # that one has been
    ],
)
def test_a_pace_is_told_again_if_more_than_a_fiftieth_of_a_second_is_other_than_before(
    one: dict[str, float], other: dict[str, float], *, differ: bool
) -> None:
    assert differ_noticeably(tuple(one.items()), tuple(other.items())) == differ


class OneJoint(FakeBody):
    """Slower only until it is ready, at most by so many times; from then on it takes as long as it takes."""

    def estimate(self, behavior: BlockBehavior) -> Estimate:
        found = super().estimate(behavior)
        if not isinstance(behavior, Pointing):
            return found
        first, *rest = (replace(each, hold=False) for each in found.phases)
        return replace(found, phases=(first, *(replace(each, longest=each.natural) for each in rest)))


async def test_who_can_be_slower_at_first_but_not_after_that_is_told_to_be_slower_at_first() -> None:
    """The words are slower by half than planned, the arm by half than natural, and only at first."""
    story = Speech(id="s", text="one two three four", marks=(Mark("m1", 3), Mark("m2", 7), Mark("m3", 13)))
    natural = (1.25, 0.5, 0.5, 0.25, 0.25, 0.5)
    body = OneJoint({"s": Script(slow=1.5), "p": Script(durations=natural)}, {"p": natural}, elastic=(1.0, 1.5))
    pointing = Pointing(id="p", target="a")
    async with stage(body) as seen:
        await seen.perform(block((pointing, story), together("p:ready", "s:m2"), together("p:stroke", "s:m3")))

    times = seen.times()
    assert (times["p:start"], times["s:m2"]) == (0.75, 3.0)
    assert times["p:ready"] == 0.75 + 1.5 * 1.25
    assert times["p:stroke"] == pytest.approx(times["p:ready"] + 1.0, abs=0.02)
