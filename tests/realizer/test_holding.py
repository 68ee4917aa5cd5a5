"""Hold, continue, stop: a behavior, a block, the robot; nothing is late for it, and it goes on from there."""

import asyncio
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Event, Gaze, Gesture, Head, Mark, Speech, Wait
from engage_hri.schemas.blocks import (
    Block,
    BlockOutcome,
    InterruptBehavior,
    PerformBlock,
)  # fmt: skip
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.perform import steering
from engage_hri.services.realizer.perform.steering import Holds
from engage_hri.services.requests.ends import RequestRefused
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.planning import timed
from tests.realizer.stage import FakeRecognition, after, block, stage, together
from tests.realizer.steering import steered
from tests.realizer.test_properties import blocks

BEAT = Gesture(id="beat", lexeme="BEAT", mode="RIGHT_HAND")
"""Takes 2.25 s: 0.5, 0.25, 0.5, 0.25, 0.25, 0.5."""
STORY = Speech(id="s", text="one two three", marks=(Mark("m1", 3), Mark("m2", 7)))
"""A second to each mark."""


@pytest.mark.parametrize("name", ["", "b"])
async def test_a_block_that_is_held_goes_on_from_there_and_nothing_is_late(name: str) -> None:
    made = block((BEAT, STORY, Wait(id="w", duration=1.5), Gaze(id="g", target="a")), together("w:end+1", "g:start"))
    async with stage() as free:
        await free.perform(made)
    async with stage() as seen:
        performing = seen.ask(made)
        await asyncio.sleep(0.6)
        assert await steered(seen, "hold", name) == ("b",)
        await asyncio.sleep(20.0)
        standing = dict(seen.times())
        await asyncio.sleep(20.0)
        assert seen.times() == standing
        assert await steered(seen, "continue", name) == ("b",)
        outcome = await performing.outcome

    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "done"
    assert seen.warnings() == []
    held, unheld = seen.times(), free.times()
    assert held.keys() == unheld.keys()
    assert (held["beat:ready"], held["s:start"]) == (unheld["beat:ready"], unheld["s:start"])
    assert held["beat:stroke"] == pytest.approx(40.6 + 0.5)  # it had come to the hold point before the stroke
    assert held["w:end"] == pytest.approx(unheld["w:end"] + 40.0)
    assert held["g:start"] == pytest.approx(unheld["g:start"] + 40.0)
    assert [each.text for each in outcome.spoken] == ["one two three"]


async def test_one_behavior_is_held_and_those_that_are_tied_to_it_wait() -> None:
    async with stage() as seen:
        performing = seen.ask(block((BEAT, STORY, Wait(id="w", duration=3.0)), after("beat:end", "s:start")))
        await asyncio.sleep(0.2)
        await steered(seen, "hold", "b", "beat")
        await asyncio.sleep(10.0)
        assert (seen.times()["w:end"], "s:start" in seen.times()) == (3.0, False)
        await steered(seen, "continue", "b", "beat")
        await performing.outcome

    assert seen.times()["s:start"] == pytest.approx(10.2 + 1.5)
    assert seen.warnings() == []


async def test_what_comes_while_the_robot_is_held_waits_until_it_continues() -> None:
    async with stage() as seen:
        assert await steered(seen, "hold") == ()
        performing = seen.ask(block((BEAT,)))
        await asyncio.sleep(5.0)
        assert seen.body.commands == []
        assert await steered(seen, "continue") == ("b",)
        await performing.outcome

    assert seen.times()["beat:start"] == pytest.approx(5.0)
    assert seen.warnings() == []


async def test_to_continue_the_robot_lets_everything_go_and_to_continue_a_block_only_that() -> None:
    async with stage() as seen:
        one, two = seen.ask(block((BEAT,), id="one")), seen.ask(block((STORY,), id="two"))
        await asyncio.sleep(0.1)
        for held in (("one", ""), ("two", "s"), ("", "")):
            await steered(seen, "hold", *held)
        await steered(seen, "continue", "one")
        await asyncio.sleep(5.0)
        assert not one.outcome.done()
        await steered(seen, "continue")
        await asyncio.gather(one.outcome, two.outcome)

    assert seen.warnings() == []


async def test_what_is_held_for_too_long_is_stopped() -> None:
    async with stage(config=RealizerConfig(longest_hold=7.0)) as seen:
        performing = seen.ask(block((BEAT,)))
        await asyncio.sleep(1.0)
        await steered(seen, "hold")
        before = asyncio.get_running_loop().time()
        outcome = await performing.outcome
        assert asyncio.get_running_loop().time() - before == pytest.approx(7.0, abs=0.6)
        after_that = await seen.perform(block((BEAT,), id="next"))

    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "interrupted"
    assert "realizer.longest_hold" in str(outcome.fault)
    assert after_that.status == "done"


async def test_a_realizer_that_has_ended_counts_no_longer_for_how_long_it_was_held() -> None:
    asked: list[float] = []

    class Noting(Holds):
        def expired(self, now: float, longest: float) -> list[tuple[str, str]]:
            asked.append(now)
            return super().expired(now, longest)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(steering, "Holds", Noting)
        async with stage(config=RealizerConfig(longest_hold=7.0)) as seen:
            await steered(seen, "hold")
        await asyncio.sleep(20.0)

    assert asked == []


async def test_an_event_is_given_its_time_without_that_for_which_it_was_held() -> None:
    """Its decision never comes: it ends after the 12 s that recognition has promised."""
    pair = Event(id="e", kind="adjacency_pair", responder="human")
    made = block((pair, Wait(id="w")), together("e:end", "w:end"))
    async with stage(recognition=FakeRecognition({"e": None}), config=RealizerConfig(longest_hold=1000.0)) as seen:
        performing = seen.ask(made)
        await asyncio.sleep(1.0)
        await steered(seen, "hold")
        await asyncio.sleep(100.0)
        assert "e:end" not in seen.times()
        await steered(seen, "continue")
        await performing.outcome

    assert seen.times()["e:end"] == pytest.approx(112.0)


@pytest.mark.parametrize("named", [("nobody", ""), ("b", "nothing"), ("nobody", "beat")])
async def test_what_is_not_performed_cannot_be_held(named: tuple[str, str]) -> None:
    async with stage() as seen:
        performing = seen.ask(block((BEAT,)))
        await asyncio.sleep(0.1)
        with pytest.raises(RequestRefused, match="not being performed"):
            await steered(seen, "hold", *named)
        await performing.outcome


@settings(max_examples=share_of(60), deadline=None)
@given(blocks(), st.integers(0, 10_000))
def test_whatever_is_held_and_let_go_at_random_each_block_has_the_end_that_it_has_without(
    made: Block, seed: int
) -> None:
    async def main(holds: bool) -> tuple[str, tuple[str, ...], list[str]]:
        chance = random.Random(seed)
        async with stage(FakeBody(elastic=(0.5, 4.0)), config=RealizerConfig(longest_hold=1000.0)) as seen:
            performing = seen.ask(made)
            while holds and not performing.outcome.done():
                await asyncio.sleep(chance.choice((0.0, 0.1, 0.4, 1.3)))
                behavior = chance.choice(("", *(each.id for each in made.behaviors)))
                for to in ("hold", "continue"):
                    try:
                        await steered(seen, to, "b", behavior)
                    except RequestRefused:
                        break
                    await asyncio.sleep(chance.choice((0.0, 0.3, 30.0)) if to == "hold" else 0.0)
            try:
                outcome = await performing.outcome
            except RequestRefused:
                return "refused", (), []
        assert isinstance(outcome, BlockOutcome)
        return outcome.status, outcome.dropped, [str(each.kind) for each in seen.warnings()]

    without, held = run_virtual(main(False)), run_virtual(main(True))

    assert held[:2] == without[:2]
    assert set(held[2]) <= set(without[2])


@pytest.mark.parametrize("is_planned_again", [False, True])
async def test_a_fixed_time_is_later_by_the_time_of_the_hold(is_planned_again: bool) -> None:
    """Also for what comes there by prediction, and if the block is planned again after the hold."""
    nod = Head(id="n", lexeme="NOD")
    made = block((timed(BEAT, start="0.2", end="6"), timed(nod, stroke="5"), Wait(id="w", duration=2.0)))
    async with stage() as seen:
        performing = seen.ask(made)
        await asyncio.sleep(0.1)
        await steered(seen, "hold", "b")
        await asyncio.sleep(3.0)
        await steered(seen, "continue", "b")
        if is_planned_again:
            await asyncio.sleep(0.5)
            seen.requests.send(keys.BLOCK, InterruptBehavior(id="i", requester="test", block="b", behavior="w"))
        await performing.outcome

    times = seen.times()
    assert (times["beat:start"], times["beat:end"]) == (pytest.approx(3.2), pytest.approx(9.0))
    assert times["n:stroke"] == pytest.approx(8.0)
    assert [each.kind for each in seen.warnings()] == ["INTERRUPTED"] * is_planned_again


async def test_who_comes_late_to_an_instant_since_it_was_held_is_not_late() -> None:
    async with stage() as seen:
        performing = seen.ask(block((BEAT, STORY), together("beat:stroke", "s:m1")))
        await asyncio.sleep(0.9)  # the stroke is under way, and comes at 1.0
        await steered(seen, "hold", "b", "s")
        await asyncio.sleep(5.0)
        await steered(seen, "continue", "b")
        await performing.outcome

    assert seen.warnings() == []


async def test_what_is_tied_to_words_that_were_held_comes_with_them() -> None:
    async with stage() as seen:
        performing = seen.ask(block((timed(BEAT, stroke_start="s:m2-0.2"), STORY)))
        await asyncio.sleep(1.5)
        await steered(seen, "hold", "b")
        await asyncio.sleep(5.0)
        await steered(seen, "continue", "b")
        await performing.outcome

    times = seen.times()
    assert times["beat:stroke_start"] == pytest.approx(times["s:m2"] - 0.2)
    assert seen.warnings() == []


@pytest.mark.parametrize("since", [0.3, 1.4, 2.7, 33.3])
async def test_a_hold_expires_whenever_it_began(since: float) -> None:
    """A time that is rounded must not make the realizer look for what has expired without end."""
    async with stage() as seen:
        performing = seen.ask(block((Wait(id="w", duration=100.0),)))
        await asyncio.sleep(since)
        await steered(seen, "hold", "b")
        outcome = await performing.outcome
        at = asyncio.get_running_loop().time()

    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "interrupted"
    assert at == pytest.approx(since + RealizerConfig().longest_hold, abs=0.6)


@pytest.mark.parametrize("ends", ["interrupted", "by itself"])
async def test_a_hold_of_a_behavior_ends_with_it(ends: str) -> None:
    fails = FakeBody({"beat": Script(fail="stroke_end")})
    async with stage(None if ends == "interrupted" else fails) as seen:
        performing = seen.ask(block((BEAT, Wait(id="w", duration=100.0))))
        await asyncio.sleep(0.2 if ends == "interrupted" else 1.3)  # at 1.3 s on its way to where it fails
        await steered(seen, "hold", "b", "beat")
        await asyncio.sleep(1.0)
        if ends == "interrupted":
            request = InterruptBehavior(id="i", requester="test", block="b", behavior="beat")
            await seen.requests.send(keys.BLOCK, request).outcome
        outcome = await performing.outcome
        at = asyncio.get_running_loop().time()

    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "done"
    assert at == pytest.approx(100.0, abs=0.1)


async def test_a_behavior_that_is_held_for_too_long_is_stopped_and_its_block_goes_on() -> None:
    async with stage(config=RealizerConfig(longest_hold=7.0)) as seen:
        performing = seen.ask(block((BEAT, Wait(id="w", duration=20.0))))
        await asyncio.sleep(0.2)
        await steered(seen, "hold", "b", "beat")
        outcome = await performing.outcome

    assert isinstance(outcome, BlockOutcome)
    assert (outcome.status, outcome.interrupted) == ("done", ("beat",))


async def test_a_behavior_that_can_wait_nowhere_any_more_is_not_held() -> None:
    async with stage() as seen:
        performing = seen.ask(block((BEAT, STORY)))
        await seen.seen("beat:relax")
        with pytest.raises(RequestRefused, match="nothing of it can wait any more"):
            await steered(seen, "hold", "b", "beat")
        assert await steered(seen, "hold", "b", "s") == ("b",)
        await asyncio.sleep(5.0)
        assert "beat:end" in seen.times()
        assert "s:end" not in seen.times()
        await steered(seen, "continue", "b")
        await performing.outcome


async def test_a_refused_block_of_the_same_id_lets_nothing_go() -> None:
    async with stage() as seen:
        performing = seen.ask(block((STORY,)))
        await asyncio.sleep(0.5)
        await steered(seen, "hold", "b")
        again = PerformBlock(id="again", requester="test", block=block((Wait(id="w", duration=1.0),)))
        with pytest.raises(RequestRefused):
            await seen.requests.send(keys.BLOCK, again).outcome
        other = seen.ask(block((Wait(id="w", duration=3.0),), id="c"))
        await asyncio.sleep(0.5)
        await steered(seen, "hold", "c")
        await steered(seen, "continue", "c")
        await other.outcome
        assert not performing.outcome.done()
        await steered(seen, "continue", "b")
        outcome = await performing.outcome

    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "done"


async def test_once_a_held_block_has_ended_others_are_late_again() -> None:
    made = block(
        (Wait(id="w", duration=5.0), BEAT), together("beat:start", "w:end"), together("w:end+1", "beat:stroke")
    )
    async with stage(body=FakeBody(estimates={"beat": (0.1, 0.1, 0.1, 0.1, 0.1, 0.1)})) as seen:
        held, other = seen.ask(block((Wait(id="w", duration=50.0),), id="a")), seen.ask(made)
        await asyncio.sleep(0.5)
        await steered(seen, "hold", "a")
        await asyncio.sleep(0.5)
        await steered(seen, "stop", "a")
        await held.outcome
        await other.outcome

    assert any(each.kind == "LATE" for each in seen.warnings())


NOD = Head(id="nod", lexeme="NOD")


@pytest.mark.parametrize("since", [0.2, 1.5, 2.3])
async def test_what_is_tied_to_a_held_behavior_does_not_go_on_without_it(since: float) -> None:
    """The nod cannot wait at its stroke, so it waits before it sets out."""
    ties = (together("beat:start", "w:end"), together("nod:stroke", "beat:stroke"))
    async with stage() as seen:
        performing = seen.ask(block((Wait(id="w", duration=2.0), BEAT, NOD), *ties))
        await asyncio.sleep(since)
        await steered(seen, "hold", "b", "beat")
        await asyncio.sleep(9.0)
        await steered(seen, "continue", "b", "beat")
        outcome = await performing.outcome

    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "done"
    times = seen.times()
    assert times["nod:stroke"] == pytest.approx(times["beat:stroke"], abs=0.02)
    assert times["beat:stroke"] > since + 9.0


@pytest.mark.parametrize("held", ["", "beat", "s"])
async def test_words_with_an_offset_to_a_stroke_keep_it_after_a_hold(held: str) -> None:
    ties = (together("beat:start", "w:end"), together("s:start+0.4", "beat:stroke"))
    async with stage() as seen:
        performing = seen.ask(block((Wait(id="w", duration=1.0), BEAT, STORY), *ties))
        await asyncio.sleep(0.5)
        await steered(seen, "hold", "b" if held else "", held)
        await asyncio.sleep(6.0)
        await steered(seen, "continue", "b" if held else "", held)
        outcome = await performing.outcome

    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "done"
    times = seen.times()
    assert times["beat:stroke"] - times["s:start"] == pytest.approx(0.4, abs=0.02)
