"""A behavior comes sooner or later than other blocks have planned for: who comes to a part that is in use waits."""

import asyncio
from contextlib import suppress
from itertools import pairwise
from random import Random

import pytest

from engage_hri.schemas.behaviors import BlockBehavior, FaceLexeme, Gaze, Gesture, Head, Mark, Speech, Wait
from engage_hri.schemas.blocks import Block
from engage_hri.services.control.config import Slow, Stall, Variability
from engage_hri.services.requests.ends import RequestRefused
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.planning import timed
from tests.realizer.stage import after, block, stage
from tests.realizer.steering import interrupt
from tests.realizer.test_simulated_body import Robot, robot

LEFT = Gesture(id="l", lexeme="BEAT", mode="LEFT_HAND")
WORDS = Speech(id="s", text="one two three four five six seven")


async def sooner(waiting: BlockBehavior, running: BlockBehavior) -> Robot:
    """The one is planned for after a long wait, which ends while the other has the part."""
    wait = Wait(id="w", duration=30.0)
    async with robot(Variability()) as seen:
        first = seen.ask(block((wait, timed(waiting, start="w:end")), id="a"))
        await asyncio.sleep(0.1)
        second = seen.ask(block((running,), id="b"))
        await asyncio.sleep(0.5)
        await interrupt(seen.requests, "a", "w").outcome
        await asyncio.gather(first.outcome, second.outcome)
    return seen


@pytest.mark.parametrize(
    ("waiting", "running"),
    [
        (Speech(id="t", text="and eight"), WORDS),
        (Gesture(id="m", lexeme="BEAT", mode="LEFT_HAND"), LEFT),
        (Gesture(id="m", lexeme="BEAT", mode="BOTH_HANDS"), LEFT),
        (Head(id="m", lexeme="NOD"), Head(id="n", lexeme="SHAKE", repetition=3)),
    ],
)
async def test_what_comes_sooner_than_planned_waits_for_what_it_was_to_come_after(
    waiting: BlockBehavior, running: BlockBehavior
) -> None:
    seen = await sooner(waiting, running)

    assert seen.kinds() == ["INTERRUPTED"]
    times = seen.times()
    last = "end" if isinstance(running, Speech) else "stroke_end"
    assert times[f"{waiting.id}:start"].at.seconds >= times[f"{running.id}:{last}"].at.seconds - 1e-6


async def test_what_comes_sooner_does_not_wait_for_a_part_that_it_does_not_use() -> None:
    seen = await sooner(Gesture(id="m", lexeme="BEAT", mode="RIGHT_HAND"), LEFT)

    assert seen.kinds() == ["INTERRUPTED"]
    assert seen.times()["m:start"].at.seconds == pytest.approx(0.6, abs=0.01)


async def test_words_with_a_time_wait_for_an_utterance_that_takes_longer_than_planned() -> None:
    """By plan the first is over by then. Its arm is slow, and what is said at its stroke is late for that."""
    slow = Variability(slow=(Slow(part="left_arm", factor=2.0),))
    async with robot(slow) as seen:
        first = seen.ask(block((LEFT, timed(Speech(id="s", text="one two three"), start="l:stroke")), id="a"))
        await asyncio.sleep(0.05)
        second = seen.ask(block((timed(Speech(id="t", text="four"), start="1.75"),), id="b"))
        await asyncio.gather(first.outcome, second.outcome)

    times = seen.times()
    assert times["s:start"].at.seconds < 1.8 < times["s:end"].at.seconds
    assert times["t:start"].at.seconds >= times["s:end"].at.seconds - 1e-6


def _behavior(random: Random, id: str) -> BlockBehavior:
    makers = (
        lambda: Speech(id=id, text=" ".join("word" for _ in range(random.randint(1, 6)))),
        lambda: Gesture(id=id, lexeme="BEAT", mode=random.choice(("LEFT_HAND", "RIGHT_HAND", "BOTH_HANDS"))),
        lambda: Head(id=id, lexeme="NOD", repetition=random.randint(1, 2)),
        lambda: Gaze(id=id, target=random.choice(("a", "b"))),
    )
    return random.choice(makers)()


def _block(random: Random, number: int) -> Block:
    """A wait, and behaviors that begin with its end or somewhat later, of different types."""
    wait = Wait(id=f"w{number}", duration=random.uniform(0.1, 6.0))
    parts: dict[type, BlockBehavior] = {}
    for each in range(random.randint(1, 3)):
        made = _behavior(random, f"b{number}{each}")
        after = random.choice(("", "", f"+{random.uniform(0.1, 1.0):.2f}"))
        begun = timed(made, start=f"w{number}:end{after}")
        if isinstance(made, Gaze):
            begun = timed(made, start=f"w{number}:end{after}", end=f"w{number}:end+2")
        parts[type(made)] = begun
    return block((wait, *parts.values()), id=f"k{number}")


@pytest.mark.parametrize("seed", range(share_of(30)))
async def test_nothing_is_lost_to_another_block_whenever_waits_are_cut_short(seed: int) -> None:
    """Blocks come at random times, and some waits end early: all is performed, and each part has one user."""
    random = Random(seed)
    async with robot(Variability()) as seen:
        blocks = [_block(random, number) for number in range(random.randint(2, 5))]
        asked = []
        for each in blocks:
            await asyncio.sleep(random.uniform(0.0, 0.8))
            asked.append(asyncio.create_task(seen.perform(each)))
        for number in random.sample(range(len(blocks)), random.randint(1, len(blocks))):
            await asyncio.sleep(random.uniform(0.0, 1.5))
            await asyncio.wait_for(_cut_short(seen, number), 30.0)
        outcomes = await asyncio.gather(*asked)

    assert [outcome is not None and outcome.dropped for outcome in outcomes] == [()] * len(blocks)
    assert {*seen.kinds()} <= {"INTERRUPTED", "LATE"}
    times = {name: each.at.seconds for name, each in seen.times().items()}
    said = {each.id for made in blocks for each in made.behaviors if isinstance(each, Speech)}
    spoken = sorted((times[f"{id}:start"], times[f"{id}:end"]) for id in said)
    assert all(one[1] <= other[0] + 1e-6 for one, other in pairwise(spoken))


async def _cut_short(seen: Robot, number: int) -> None:
    with suppress(RequestRefused):  # the wait is over by itself
        await interrupt(seen.requests, f"k{number}", f"w{number}").outcome


async def test_who_has_begun_comes_before_its_neighbor_when_what_it_was_tied_to_vanishes() -> None:
    """Without its tie it would come second, as in the document; but it is in the middle of its stroke."""
    tied = timed(Gesture(id="h", lexeme="BEAT", mode="BOTH_HANDS"), stroke_end="a:w:end")
    async with robot(Variability()) as seen:
        first = seen.ask(block((Wait(id="w", duration=1.5),), id="a"))
        await asyncio.sleep(0.0)
        second = seen.ask(block((LEFT, tied), id="b"))
        await asyncio.sleep(0.8)
        assert "h:start" in seen.times()
        await interrupt(seen.requests, "a", "w").outcome
        await asyncio.gather(first.outcome, second.outcome)

    assert seen.kinds() == ["INTERRUPTED"]
    times = seen.times()
    assert times["l:start"].at.seconds >= times["h:stroke_end"].at.seconds


async def test_a_stroke_that_comes_after_words_waits_for_them_where_it_can() -> None:
    """It cannot wait at its stroke, and by prediction the words would be over by then."""
    async with stage(FakeBody({"s": Script(slow=3.0)})) as seen:
        await seen.perform(block((Speech(id="s", text="one"), LEFT), after("s:end", "l:stroke")))

    times = seen.times()
    assert times["s:end"] == 3.0
    assert times["l:stroke"] == 3.5  # half a second after its hold point
    assert [each.behavior for each in seen.warnings()] == ["s"]  # it is late itself


async def test_who_waits_for_a_block_that_has_yet_to_begin_leaves_it_the_part() -> None:
    """The face of `c` lasts until `d` begins, and that when `b` has ended, which wants the face: `b` came first."""
    smile = timed(FaceLexeme(id="x", lexeme="SMILE"), relax="d:v:start")
    async with robot(Variability()) as seen:
        asked = [
            seen.perform(block((Wait(id="w", duration=1.0),), id="a")),
            seen.perform(block((FaceLexeme(id="y", lexeme="RAISE_BROWS"),), id="b", composition="APPEND")),
            seen.perform(block((Wait(id="v", duration=0.5),), id="d", composition="APPEND")),
            seen.perform(block((smile,), id="c")),
        ]
        outcomes = await asyncio.gather(*asked)

    assert [outcome is not None and outcome.status for outcome in outcomes] == ["done"] * 4
    assert seen.kinds() == ["LATE"]  # the face of `c` has yet to come when `d` begins


async def test_words_that_wait_at_a_gap_go_on_when_what_they_waited_for_is_given_up() -> None:
    words = Speech(id="s", text="look at this one here", marks=(Mark("m", 8),))
    look = timed(Gaze(id="g", target="a"), stroke="s:m")
    async with robot(Variability(stall=(Stall(part="head", before="stroke"),))) as seen:
        outcome = await seen.perform(block((words, look)))

    assert outcome is not None
    assert (outcome.status, outcome.dropped) == ("done", ("g",))
    assert "s:end" in seen.times()


@pytest.mark.parametrize("slow", [1.5, 2.0, 4.0])
async def test_words_wait_for_a_voice_that_is_slower_than_anybody_foresaw(slow: float) -> None:
    """Planned again while the other speaks, they were expected to come after it, and were not."""
    last = timed(Speech(id="t", text="four five"), start="0.2", end="2.9")
    async with robot(Variability(slow=(Slow(part="voice", factor=slow),))) as seen:
        first = asyncio.create_task(seen.perform(block((timed(WORDS, start="0.5"),), id="a")))
        await asyncio.sleep(1.5)
        second = asyncio.create_task(seen.perform(block((last,), id="b")))
        outcomes = [await first, await second]

    assert [outcome is not None and outcome.dropped for outcome in outcomes] == [(), ()]
    times = seen.times()
    assert times["t:start"].at.seconds >= times["s:end"].at.seconds - 1e-6
