"""Ids of blocks: free again after the end, and nobody's else before."""

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Speech, Wait
from engage_hri.schemas.blocks import BlockOutcome, BlockProgress, Composition, PerformBlock
from engage_hri.services.requests.ends import Pending, RequestRefused
from tests.realizer.stage import Stage, after, block, stage

STORY = Speech(id="s", text="one")
"""Takes a second."""
COMPOSITIONS: tuple[Composition, ...] = ("MERGE", "APPEND", "REPLACE")


def ask(seen: Stage, request: str, composition: Composition = "MERGE", id: str = "b") -> Pending:
    made = block((STORY, Wait(id="w", duration=2.0)), id=id, composition=composition)
    return seen.requests.send(keys.BLOCK, PerformBlock(id=request, requester="test", block=made))


@pytest.mark.parametrize("composition", COMPOSITIONS)
async def test_the_id_of_a_live_block_is_refused_and_the_live_one_goes_on(composition: Composition) -> None:
    async with stage() as seen:
        first = ask(seen, "r1")
        await seen.seen("s:start")
        with pytest.raises(RequestRefused, match="b: a block of this id is still being performed"):
            await ask(seen, "r2", composition).outcome
        outcome = await first.outcome

    assert isinstance(outcome, BlockOutcome)
    assert (outcome.status, outcome.replaced_by) == ("done", "")
    assert seen.times() == {"w:start": 0.0, "s:start": 0.0, "s:end": 1.0, "w:end": 2.0}
    assert [(each.block, each.kind) for each in seen.warnings()] == [("b", "PARSING_FAILURE")]


@pytest.mark.parametrize("composition", COMPOSITIONS)
async def test_the_id_of_a_block_that_waits_for_its_turn_is_refused_too(composition: Composition) -> None:
    async with stage() as seen:
        first = ask(seen, "r1", id="a")
        waiting = ask(seen, "r2", "APPEND")
        await waiting.accepted
        with pytest.raises(RequestRefused, match="still being performed"):
            await ask(seen, "r3", composition).outcome
        outcomes = [await first.outcome, await waiting.outcome]

    assert [outcome.status for outcome in outcomes if isinstance(outcome, BlockOutcome)] == ["done", "done"]


@pytest.mark.parametrize("composition", COMPOSITIONS)
async def test_after_its_end_an_id_is_free_again(composition: Composition) -> None:
    async with stage() as seen:
        for request in ("r1", "r2"):
            outcome = await ask(seen, request, composition).outcome
            assert isinstance(outcome, BlockOutcome)
            assert outcome.status == "done"

    told = [each.progress for each in seen.feedback if isinstance(each, BlockProgress)]
    assert told == ["start", "end", "start", "end"]
    assert seen.warnings() == []


async def test_who_has_waited_for_his_turn_is_not_tied_to_a_later_block_of_the_id_he_names() -> None:
    async with stage() as seen:
        first = seen.ask(block((STORY,), id="one"))
        others = [seen.ask(block((Wait(id="w", duration=3.0),), id="other"))]
        tied = block((STORY,), after("one:s:end", "s:start"), id="two", composition="APPEND")
        others.append(seen.ask(tied))
        await first.outcome
        again = block((STORY,), after("two:s:end", "s:start"), id="one")
        others.append(seen.requests.send(keys.BLOCK, PerformBlock(id="again", requester="test", block=again)))
        outcomes = [await each.outcome for each in others]

    assert [each.status for each in outcomes if isinstance(each, BlockOutcome)] == ["done"] * 3
    assert seen.times("two") == {"s:start": 0.0, "s:end": 1.0}
    assert seen.times("one")["s:start"] == 3.0
