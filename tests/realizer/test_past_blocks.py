"""Blocks that name one that has ended: what has been is past, what never comes is as if it had not been written.

The oracle knows the document and the feedback: of a tie, two instants as the feedback has them, and what the document
says of them.
"""

import asyncio
from itertools import product

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gesture, Speech, Wait
from engage_hri.schemas.blocks import BlockOutcome, PerformBlock, WarningFeedback
from engage_hri.services.realizer.plan.relations import LASTING
from engage_hri.services.realizer.together.live_blocks import MOST, Past
from engage_hri.services.requests.ends import RequestRefused
from tests.judge import playing
from tests.judge.record import Record
from tests.judge.story import Deed, Story
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import after, block, stage

TOLERANCE = 0.1
"""Seconds by which a constraint may be missed before it is told."""
LEADERS = {
    "speech": ('<speech id="x"><text>one <sync id="m"/>two</text></speech>', ("start", "m", "end")),
    "gesture": ('<gesture id="x" lexeme="BEAT" mode="LEFT_HAND"/>', ("start", "stroke", "end")),
    "head": ('<head id="x" lexeme="NOD"/>', ("start", "stroke", "end")),
}
WORDS = '<speech id="t" {}><text>three four</text></speech>'
BEAT = '<gesture id="g" lexeme="BEAT" {}/>'
FOLLOWERS = {
    "words at": (WORDS.format('start="{}"'), "t:start", "at"),
    "words before": (WORDS.format('end="{}"'), "t:end", "at"),
    "a stroke at": (WORDS.format("") + BEAT.format('stroke="{}"'), "g:stroke", "at"),
    "words after": (WORDS.format("") + '<constraint><after ref="{}"><sync ref="t:start"/></after></constraint>',
                    "t:start", "after"),
    "a beat before": (WORDS.format("") + BEAT.format("")
                      + '<constraint><before ref="{}"><sync ref="g:end"/></before></constraint>', "g:end", "before"),
}  # fmt: skip
OFFSETS = (0.0, 0.5, -0.3, 3.0)


def told_times(record: Record, block: str) -> dict[str, float]:
    return {f"{each.behavior}:{each.sync}": each.at.seconds for each in record.points(block)}


def warnings(record: Record, block: str) -> list[WarningFeedback]:
    return [each for each in record.warnings(block) if each.block == block]


def broken(record: Record, point: str, how: str, other: str, offset: float) -> float:
    """Seconds by which a tie of block c to a point of block a is off, by the feedback alone."""
    ours, theirs = told_times(record, "c")[point], told_times(record, "a")[other] + offset
    apart = ours - theirs
    return {"at": abs(apart), "after": max(0.0, -apart), "before": max(0.0, apart)}[how]


def assert_kept_or_told(sent: float, leader: str, follower: str, sync: str, offset: float) -> None:
    xml, other = LEADERS[leader][0], f"a:x:{sync}{offset:+}" if offset else f"a:x:{sync}"
    text, point, how = FOLLOWERS[follower]
    deeds = (
        Deed(0.0, "perform", "a", f'<bml id="a">{xml}</bml>'),
        Deed(sent, "perform", "c", f'<bml id="c">{text.format(other)}</bml>'),
    )
    record = playing.play(Story(deeds))
    case = (sent, leader, follower, sync, offset)

    (end,) = record.ends["c"]
    assert record.errors == [], case
    assert end.status == "done", (case, end)
    assert end.outcome is not None
    assert [each.text for each in end.outcome.spoken] == ["three four"], case
    kinds = {each.kind for each in warnings(record, "c")}
    if point not in told_times(record, "c"):  # The beat is dropped, and that is told.
        assert kinds, case
    elif broken(record, point, how, f"x:{sync}", offset) > TOLERANCE:
        assert kinds & {"LATE", "IMPOSSIBLE_TO_SCHEDULE"}, (case, kinds)
    else:
        assert not kinds - {"LATE", "IMPOSSIBLE_TO_SCHEDULE"}, (case, kinds)


CASES = [
    (leader, follower, sync, offset)
    for leader, (_, syncs) in LEADERS.items()
    for follower, sync, offset in product(FOLLOWERS, syncs, OFFSETS)
]


@pytest.mark.parametrize("number", range(10))
def test_a_tie_to_a_block_that_ends_is_kept_or_told_whenever_it_comes(number: int) -> None:
    """Every hundredth of a second from 0 to 5, and each tie at some of them."""
    instants = range(500)[number::10]
    for each in instants[: share_of(len(instants), 10)] if number % 2 else instants[-share_of(len(instants), 10) :]:
        assert_kept_or_told(each / 100, *CASES[(7 * each) % len(CASES)])


SPEECH = Speech(id="s", text="one two")
SO = Speech(id="t", text="so")


async def outcome_of(pending: object) -> BlockOutcome:
    made = await pending.outcome  # type: ignore[attr-defined]
    assert isinstance(made, BlockOutcome)
    return made


@pytest.mark.parametrize("pause", [0.05, 5.0, LASTING - 1.0])
async def test_words_after_words_that_have_been_begin_at_once(pause: float) -> None:
    async with stage() as seen:
        await seen.perform(block((SPEECH,), id="a"))
        await asyncio.sleep(pause)
        made = await seen.perform(block((SO,), after("a:s:end", "t:start"), id="c"))

    assert (made.status, seen.times("c")["t:start"], seen.warnings()) == ("done", 0.0, [])


async def test_a_time_after_a_point_of_the_past_counts_from_that_point() -> None:
    async with stage() as seen:
        await seen.perform(block((SPEECH,), id="a"))
        await asyncio.sleep(1.0)
        await seen.perform(block((SO,), after("a:s:end+1.5", "t:start"), id="c"))

    assert seen.times("c")["t:start"] == 0.5


async def test_what_is_forgotten_costs_the_tie_and_no_words() -> None:
    async with stage() as seen:
        await seen.perform(block((SPEECH,), id="a"))
        await asyncio.sleep(LASTING + 1.0)
        made = await seen.perform(block((SO,), after("a:s:end+1.5", "t:start"), id="c"))

    assert (made.status, seen.times("c")["t:start"]) == ("done", 0.0)
    (warning,) = seen.warnings()
    assert warning.kind == "PARSING_FAILURE"
    assert "no block is known as 'a'" in warning.message


async def test_of_two_blocks_that_had_one_id_the_latest_is_meant() -> None:
    async with stage() as seen:
        await seen.perform(block((Wait(id="w", duration=1.0),), id="a"))
        again = PerformBlock(id="again", requester="test", block=block((Wait(id="w", duration=0.5),), id="a"))
        await seen.requests.send(keys.BLOCK, again).outcome  # at 1.5
        await asyncio.sleep(0.25)
        await seen.perform(block((SO,), after("a:w:end+1", "t:start"), id="c"))

    assert (seen.warnings(), seen.times("c")["t:start"]) == ([], 0.75)


@pytest.mark.parametrize("how", ["failed", "interrupted", "refused"])
async def test_what_never_came_is_as_if_it_had_not_been_written(how: str) -> None:
    async with stage(FakeBody({"g": Script(fail="ready")})) as seen:
        motions = (Gesture(id="g", lexeme="BEAT", required=how == "failed"), Wait(id="w", duration=3.0))
        ties = (after("nobody:start", "g:start"),) if how == "refused" else ()
        asked = seen.ask(block(motions, *ties, id="a"))
        if how == "interrupted":
            await asyncio.sleep(0.125)
            seen.requests.cancel("r-a")
        await asyncio.wait([asked.outcome])
        before = len(seen.warnings())
        made = await seen.perform(block((SO,), after("a:g:end+1", "t:start"), id="c"))

    assert (made.status, seen.times("c")["t:start"]) == ("done", 0.0)
    assert seen.warnings()[before:] == []


async def test_a_required_tie_to_what_never_came_fails_the_block_and_says_so() -> None:
    async with stage() as seen:
        asked = seen.ask(block((SPEECH,), id="a"))
        await asyncio.sleep(0.125)
        seen.requests.cancel("r-a")
        await asked.outcome
        words = Speech(id="t", text="so", required=True)
        made = await outcome_of(seen.ask(block((words,), after("a:s:end", "t:start"), id="c")))

    assert made.status == "failed"
    assert "a:s:end" in str(made.fault)


async def test_who_follows_what_is_done_by_then_goes_on() -> None:
    async with stage() as seen:
        await seen.perform(block((SPEECH,), id="a"))
        await asyncio.sleep(1.0)
        made = await outcome_of(seen.ask(block((SO,), id="c"), "a"))

    assert (made.status, [each.text for each in made.spoken]) == ("done", ["so"])


@pytest.mark.parametrize("how", ["failed", "interrupted", "refused"])
async def test_who_follows_what_went_wrong_before_does_not_begin(how: str) -> None:
    async with stage(FakeBody({"s": Script(fail="end")} if how == "failed" else {})) as seen:
        ties = (after("nobody:start", "s:start"),) if how == "refused" else ()
        asked = seen.ask(block((Speech(id="s", text="one two", required=True),), *ties, id="a"))
        if how == "interrupted":
            await asyncio.sleep(0.125)
            seen.requests.cancel("r-a", "enough")
        await asyncio.wait([asked.outcome])
        await asyncio.sleep(1.0)
        made = await outcome_of(seen.ask(block((SO,), id="c"), "a"))

    assert made.status == "interrupted"
    assert str(made.fault).startswith(f"c: a, which it follows, {'was ' * (how == 'interrupted')}")
    assert [behavior for _, behavior, _ in seen.body.commands if behavior == "t"] == []


async def test_who_follows_what_is_forgotten_is_refused() -> None:
    async with stage() as seen:
        await seen.perform(block((SPEECH,), id="a"))
        await asyncio.sleep(LASTING + 1.0)
        with pytest.raises(RequestRefused, match="it follows a: no block of that id is known"):
            await seen.ask(block((SO,), id="c"), "a").outcome


def test_the_past_is_bounded_in_time_and_size() -> None:
    now = 0.0
    past = Past[int](lambda: now)
    for number in range(3 * MOST):
        past.add(str(number % 30_000), number)
        assert number % 1000 or len(past.all()) <= MOST
    assert past.get(str((3 * MOST - 1) % 30_000)) == 3 * MOST - 1
    past.add("large", -1, MOST - 1)
    assert len(past.all()) == 2
    now = LASTING + 0.5
    assert (past.get("large"), past.all()) == (None, {})
    assert past.add("new", 1) != []
    assert past.all() == {"new": 1}
