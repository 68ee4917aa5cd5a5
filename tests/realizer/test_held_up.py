"""What a hold costs: the rest keeps its pace and its times as far as it can, and only what is left is late for it."""

import asyncio

import pytest

from engage_hri.schemas.behaviors import Gesture, Mark, Speech, Wait
from engage_hri.schemas.blocks import WarningFeedback
from engage_hri.services.control.config import Stall, Variability
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.decide.decisions import STANDING, Decisions, HeldUp
from engage_hri.services.realizer.foresee.expectations import Outlook
from engage_hri.services.realizer.net.facts import Stops
from engage_hri.services.realizer.points import ORIGIN, Point
from tests.realizer.planning import elastic, plan, timed
from tests.realizer.stage import block, together
from tests.realizer.steering import steer
from tests.realizer.test_simulated_body import Robot, robot

BEAT = Gesture(id="g", lexeme="BEAT", mode="LEFT_HAND")
FIRST, SECOND = Speech(id="s", text="Yes, please."), Speech(id="t", text="And now the next piece goes there.")
A, B, C = Point("a", "stroke"), Point("b", "stroke"), Point("c", "stroke")


async def hold(seen: Robot, seconds: float, block: str = "b", behavior: str = "") -> None:
    for to in ("hold", "continue"):
        await seen.requests.send(*steer(to, to, block, behavior)).outcome
        await asyncio.sleep(seconds if to == "hold" else 0.0)


async def test_a_slowed_stroke_that_is_held_shortly_goes_on_slowly_and_comes_later_by_that() -> None:
    async with robot(Variability()) as seen:
        performing = seen.ask(block((timed(BEAT, stroke_start="1", stroke="1.7"),)))
        await asyncio.sleep(1.2)
        await hold(seen, 0.3)
        await performing.outcome

    times = seen.times()
    assert times["g:stroke_start"].time == pytest.approx(1.0, abs=0.01)
    assert times["g:stroke"].time == pytest.approx(2.0, abs=0.02)
    assert seen.kinds() == []


async def test_words_that_were_held_do_not_make_the_voice_slow() -> None:
    """The stroke waits for the end of the second utterance, and is there with it."""
    async with robot(Variability()) as seen:
        performing = seen.ask(block((FIRST, SECOND, BEAT), together("g:stroke", "t:end")))
        await asyncio.sleep(0.3)
        await hold(seen, 0.8)
        await performing.outcome

    times = seen.times()
    assert times["g:stroke"].time == pytest.approx(times["t:end"].time, abs=0.02)
    assert seen.kinds() == []


async def test_what_stalls_after_a_hold_is_late_for_itself() -> None:
    """The hold is over for long, and its 3 s do not hide that the stroke comes 0.4 s after the word."""
    stall = Stall(part="left_arm", before="stroke", seconds=0.4)
    made = block((timed(BEAT, start="t:start+0.1"), FIRST, SECOND), together("g:stroke", "t:end"))
    async with robot(Variability(stall=(stall,))) as seen:
        performing = seen.ask(made)
        await asyncio.sleep(0.2)
        await hold(seen, 3.0)
        await performing.outcome

    late = [each for each in seen.feedback if isinstance(each, WarningFeedback) and each.kind == "LATE"]
    assert [each.behavior for each in late] == ["g"]


def test_until_it_is_known_what_a_hold_has_cost_it_accounts_for_as_much_as_it_lasted() -> None:
    held = HeldUp()
    before = Outlook({A: 5.0, B: 5.0})
    held.hold(before, 1.0)
    assert held.between(A, B, 0.0, 99.0, 0.5) == 0.0  # it came before
    assert held.between(A, B, 0.0, 99.0, 3.0) == pytest.approx(2.0 + STANDING)
    held.let_go(4.0, {"a": 2})
    assert held.between(A, B, 0.0, 99.0, 20.0) == pytest.approx(3.0 + STANDING)
    assert not held.is_settled(4.2, {"a": 3})
    assert not held.is_settled(9.0, {"a": 2})
    assert held.is_settled(9.0, {"a": 3})


def test_what_was_late_before_a_hold_is_not_late_for_it() -> None:
    held = HeldUp()
    held.hold(Outlook({A: 5.0, B: 4.0}), 1.0)
    held.let_go(1.0, {})

    assert held.between(A, B, 0.0, 1.25, 6.0) == 0.25
    assert held.between(A, B, 0.0, 0.75, 6.0) == 0.0
    assert held.between(A, B, 0.5, 2.0, 6.0) == STANDING


def test_then_it_accounts_for_what_is_expected_to_be_later_than_it_was() -> None:
    held = HeldUp()
    held.hold(Outlook({A: 5.0, B: 5.0, C: 4.0}), 1.0)
    held.let_go(4.0, {})
    held.settle(Outlook({A: 8.0, B: 6.0, C: 7.0}))

    assert held.between(A, B, 0.0, 99.0, 9.0) == 2.0
    assert held.between(A, B, 0.5, 99.0, 9.0) == 1.5
    assert held.between(B, A, 0.0, 99.0, 9.0) == 0.0
    assert held.between(A, C, 0.0, 99.0, 9.0) == 0.0  # it was expected to be as late before
    assert held.between(A, Point("nobody", "end"), 0.0, 99.0, 9.0) == 0.0


def test_holds_add_up() -> None:
    held = HeldUp()
    for since in (0.0, 10.0):
        held.hold(Outlook({A: since, B: since / 10.0}), since)
        held.let_go(since + 1.0, {})
        held.settle(Outlook({A: since + 1.0, B: since / 10.0}))

    assert held.between(A, B, 0.0, 99.0, 20.0) == pytest.approx(2.0)


@pytest.mark.parametrize(("longest", "comes"), [(2.0, 1.5), (1.25, 1.25), (1.0, 1.0)])
def test_who_is_slower_for_others_is_expected_with_them_or_as_late_as_it_can_be(longest: float, comes: float) -> None:
    """The voice cannot wait at its mark. By its own pace it would be there after one second, the other after 1.5."""
    words, other = Speech(id="s", text="one two", marks=(Mark("m", 3),)), Wait(id="w", duration=1.0)
    said = elastic("s", ("start", "m", "end"), 1.0, 1.0, longest)
    made = plan(block((words, other), together("s:m", "w:end")), said)
    decisions = Decisions(made, 0.0, RealizerConfig())
    list(decisions.advance(0.0))
    for behavior in ("s", "w"):
        decisions.reach(Point(behavior, "start"), 0.0 if behavior == "s" else 0.5)
    outlook = decisions.foresight.outlook(0.5)

    assert outlook.apart(Point("w", "end"), ORIGIN) == 1.5
    assert outlook.apart(Point("s", "m"), ORIGIN) == comes


def test_what_a_hold_has_cost_is_not_known_before_all_that_was_on_its_way_has_come() -> None:
    made = plan(block((Speech(id="s", text="so"),)), elastic("s", ("start", "end"), 5.0, 5.0, 5.0))
    decisions = Decisions(made, 0.0, RealizerConfig())
    list(decisions.advance(0.0))
    decisions.reach(Point("s", "start"), 0.0)
    for is_held, at in ((True, 1.0), (False, 2.0)):
        decisions.hold_up(is_held, at)
        decisions.hold(None if is_held else (), at)
    list(decisions.advance(2.0 + 2 * STANDING))
    assert decisions.held_up.has_effect

    decisions.reach(Point("s", "end"), 6.0)
    list(decisions.advance(6.0))
    assert not decisions.held_up.has_effect


def test_what_holds_have_stopped_counts_from_the_start_of_the_block_whenever_that_was() -> None:
    def stops(began: float) -> Stops:
        decisions = Decisions(
            plan(block((Wait(id="a", duration=5.0), Wait(id="b", duration=5.0)))), began, RealizerConfig()
        )
        decisions.follow([Point(id, "end") for id in "ab"])
        decisions.advance(began)
        for id in "ab":
            decisions.reach(Point(id, "start"), began)
        for held, at in (({"a"}, 1.0), (None, 1.5), ((), 2.0), ({"b"}, 3.0)):
            decisions.hold(held, began + at)
        return decisions.stops(began + 4.0)

    first, later = stops(0.0), stops(64.0)

    held = [(1.0, 1.5, {"a"}), (1.5, 2.0, None), (3.0, 4.0, {"b"})]
    assert [(each.since, each.until, each.behaviors) for each in first.holds] == held
    for told in ("holds", "phases", "reached", "times"):
        assert getattr(first, told) == getattr(later, told), told
