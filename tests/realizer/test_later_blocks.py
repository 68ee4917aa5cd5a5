"""What a block has to do with one that began after it: no more than what of that is in its way."""

import asyncio

from engage_hri.schemas.behaviors import Gaze, Gesture, Speech, Wait
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.planning import timed
from tests.realizer.stage import after, block, stage
from tests.realizer.test_sharing import instants

RIGHT, LEFT = (Gesture(id=id, lexeme="BEAT", mode=mode) for id, mode in (("r", "RIGHT_HAND"), ("l", "LEFT_HAND")))  # type: ignore[arg-type]
"""2.25 s each; the stroke is over after 1.5."""


async def test_what_a_later_block_has_yet_to_begin_is_nobodys_loss() -> None:
    """The later one's right arm is slow, and in the way at 3 s. So its left arm would be in the way at 5 s, too; but
    it never begins, since the block is cancelled before that."""
    first = block((Wait(id="w", duration=3.0), RIGHT, timed(LEFT, start="5")), after("w:end", "r:start"), id="one")
    second = block((RIGHT, LEFT), after("r:end", "l:start"), id="two")
    async with stage(FakeBody({"r": Script(slow=2.4)})) as seen:
        earlier = seen.ask(first)
        await seen.seen("w:start", "one")
        seen.ask(second)
        await asyncio.sleep(3.25)
        seen.requests.cancel("r-two")
        await earlier.outcome

    times = instants(seen)
    assert times["two:r:start"] == 0.0
    assert times["one:l:start"] == 5.0
    assert [each.kind for each in seen.warnings() if each.block == "one"] == []


async def test_a_look_that_only_leaves_after_one_keeps_the_head_until_it_is_on_target() -> None:
    """The words of the first block are over long before they were to be, and its look comes while the other's is on
    its way. That one lasts until words that wait for the first block; but it is on target before these."""
    look, other = Gaze(id="g", target="a"), Gaze(id="h", target="b")
    first = block((Speech(id="a", text="one"), look, Wait(id="w", duration=3.0)), after("a:end", "g:start"), id="one")
    second = block((other, timed(Speech(id="t", text="two"), start="one:w:end")), id="two")
    body = FakeBody({"a": Script(durations=(1.25,))}, {"a": (4.0,)})
    async with stage(body) as seen:
        asked = [seen.ask(first)]
        await seen.seen("a:start", "one")
        await asyncio.sleep(1.0)
        asked.append(seen.ask(second))
        await asyncio.gather(*(each.outcome for each in asked))

    times = instants(seen)
    assert (times["two:h:start"], times["one:a:end"]) == (1.0, 1.25)
    assert times["one:g:start"] == times["two:h:stroke"] == 1.5
    assert [each.kind for each in seen.warnings() if each.kind != "LATE"] == []
