"""Stop what is performed on request: it is interrupted, tells what was said, and its hold is over before that."""

import asyncio

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gesture, Mark, Speech
from engage_hri.schemas.blocks import BlockOutcome, Held
from tests.realizer.stage import block, stage
from tests.realizer.steering import steered

BEAT = Gesture(id="beat", lexeme="BEAT", mode="RIGHT_HAND")
"""Takes 2.25 s."""
STORY = Speech(id="s", text="one two three", marks=(Mark("m1", 3), Mark("m2", 7)))
"""A second to each mark."""


async def test_stopped_is_interrupted_and_tells_what_was_said() -> None:
    async with stage() as seen:
        one, two = seen.ask(block((BEAT,), id="one")), seen.ask(block((STORY,), id="two"))
        await asyncio.sleep(1.2)
        await steered(seen, "hold")
        await asyncio.sleep(1.0)
        assert await steered(seen, "stop") == ("one", "two")
        outcomes = [await one.outcome, await two.outcome]
        after_that = await seen.perform(block((BEAT,), id="three"))

    assert [getattr(each, "status", "") for each in outcomes] == ["interrupted", "interrupted"]
    assert isinstance(outcomes[1], BlockOutcome)
    assert [(each.text, each.complete) for each in outcomes[1].spoken] == [("one", False)]
    assert after_that.status == "done"


async def test_that_a_stopped_block_is_no_longer_held_is_told_before_its_outcome() -> None:
    async with stage() as seen:
        with seen.hub.join("watcher").subscribe(keys.HELD, keys.request_state("realizer")) as inbox:
            seen.ask(block((STORY,)))
            await asyncio.sleep(1.2)
            await steered(seen, "hold", "b")
            await steered(seen, "stop", "b")
            told = [received.message for _ in range(len(inbox)) if (received := await inbox.next())]

    of_it = [each for each in told if isinstance(each, Held | BlockOutcome)]
    assert [type(each) for each in of_it[-3:]] == [Held, Held, BlockOutcome]
    assert [bool(each.holds) for each in of_it[-3:] if isinstance(each, Held)] == [True, False]


async def test_a_behavior_that_is_stopped_is_interrupted_and_its_block_is_done() -> None:
    async with stage() as seen:
        performing = seen.ask(block((BEAT, STORY)))
        await asyncio.sleep(0.2)
        assert await steered(seen, "stop", "b", "beat") == ("b",)
        outcome = await performing.outcome

    assert isinstance(outcome, BlockOutcome)
    assert (outcome.status, outcome.interrupted) == ("done", ("beat",))
