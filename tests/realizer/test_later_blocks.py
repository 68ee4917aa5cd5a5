"""What a block has to do with one that began after it: no more than what of that is in its way."""

import asyncio

from engage_hri.schemas.behaviors import Gesture, Wait
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
