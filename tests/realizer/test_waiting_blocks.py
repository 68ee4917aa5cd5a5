"""Blocks that wait for their turn: when their points are expected, and nobody waits for them in a circle."""

import asyncio
from itertools import pairwise

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    BlockBehavior,
    FaceLexeme,
    Gaze,
    Gesture,
    Head,
    Pointing,
    Posture,
    Speech,
    Wait,
)
from engage_hri.schemas.blocks import BehaviorInterrupted, Block, BlockOutcome, Steer
from engage_hri.services.requests.ends import RequestRefused
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.planning import timed
from tests.realizer.stage import block, stage
from tests.realizer.steering import interrupt, steered
from tests.realizer.test_sharing import MORE, RIGHT, WORDS, instants, mispredicted, told

SMILE = FaceLexeme(id="f", lexeme="SMILE")
"""2 s; on target after 0.5."""
STANDING = Posture(id="u", stance="STANDING")


def appended(*behaviors: BlockBehavior, id: str) -> Block:
    return block(behaviors, id=id, composition="APPEND")


async def test_who_is_tied_to_a_block_that_waits_sets_out_in_time_for_it() -> None:
    """The first block takes four seconds; in the second the stroke comes a second after the start."""
    tied = block((timed(SMILE, stroke="two:q:stroke-0.25"),), id="three")
    waiting = appended(timed(RIGHT, stroke="1.25"), id="two")
    seen, _ = await told((0.0, block((WORDS,), id="one")), (0.5, waiting), (1.0, tied))

    assert instants(seen)["two:q:stroke"] == 5.25
    assert instants(seen)["three:f:stroke"] == 5.0
    assert (seen.warnings(), mispredicted(seen)) == ([], [])


async def test_dates_pass_through_several_blocks_that_wait() -> None:
    one, two = block((WORDS,), id="one"), appended(MORE, id="two")
    three = appended(timed(RIGHT, stroke="1.25"), id="three")
    tied = block((timed(SMILE, stroke="three:q:stroke-0.25"),), id="four")
    seen, _ = await told((0.0, one), (0.0, two), (0.0, three), (0.0, tied))

    assert instants(seen)["three:q:stroke"] == 4.0 + 1.0 + 1.25
    assert instants(seen)["four:f:stroke"] == 6.0
    assert (seen.warnings(), mispredicted(seen)) == ([], [])


async def test_a_date_moves_with_the_block_that_is_waited_for() -> None:
    tied = block((timed(SMILE, stroke="two:q:stroke-0.25"),), id="three")
    waiting = appended(timed(RIGHT, stroke="1.25"), id="two")
    slow = FakeBody({"s": Script(slow=1.5)})
    seen, _ = await told((0.0, block((WORDS,), id="one")), (0.5, waiting), (1.0, tied), body=slow)

    assert instants(seen)["two:q:stroke"] == 6.0 + 1.25
    assert instants(seen)["three:f:stroke"] == 7.0
    assert seen.warnings() == []


async def test_the_end_of_a_block_that_waits_has_a_date_too() -> None:
    tied = block((timed(SMILE, stroke="two:bml:end-0.25"),), id="three")
    seen, _ = await told((0.0, block((WORDS,), id="one")), (0.5, appended(MORE, id="two")), (1.0, tied))

    assert instants(seen)["three:f:stroke"] == 4.75
    assert seen.warnings() == []


# -- circles of ties and parts ---------------------------------------------------------------------------------------


async def test_who_waits_for_a_block_is_not_in_its_way() -> None:
    """The third is tied to the second, has the part that the second needs, and came before its turn."""
    waiting = appended(timed(STANDING, start="0.5"), timed(RIGHT, start="1"), id="two")
    tied = block((timed(replace(STANDING, id="v"), start="two:q:end"), timed(RIGHT, start="0")), id="three")
    seen, outcomes = await told((0.0, block((WORDS,), id="one")), (0.5, waiting), (1.0, tied))

    assert [each.status for each in outcomes] == ["done"] * 3
    times = instants(seen)
    assert times["three:v:start"] == times["two:q:end"]
    assert times["two:u:start"] < times["three:v:start"]


async def test_a_look_that_is_to_be_handed_over_is_kept_up_to_what_the_other_waits_for() -> None:
    """The third waits for the end of the posture, and is to take its part: it takes nothing before that."""
    one = appended(Gesture(id="o", lexeme="WAVE"), timed(STANDING, start="1"), id="one")
    two = block((timed(STANDING, start="one:u:stroke+2"), timed(MORE, start="one:o:end")), id="two")
    late = block((timed(SMILE, stroke="two:u:end"), timed(STANDING, stroke="two:u:start")), id="three")
    seen, outcomes = await told((0.0, one), (1.0, two), (3.5, late))

    assert [each.status for each in outcomes] == ["done"] * 3
    assert instants(seen)["three:f:stroke"] == instants(seen)["two:u:end"]


async def test_speeches_of_three_blocks_and_a_tie_to_the_one_that_waited_are_said_one_by_one() -> None:
    """The last is planned again as the second begins, at a time at which the third has the voice."""
    words = Speech(id="s", text="one two")
    last = block((words, timed(MORE, start="two:s:end")), id="four")
    sent = (block((words,), id="one"), appended(words, id="two"), block((words, MORE), id="three"), last)
    seen, outcomes = await told(*((0.0, each) for each in sent))

    assert [each.status for each in outcomes] == ["done"] * 4
    times = instants(seen)
    spoken = sorted(
        (at, times[name.removesuffix("start") + "end"])
        for name, at in times.items()
        if name.endswith((":s:start", ":t:start"))
    )
    assert len(spoken) == 6
    assert all(end <= start for (_, end), (start, _) in pairwise(spoken))


async def test_a_turn_that_comes_while_another_block_is_planned_waits_for_that() -> None:
    """The first fails as it begins; the second and the third would both find the voice free."""
    first = block((timed(Pointing(id="p", target="x"), stroke="0"),), id="one")
    words = Speech(id="s", text="one two")
    seen, _ = await told((0.0, first), (0.0, appended(words, id="two")), (0.0, block((words,), id="three")))

    times = instants(seen)
    assert times["two:s:end"] <= times["three:s:start"] or times["three:s:end"] <= times["two:s:start"]


async def test_a_look_to_the_end_of_a_turn_that_waits_does_not_last_for_ever() -> None:
    """A gaze that lasts with its block, in a block that is tied to one that wants the head."""
    waiting = appended(Gaze(id="g", target="y"), MORE, id="two")
    tied = block((Gaze(id="h", target="x"), timed(RIGHT, start="two:t:end")), id="three")
    seen, outcomes = await told((0.0, block((WORDS,), id="one")), (0.0, waiting), (0.0, tied))

    assert [each.status for each in outcomes] == ["done"] * 3
    assert instants(seen)["three:q:start"] == instants(seen)["two:t:end"]


async def test_other_points_of_a_block_and_its_losses_say_nothing_of_its_end() -> None:
    """Others are tied to them; what is tied to a block that waits for that end sets out for the end alone."""
    smile = timed(FaceLexeme(id="f", lexeme="SMILE"), start="second:x:end-0.5")
    ties = [timed(Wait(id=id, duration=seconds), start="0") for id, seconds in (("u", 1.0), ("v", 4.0), ("w", 8.0))]
    async with stage() as seen:
        first = seen.ask(block(ties, id="first"))
        second = seen.ask(block((Wait(id="x", duration=2.0),), id="second", composition="APPEND"))
        third = seen.ask(block((timed(Wait(id="y", duration=1.0), start="first:u:end"), smile), id="third"))
        await asyncio.sleep(2.0)
        await interrupt(seen.requests, "first", "v").outcome
        await asyncio.gather(first.outcome, second.outcome, third.outcome)

    assert seen.times("second")["x:start"] == 0.0
    begun = [each.at.seconds for each in seen.progress("third") if (each.behavior, each.sync) == ("f", "start")]
    assert begun == [pytest.approx(8.0 + 2.0 - 0.5, abs=0.02)]


async def test_a_part_is_not_taken_by_plan_from_a_block_whose_end_the_taker_waits_for() -> None:
    nods = (timed(Head(id="n", lexeme="NOD"), start="0.5"), Wait(id="w", duration=3.0))
    async with stage() as seen:
        asked = [
            seen.ask(block(nods, id="first")),
            seen.ask(block((Wait(id="x", duration=1.0),), id="second", composition="APPEND")),
            seen.ask(block((timed(Wait(id="y", duration=1.0), start="first:n:relax"),), id="third")),
            seen.ask(block((timed(Head(id="m", lexeme="NOD"), start="second:x:start"),), id="fourth")),
        ]
        await asyncio.wait_for(asyncio.gather(*(each.outcome for each in asked)), 60.0)

    assert seen.warnings() == []


@pytest.mark.parametrize("to", ["hold", "stop"])
async def test_a_behavior_of_a_block_that_waits_is_held_or_taken_out_before_it_begins(to: Steer) -> None:
    async with stage() as seen:
        first = seen.ask(block((Wait(id="w", duration=1.0),), id="one"))
        second = seen.ask(appended(MORE, Head(id="n", lexeme="NOD"), id="two"))
        await asyncio.sleep(0.5)
        await steered(seen, to, "two", "t")
        with pytest.raises(RequestRefused, match="block 'two' has no behavior 'tt'"):
            await steered(seen, to, "two", "tt")
        await asyncio.sleep(4.5)
        assert "two:n:end" in instants(seen)
        assert "two:t:start" not in instants(seen)
        if to == "hold":
            await steered(seen, "continue", "two", "t")
        await asyncio.gather(first.outcome, second.outcome)

    outcome = second.outcome.result()
    assert isinstance(outcome, BlockOutcome)
    assert (outcome.status, outcome.interrupted) == ("done", ("t",) if to == "stop" else ())
    assert instants(seen).get("two:t:start") == (5.0 if to == "hold" else None)


async def test_a_behavior_of_a_block_that_waits_is_interrupted_once() -> None:
    async with stage() as seen:
        first = seen.ask(block((Wait(id="w", duration=1.0),), id="one"))
        second = seen.ask(appended(MORE, Head(id="n", lexeme="NOD"), id="two"))
        await asyncio.sleep(0.5)
        said = await interrupt(seen.requests, "two", "t").outcome
        assert isinstance(said, BehaviorInterrupted)
        assert (said.spoken, said.was_done) == ("", False)
        with pytest.raises(RequestRefused, match="it has ended, or was"):
            await steered(seen, "stop", "two", "t")
        await asyncio.gather(first.outcome, second.outcome)

    assert [(each.block, each.behavior, each.kind) for each in seen.warnings()] == [("two", "t", "INTERRUPTED")]
