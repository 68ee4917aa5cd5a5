"""A voice that is held goes on to the end of its word, and then stands: what is tied to its words waits for them."""

import asyncio

import pytest

from engage_hri.schemas.behaviors import BlockBehavior, Gesture, Head, Mark, Pointing, Speech
from engage_hri.services.control.config import Variability
from tests.realizer.planning import timed
from tests.realizer.stage import block
from tests.realizer.steering import NUMBERS, steer
from tests.realizer.test_simulated_body import Robot, robot

WORDS = Speech(id="s", text="A long sentence that will be held while I say it.", marks=(Mark("m", 40),))
BEAT, NOD = Gesture(id="g", lexeme="BEAT"), Head(id="g", lexeme="NOD")
POINT = Pointing(id="g", target="a")


async def steered(seen: Robot, to: str, *held: str) -> None:
    await seen.requests.send(*steer(f"steer-{next(NUMBERS)}", to, *held)).outcome  # type: ignore[arg-type]


async def held_up(tied: BlockBehavior, since: float, lasts: float, *held: str) -> Robot:
    """What comes of words that are held, and of who is tied to them."""
    async with robot(Variability()) as seen:
        asked = [seen.ask(block((WORDS,))), seen.ask(block((tied,), id="c"))]
        await asyncio.sleep(since)
        await steered(seen, "hold", *held)
        await asyncio.sleep(lasts)
        await steered(seen, "continue", *held)
        await asyncio.gather(*(each.outcome for each in asked))
    return seen


@pytest.mark.parametrize("since", [0.7, 1.0])
@pytest.mark.parametrize(
    ("tied", "to"), [(BEAT, "s:end"), (BEAT, "s:end+0.5"), (NOD, "s:end"), (POINT, "s:m"), (NOD, "s:end-0.2")]
)
async def test_nobody_sets_out_for_a_word_of_a_voice_that_stands(tied: BlockBehavior, to: str, since: float) -> None:
    seen = await held_up(timed(tied, stroke=f"b:{to}"), since, 4.0, "b", "s")

    times, point = seen.times(), to.partition("+")[0].partition("-")[0]
    offset = float(to.removeprefix(point) or 0.0)
    start = times["g:start"].at.seconds - times["s:start"].at.seconds
    assert start > since + 4.0
    assert times["g:stroke"].at.seconds - times[point].at.seconds == pytest.approx(offset, abs=0.02)
    assert seen.kinds() == []


@pytest.mark.parametrize("since", [0.713, 0.813, 1.013, 1.113, 1.413])
async def test_a_voice_that_was_held_for_less_than_a_word_has_not_stood(since: float) -> None:
    seen = await held_up(timed(POINT, stroke="b:s:m"), since, 0.15)

    times = seen.times()
    assert times["g:stroke"].at.seconds == pytest.approx(times["s:m"].at.seconds, abs=0.02)
    assert seen.kinds() == []


async def test_words_go_on_past_a_gap_while_what_is_held_need_not_set_out_yet() -> None:
    words = Speech(
        id="s", text="Good morning to all of you here and then to more.", marks=(Mark("m", 27), Mark("k", 36))
    )
    first = timed(Pointing(id="p", target="a", mode="LEFT_HAND"), stroke="s:m")
    held = timed(Gesture(id="g", lexeme="BEAT", mode="RIGHT_HAND"), stroke="s:k+2")
    async with robot(Variability()) as seen:
        asked = seen.ask(block((words, first, held)))
        await asyncio.sleep(1.0)
        await steered(seen, "hold", "b", "g")
        await asyncio.sleep(5.0)
        times = {name: told.at.seconds for name, told in seen.times().items()}
        await steered(seen, "continue", "b", "g")
        await asked.outcome

    assert times["s:m"] == pytest.approx(times["p:stroke"], abs=0.02)
    assert times["s:end"] < 6.0
    assert "g:stroke_start" not in times
