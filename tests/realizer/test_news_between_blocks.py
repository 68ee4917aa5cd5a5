"""What a block tells another of a part that it takes over, and what it need not tell."""

import asyncio
from contextlib import suppress

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gesture, Head, Speech
from engage_hri.schemas.blocks import NetPlanned, PredictionFeedback
from engage_hri.services.requests.ends import Pending
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.planning import timed
from tests.realizer.puppet import Puppet, bml, puppet
from tests.realizer.stage import Stage, block, stage
from tests.realizer.test_sharing import instants, mispredicted

RIGHT = Gesture(id="q", lexeme="BEAT", mode="RIGHT_HAND")
"""2.25 s; its stroke is over after 1.5."""
TAKER = block((timed(RIGHT, start="t:start"), Speech(id="t", text="five"), Head(id="n", lexeme="NOD")), id="two")
"""Its nod fails while its gesture waits for the stroke of another block's."""


async def seen_beside() -> tuple[Stage, list[tuple[float, str]]]:
    """All that is seen of it beside another block, and when nets were published, of which block."""
    nets: list[tuple[float, str]] = []
    async with stage(FakeBody({"n": Script(fail="stroke_start")})) as seen:
        watching = asyncio.create_task(_watch(seen, nets), name="watch nets")
        await asyncio.sleep(0)
        first = seen.ask(block((RIGHT,), id="one"))
        await seen.seen("q:ready", "one")
        second = seen.ask(TAKER)
        await first.outcome
        await second.outcome
        watching.cancel()
        with suppress(asyncio.CancelledError):
            await watching
    assert [(each.block, each.behavior) for each in seen.warnings()] == [("two", "n")]
    return seen, nets


async def _watch(seen: Stage, nets: list[tuple[float, str]]) -> None:
    bus = seen.hub.join("watcher")
    try:
        with bus.subscribe(keys.NET) as inbox:
            async for received in inbox:
                if isinstance(received.message, NetPlanned):
                    nets.append((bus.now(), received.message.block))
    finally:
        await bus.leave()


async def test_a_takeover_is_planned_once_and_kept_when_the_taker_is_planned_again() -> None:
    """The taker's nod is lost. The other, which has to do with the taker's arm only, expects nothing else."""
    seen, _ = await seen_beside()

    times = instants(seen)
    assert times["one:q:stroke_end"] == times["one:q:end"] == times["two:q:start"] == 1.5
    assert mispredicted(seen) == []
    told = [each for each in seen.feedback if isinstance(each, PredictionFeedback) and each.block == "one"]
    ends = [point.time for each in told for point in each.points if point.sync == "end"]
    assert ends == [2.25, 1.5]


async def test_who_is_told_the_same_takeover_again_is_not_planned_again() -> None:
    """Its net is published when it is planned, and it ends before that is repeated. The nod is lost at 0.75 s."""
    _, nets = await seen_beside()

    assert {at for at, block in nets if block == "one"} == {0.0, 0.55}  # planned at 0.5, told in a moment
    assert (0.8, "two") in nets


ARM = '<gesture id="q" lexeme="BEAT" mode="RIGHT_HAND"/>'


async def second_while_first_is_being_ended(body: Puppet, first: Pending, second: Pending) -> None:
    """Perform the second block while the first still has its behavior, and then let that end."""
    async with asyncio.timeout(5.0):
        await body.do("q", "start", "end", every=1.0, block="two")
    assert not first.outcome.done()
    await second.outcome
    body.end("q", "aborted", block="one")
    await first.outcome


@pytest.mark.parametrize(
    "document",
    [ARM, ARM.replace("/>", ' start="0"/>'), '<speech id="q"><text>so</text></speech>'],
)
async def test_what_a_block_that_is_being_ended_had_planned_counts_no_more(document: str) -> None:
    """It was cancelled, but the body is slow to say that it has ended. Who comes now takes the part from the body."""
    async with puppet() as body:
        body.aborts = False
        first = body.ask(bml(document, id="one"))
        await body.told("q", block="one")
        body.reach("q", "start", block="one")
        body.requests.cancel("r-one")
        await body.until(lambda: body.aborted)
        second = body.ask(bml(document, id="two"))
        await second_while_first_is_being_ended(body, first, second)

    assert body.time("q:start", "two") == 0.0
    assert body.warnings() == []


async def test_who_is_to_begin_while_another_block_is_being_ended_is_not_planned_again_for_that() -> None:
    """By plan the arm is free by then: it is not, but the other is to end anyway."""
    async with puppet() as body:
        body.aborts = False
        first = body.ask(bml(ARM, id="one"))
        await body.told("q", block="one")
        body.reach("q", "start", block="one")
        second = body.ask(bml(ARM.replace("/>", ' start="3"/>'), id="two"))
        await second.accepted
        body.requests.cancel("r-one")
        await second_while_first_is_being_ended(body, first, second)

    assert body.time("q:start", "two") == 3.0
    assert body.warnings() == []


async def test_a_part_that_a_new_plan_takes_is_handed_over_by_plan() -> None:
    """The other's gesture was to come long after this one's. What its words wait for is lost: it comes at once."""
    words = timed(Speech(id="t", text="five"), start="n:end + 5")
    later = (Head(id="n", lexeme="NOD"), words, timed(RIGHT, start="t:start"))
    async with stage(FakeBody({"n": Script(fail="stroke_start")})) as seen:
        first = seen.ask(block((RIGHT,), id="one"))
        await seen.seen("q:ready", "one")
        second = seen.ask(block(later, id="two"))
        await first.outcome
        await second.outcome

    times = instants(seen)
    assert times["one:q:end"] == times["two:q:start"] == 1.5
    assert mispredicted(seen) == []
