"""A block that is tied to words of another prepares for them: strokes come just in time, and no arm before that."""

import asyncio
from contextlib import ExitStack

import pytest

from engage_hri.schemas.behaviors import Gaze, Gesture, Mark, Pointing, Speech, Wait
from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.points import Point
from engage_hri.services.realizer.together.live_blocks import LiveBlocks
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import Stage, after, block, stage, together

WORDS = Speech(id="s", text="one two three four", marks=(Mark("m1", 3), Mark("m2", 7), Mark("m3", 13)))
"""Four seconds, told of each second."""
MORE = Speech(id="t", text="five")
BEAT = Gesture(id="g", lexeme="BEAT", mode="RIGHT_HAND")
POINT = Pointing(id="p", target="a", mode="RIGHT_HAND")
LOOK = Gaze(id="z", target="a")


def follower(*behaviors: object, tie: str, id: str = "two", words: str = "one:s:end") -> Block:
    return block((MORE, *behaviors), after(words, "t:start"), together(tie, "t:start"), id=id)  # type: ignore[arg-type]


async def performed(seen: Stage, *blocks: Block) -> None:
    await asyncio.gather(*[seen.ask(each).outcome for each in blocks])


@pytest.mark.parametrize(
    ("behavior", "tie", "begins"),
    [
        (BEAT, "g:stroke", 2.375),
        (POINT, "p:stroke_start", 2.875),
        (POINT, "p:stroke", 2.375),
        (LOOK, "z:stroke", 3.5),
    ],
)
async def test_a_stroke_meets_the_first_word_as_soon_as_the_words_before_have_ended(
    behavior: Gesture | Pointing | Gaze, tie: str, begins: float
) -> None:
    async with stage() as seen:
        await performed(seen, block((WORDS,), id="one"), follower(behavior, tie=tie))

    times = seen.times("two")
    assert times[f"{behavior.id}:start"] == begins
    assert times[tie] == times["t:start"] == seen.times("one")["s:end"] == 4.0
    assert seen.warnings() == []


async def test_who_speaks_slowly_is_seen_to_and_waited_for() -> None:
    async with stage(FakeBody({"s": Script(slow=1.5)})) as seen:
        await performed(seen, block((WORDS,), id="one"), follower(BEAT, tie="g:stroke"))

    times = seen.times("two")
    assert (times["g:start"], times["g:stroke"], times["t:start"]) == (4.375, 6.0, 6.0)


async def test_a_hold_before_the_words_delays_what_prepares_for_their_end() -> None:
    held = block((WORDS, Wait(id="w", duration=3.0)), after("w:end", "s:start"), id="one")
    async with stage() as seen:
        await performed(seen, held, follower(POINT, tie="p:stroke_start"))

    assert seen.times("two")["p:start"] == 5.875
    assert seen.times("two")["t:start"] == seen.times("one")["s:end"] == 7.0


async def test_words_never_begin_before_those_they_follow_even_if_these_last_longer_than_foreseen() -> None:
    async with stage(FakeBody({"s": Script(durations=(1.0, 1.0, 1.0, 2.0))})) as seen:
        await performed(seen, block((WORDS,), id="one"), follower(POINT, tie="p:stroke_start"))

    times = seen.times("two")
    assert (times["p:start"], times["p:stroke_start"], times["t:start"]) == (2.875, 5.0, 5.0)
    assert seen.body.stops == ["p:stroke_start"]


async def test_what_is_foreseen_is_handed_on_from_block_to_block() -> None:
    second = follower(POINT, tie="p:stroke_start")
    other_arm = Pointing(id="p", target="b", mode="LEFT_HAND")
    third = follower(other_arm, tie="p:stroke_start", id="three", words="two:t:end")
    async with stage(FakeBody({"s": Script(slow=1.5)})) as seen:
        await performed(seen, block((WORDS,), id="one"), second, third)

    assert seen.times("two")["t:start"] == 6.0
    assert (seen.times("three")["p:start"], seen.times("three")["t:start"]) == (5.875, 7.0)


async def test_the_prediction_of_a_block_tells_what_others_foresee() -> None:
    async with stage() as seen:
        asked = [seen.ask(block((WORDS,), id="one")), seen.ask(follower(BEAT, tie="g:stroke"))]
        await seen.seen("s:m1", "one")
        told = [each for each in seen.feedback if type(each).__name__ == "PredictionFeedback" and each.block == "two"]  # type: ignore[attr-defined]
        await asyncio.gather(*[each.outcome for each in asked])

    points = {f"{each.behavior}:{each.sync}": each.time for each in told[-1].points}  # type: ignore[attr-defined]
    assert (points["g:start"], points["t:start"]) == (2.375, 4.0)


async def test_words_that_are_dropped_are_waited_for_no_longer() -> None:
    async with stage(FakeBody({"s": Script(fail="m1")})) as seen:
        going_on = block((WORDS, Wait(id="w", duration=20.0)), id="one")
        await performed(seen, going_on, follower(BEAT, tie="g:stroke"))

    assert (seen.times("two")["g:start"], seen.times("two")["t:start"]) == (1.0, 2.25)


async def test_nobody_sets_out_for_words_after_those_that_are_overdue_nor_for_what_follows_them() -> None:
    other_arm = Pointing(id="p", target="b", mode="LEFT_HAND")
    third = follower(other_arm, tie="p:stroke_start", id="three", words="two:t:end")
    async with stage(FakeBody({"s": Script(stall="m2")})) as seen:
        await performed(seen, block((WORDS,), id="one"), follower(BEAT, tie="g:stroke"), third)

    times = seen.times("two")
    assert (times["g:start"], times["g:stroke"], times["t:start"]) == (10.0, 11.25, 11.25)
    assert (seen.times("three")["p:start"], seen.times("three")["t:start"]) == (11.125, 12.25)


async def test_a_gesture_in_words_to_come_is_not_held_up_during_those_before() -> None:
    marked = Speech(id="t", text="five six", marks=(Mark("m", 4),))
    tied = block((marked, BEAT), after("one:s:end", "t:start"), together("g:stroke", "t:m"), id="two")
    async with stage() as seen:
        await performed(seen, block((WORDS,), id="one"), tied)

    times = seen.times("two")
    assert (times["g:start"], times["g:stroke"], times["t:m"]) == (3.375, 5.0, 5.0)
    assert seen.body.stops == ["g:stroke_start"]


async def test_nobody_is_late_for_a_look_that_another_block_has_ended() -> None:
    later = block((Gaze(id="y", target="b"),), together("y:start", "one:s:m1"), id="two")
    async with stage() as seen:
        await performed(seen, block((WORDS, LOOK), id="one"), later)

    assert seen.times("one")["z:end"] == 1.0
    assert seen.warnings() == []


class Link:
    """A block that expects its own end a second after that of the block it is tied to."""

    def __init__(self, block: str, live_blocks: LiveBlocks) -> None:
        self.block = block
        self.live_blocks = live_blocks
        self.told: list[float] = []

    def foresee(self, point: Point, at: float) -> None:
        self.told.append(at)
        self.live_blocks.foresee(self.block, {Point("s", "end"): at + 1.0})

    def hear(self, point: Point, at: float) -> None:
        raise AssertionError

    def miss(self, behaviors: object) -> None:
        """The end of the test."""


def test_foresight_goes_through_a_chain_of_any_length() -> None:
    live_blocks = LiveBlocks(lambda: 0.0)
    links = [Link(f"b{number}", live_blocks) for number in range(2000)]
    with ExitStack() as live:
        for number, link in enumerate(links):
            live.enter_context(live_blocks.opened(block((WORDS,), id=link.block)))
            if number:
                ties = [Point(f"b{number - 1}:s", "end")]
                live.enter_context(live_blocks.followed(link, ties))
        live_blocks.foresee("b0", {Point("s", "end"): 1.0})

    assert [link.told for link in links[1:]] == [[float(number)] for number in range(1, 2000)]


def test_blocks_that_never_agree_on_a_time_are_told_twenty_times_and_go_on_with_what_is_measured() -> None:
    """Each expects its end a second after the other's. The next news from outside starts them anew."""

    live_blocks = LiveBlocks(lambda: 0.0)
    one, two = Link("one", live_blocks), Link("two", live_blocks)
    with ExitStack() as live:
        for rival in (one, two):
            live.enter_context(live_blocks.opened(block((WORDS,), id=rival.block)))
        live.enter_context(live_blocks.followed(one, [Point("two:s", "end")]))
        live.enter_context(live_blocks.followed(two, [Point("one:s", "end")]))
        live_blocks.foresee("one", {Point("s", "end"): 0.0})
        first = list(two.told)
        live_blocks.foresee("one", {Point("s", "end"): 100.0})

    assert first == [2.0 * number for number in range(20)]
    assert two.told[20:] == [100.0 + 2.0 * number for number in range(20)]
