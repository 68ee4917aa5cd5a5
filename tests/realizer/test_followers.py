"""Blocks that go on with the turn of others: what becomes of them where one of those goes wrong."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gesture, Head, Mark, Speech
from engage_hri.schemas.blocks import Block, BlockOutcome, PerformBlock
from engage_hri.schemas.body import AbortBehavior
from engage_hri.services.requests.ends import Pending, RequestRefused
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import Stage, after, block, stage, together

WORDS = Speech(id="s", text="one two three four", marks=(Mark("m1", 3), Mark("m2", 7)), required=True)
"""Three seconds."""


def fragment(id: str, *before: str) -> Block:
    """Words after words, and a gesture that meets the first of them."""
    words = Speech(id="t", text="five")
    beat = Gesture(id=f"beat-{id}", lexeme="BEAT", mode="LEFT_HAND" if id == "three" else "RIGHT_HAND")
    ties = [after(point, "t:start") for point in before]
    return block((words, beat), *ties, together(f"{beat.id}:stroke", "t:start"), id=id)


@asynccontextmanager
async def turn(body: FakeBody, first: Block | None = None) -> AsyncIterator[tuple[Stage, list[Pending]]]:
    """Three fragments, each follows all those before it."""
    async with stage(body) as seen:
        one = seen.ask(first or block((WORDS,), id="one"))
        two = seen.ask(fragment("two", "one:s:end"), "one")
        yield seen, [one, two, seen.ask(fragment("three", "two:t:end"), "one", "two")]


async def outcomes(asked: list[Pending]) -> list[BlockOutcome]:
    made = await asyncio.gather(*[each.outcome for each in asked])
    assert all(isinstance(each, BlockOutcome) for each in made)
    return made  # type: ignore[return-value]


def assert_only_the_first_moved(seen: Stage, at: float, status: str) -> None:
    assert (seen.progress("two"), seen.progress("three")) == ([], [])
    assert {behavior for _, behavior, _ in seen.body.commands} == {"s"}
    ends = {end.block: (end.at.seconds, end.status) for end in seen.ends()}
    assert ends == {"one": (at, status), "two": (at, "interrupted"), "three": (at, "interrupted")}
    assert len(seen.ends()) == 3


async def test_words_that_fail_and_must_not_are_followed_by_none() -> None:
    async with turn(FakeBody({"s": Script(fail="m1")})) as (seen, asked):
        made = await outcomes(asked)

    assert_only_the_first_moved(seen, 1.0, "failed")
    assert [str(each.fault) for each in made] == [
        "one: s: overheated",
        "two: one, which it follows, failed: overheated",
        "three: one, which it follows, failed: overheated",
    ]


async def test_a_block_of_which_nothing_was_performed_has_failed_and_who_follows_it_goes_on() -> None:
    motions = (Gesture(id="g", lexeme="BEAT"), Head(id="n", lexeme="NOD"))
    body = FakeBody({"g": Script(fail="ready"), "n": Script(fail="ready")})
    async with stage(body) as seen:
        one = seen.ask(block(motions, id="one"))
        words = seen.ask(block((Speech(id="t", text="five"),), after("one:g:end", "t:start"), id="two"), "one")
        first, second = await outcomes([one, words])

    assert (first.status, first.dropped) == ("failed", ("n", "g"))
    assert str(first.fault) == "one: no behavior of it came to its end (n: overheated; g: overheated)"
    assert (second.status, [each.text for each in second.spoken]) == ("done", ["five"])
    assert [(end.block, end.status) for end in seen.ends()] == [("one", "failed"), ("two", "done")]


async def test_a_block_with_one_behavior_that_came_to_its_end_is_done() -> None:
    body = FakeBody({"g": Script(fail="ready")})
    async with stage(body) as seen:
        (outcome,) = await outcomes([seen.ask(block((Gesture(id="g", lexeme="BEAT"), Speech(id="t", text="five"))))])

    assert (outcome.status, outcome.dropped, outcome.fault) == ("done", ("g",), None)


async def test_a_body_that_breaks_off_required_words_lets_none_follow() -> None:
    async with turn(FakeBody()) as (seen, asked):
        await seen.seen("s:m1", "one")
        seen.requests.send(keys.BEHAVIOR, AbortBehavior(id="stop", block="one", behavior="s"))
        made = await outcomes(asked)

    assert_only_the_first_moved(seen, 1.0, "failed")
    assert [each.text for each in made[0].spoken] == ["one"]


async def test_words_that_are_cancelled_are_followed_by_none() -> None:
    async with turn(FakeBody()) as (seen, asked):
        await asyncio.sleep(1.25)
        seen.requests.cancel("r-one", "enough")
        made = await outcomes(asked)

    assert_only_the_first_moved(seen, 1.25, "interrupted")
    assert made[2].fault is not None
    assert made[2].fault.reason == "one, which it follows, was interrupted: enough"


async def test_who_has_set_out_for_the_words_to_come_goes_home_without_a_word() -> None:
    async with turn(FakeBody({"s": Script(durations=(1.0, 1.0, 0.25), fail="end")})) as (seen, asked):
        made = await outcomes(asked)

    begun = {behavior for _, behavior, _ in seen.body.commands}
    assert begun == {"s", "beat-two"}
    assert seen.body.aborted == ["beat-two"]
    assert [each.status for each in made] == ["failed", "interrupted", "interrupted"]


async def test_who_follows_what_is_replaced_is_replaced_with_it() -> None:
    async with turn(FakeBody()) as (seen, asked):
        await asyncio.sleep(0.5)
        other = seen.ask(block((), id="new", composition="REPLACE"))
        made = await outcomes([*asked, other])

    assert [each.replaced_by for each in made] == ["new", "new", "new", ""]


async def test_what_is_refused_takes_its_followers_along() -> None:
    async with stage() as seen:
        first = seen.ask(block((WORDS,), after("nobody:start", "s:start"), id="one"))
        second = seen.ask(fragment("two"), "one")
        with pytest.raises(RequestRefused):
            await first.outcome
        (made,) = await outcomes([second])

    assert made.status == "interrupted"
    assert seen.body.commands == []


async def test_a_second_block_of_an_id_is_refused_and_ends_nobody() -> None:
    async with stage() as seen:
        first = seen.ask(block((WORDS,), id="one"))
        again = PerformBlock(id="again", requester="test", block=block((), id="one"))
        second = seen.requests.send(keys.BLOCK, again)
        follower = seen.ask(fragment("two", "one:s:end"), "one")
        made = await outcomes([first, follower])
        with pytest.raises(RequestRefused):
            await second.outcome

    assert [each.status for each in made] == ["done", "done"]


async def test_who_comes_while_what_he_follows_is_on_its_way_home_never_begins() -> None:
    async with stage(FakeBody({"s": Script(deaf=True)})) as seen:
        first = seen.ask(block((WORDS,), id="one"))
        await seen.seen("s:m1", "one")
        seen.requests.cancel("r-one")
        await asyncio.sleep(0.125)
        made = await outcomes([seen.ask(fragment("two"), "one"), first])

    assert [each.status for each in made] == ["interrupted", "interrupted"]
    assert [behavior for _, behavior, _ in seen.body.commands] == ["s"]


async def test_to_follow_what_is_not_there_is_refused() -> None:
    async with stage() as seen:
        with pytest.raises(RequestRefused, match="follows one: no block of that id is known"):
            await seen.ask(fragment("two"), "one").outcome


async def test_who_follows_a_block_that_is_done_goes_on() -> None:
    async with stage() as seen:
        made = await outcomes([seen.ask(block((WORDS,), id="one")), seen.ask(fragment("two", "one:s:end"), "one")])

    assert [each.status for each in made] == ["done", "done"]
    assert seen.times("two")["t:start"] == 3.0


async def test_who_is_only_tied_to_a_point_goes_on_when_it_vanishes() -> None:
    async with stage(FakeBody({"s": Script(fail="m2")})) as seen:
        made = await outcomes([seen.ask(block((WORDS,), id="one")), seen.ask(fragment("two", "one:s:end"))])

    assert [each.status for each in made] == ["failed", "done"]
