"""What is held is waited for by what is tied to it, in other blocks, too, and by nothing else."""

import asyncio

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import FaceLexeme, Gaze, Gesture, Mark, Speech, Wait
from engage_hri.schemas.blocks import PerformanceSteered, SyncPointProgress
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.planning import timed
from tests.realizer.stage import Stage, after, block, stage, together
from tests.realizer.steering import steer
from tests.realizer.test_holding import BEAT, NOD, STORY, steered


def instants(seen: Stage) -> dict[str, float]:
    """Time of each point of whatever block."""
    points = [each for each in seen.feedback if isinstance(each, SyncPointProgress)]
    return {f"{each.behavior}:{each.sync}": each.at.seconds for each in points}


@pytest.mark.parametrize("held", ["", "beat"])
@pytest.mark.parametrize("since", [0.2, 1.5, 2.3])
@pytest.mark.parametrize("offset", [-0.2, 0.0])
async def test_what_is_tied_to_a_held_behavior_of_another_block_does_not_go_on_without_it(
    since: float, offset: float, held: str
) -> None:
    tied = (timed(NOD, stroke=f"b:beat:stroke{offset or ''}"), timed(Speech(id="s", text="one"), start="nod:stroke"))
    async with stage() as seen:
        first = seen.ask(block((Wait(id="w", duration=2.0), BEAT), together("beat:start", "w:end")))
        await asyncio.sleep(0.1)
        second = seen.ask(block(tied, id="c"))
        await asyncio.sleep(since - 0.1)
        await steered(seen, "hold", "b", held)
        await asyncio.sleep(9.0)
        await steered(seen, "continue", "b", held)
        await asyncio.gather(first.outcome, second.outcome)

    times = instants(seen)
    assert times["beat:stroke"] > since + 9.0 - 0.5
    assert times["nod:stroke"] - times["beat:stroke"] == pytest.approx(offset, abs=0.02)
    assert times["s:start"] == pytest.approx(times["nod:stroke"], abs=0.02)


@pytest.mark.parametrize("point", ["start", "stroke"])
async def test_who_is_to_come_long_before_a_point_of_a_block_that_is_held_waits_for_it(point: str) -> None:
    """Nobody is late yet: what is held has some seconds until then, which it is to spend once it goes on."""
    tied = timed(NOD, **{point: "b:beat:stroke-2"})
    async with stage() as seen:
        first = seen.ask(block((Wait(id="w", duration=2.0), BEAT), together("beat:start", "w:end")))
        second = seen.ask(block((tied,), id="c"))
        await asyncio.sleep(0.2)
        await steered(seen, "hold", "b")
        await asyncio.sleep(9.0)
        assert f"nod:{point}" not in instants(seen)
        await steered(seen, "continue", "b")
        await asyncio.gather(first.outcome, second.outcome)

    times = instants(seen)
    assert times["beat:stroke"] == pytest.approx(2.0 + 1.25 + 9.0)
    assert times[f"nod:{point}"] == pytest.approx(times["beat:stroke"] - 2.0, abs=0.02)


async def test_what_is_tied_to_a_held_block_that_waits_for_its_turn_does_not_go_on_without_it() -> None:
    async with stage() as seen:
        first = seen.ask(block((Wait(id="w", duration=3.0),)))
        second = seen.ask(block((BEAT,), id="c", composition="APPEND"))
        third = seen.ask(block((timed(NOD, stroke="c:beat:stroke-0.5"),), id="d"))
        await asyncio.sleep(1.0)
        await steered(seen, "hold", "c")
        await asyncio.sleep(9.0)
        await steered(seen, "continue", "c")
        await asyncio.gather(first.outcome, second.outcome, third.outcome)

    times = instants(seen)
    assert times["beat:stroke"] > 10.0
    assert times["nod:stroke"] - times["beat:stroke"] == pytest.approx(-0.5, abs=0.02)


async def test_who_is_tied_to_nothing_that_is_held_goes_on() -> None:
    async with stage() as seen:
        first = seen.ask(block((Wait(id="w", duration=2.0), BEAT), together("beat:start", "w:end")))
        second = seen.ask(block((timed(NOD, start="b:w:end"),), id="c"))
        await asyncio.sleep(1.0)
        await steered(seen, "hold", "b", "beat")
        await asyncio.sleep(5.0)
        assert "nod:end" in instants(seen)
        await steered(seen, "continue", "b", "beat")
        await asyncio.gather(first.outcome, second.outcome)
    assert seen.warnings() == []


@pytest.mark.parametrize(
    ("held", "named"), [(("", ""), ("b", "")), (("", ""), ("b", "beat")), (("b", ""), ("b", "beat"))]
)
async def test_a_part_of_what_is_held_does_not_go_on_alone(held: tuple[str, str], named: tuple[str, str]) -> None:
    async with stage() as seen:
        performing = seen.ask(block((BEAT,)))
        await seen.seen("beat:start")
        await steered(seen, "hold", *held)
        outcome = await seen.requests.send(*steer("part", "continue", *named)).outcome
        assert isinstance(outcome, PerformanceSteered)
        assert (outcome.blocks, outcome.held_with) == ((), "block" if held[0] else "robot")
        await asyncio.sleep(5.0)
        assert not performing.outcome.done()
        assert await steered(seen, "continue", *held) == ("b",)
        await performing.outcome
    assert seen.warnings() == []


async def test_words_before_a_gap_at_which_the_voice_can_wait_are_said_though_what_comes_after_it_is_held() -> None:
    """The second word is tied to the stroke of a gesture that is held; the first is not, and ends with a gap."""
    words = Speech(id="s", text="one two three", marks=(Mark("m1", 3), Mark("m2", 7)))
    soon = Wait(id="w", duration=0.25)
    async with stage(FakeBody(pauses=True)) as seen:
        example = block((BEAT, words, soon), together("beat:stroke", "s:m2"), after("w:end", "s:m1"))
        performing = seen.ask(example)
        await asyncio.sleep(0.2)
        await steered(seen, "hold", "b", "beat")
        await asyncio.sleep(10.0)
        assert "s:start" in seen.times()
        assert "s:m2" not in seen.times()
        await steered(seen, "continue", "b", "beat")
        await performing.outcome

    assert seen.times()["s:m2"] == pytest.approx(seen.times()["beat:stroke"], abs=0.02)


OTHER = Gesture(id="h", lexeme="BEAT", mode="LEFT_HAND")
WAITING = {
    "it comes after the held one": (timed(OTHER, start="beat:end"), "h:stroke", True),
    "it comes after the held one of another block": (timed(OTHER, start="b:beat:end"), "h:stroke", False),
    "it waits for the arm of another block": (replace(OTHER, mode="RIGHT_HAND"), "h:stroke", False),
}


@pytest.mark.parametrize("why", WAITING)
async def test_who_is_tied_to_one_that_waits_for_what_is_held_does_not_go_on_without_it(why: str) -> None:
    waiting, point, is_one_block = WAITING[why]
    mine = (waiting, timed(NOD, stroke=point))
    async with stage() as seen:
        asked = [seen.ask(block((BEAT, *mine) if is_one_block else (BEAT,)))]
        if not is_one_block:
            asked.append(seen.ask(block(mine, id="c")))
        await asyncio.sleep(0.2)
        await steered(seen, "hold", "b", "beat")
        await asyncio.sleep(5.0)
        assert "nod:stroke" not in instants(seen)
        await steered(seen, "continue", "b", "beat")
        await asyncio.gather(*(each.outcome for each in asked))

    times = instants(seen)
    assert times["nod:stroke"] == pytest.approx(times["h:stroke"], abs=0.05)
    assert seen.warnings() == []


async def test_a_word_that_waits_for_a_held_voice_is_not_pointed_at_before() -> None:
    later = Speech(id="t", text="that one", marks=(Mark("m", 5),))
    async with stage() as seen:
        first = seen.ask(block((STORY,)))
        second = seen.ask(block((later, timed(OTHER, stroke="t:m")), id="c"))
        await asyncio.sleep(0.2)
        await steered(seen, "hold", "b")
        await asyncio.sleep(5.0)
        assert "h:stroke" not in instants(seen)
        await steered(seen, "continue", "b")
        await asyncio.gather(first.outcome, second.outcome)

    times = instants(seen)
    assert times["h:stroke"] == pytest.approx(times["t:m"], abs=0.05)


async def test_what_a_held_behavior_has_passed_is_waited_for_no_more() -> None:
    """Look and smile are to end with the word, and are slow. The word has come, and only then the voice is held."""
    words = Speech(id="s", text="one two three", marks=(Mark("m1", 3), Mark("m2", 7)))
    shown = (Gaze(id="g", target="x"), FaceLexeme(id="f", lexeme="SMILE"))
    async with stage(FakeBody({"g": Script(slow=5.0), "f": Script(slow=7.0)})) as seen:
        performing = seen.ask(block((*shown, words), together("g:relax", "f:relax", "s:m1")))
        await seen.seen("s:m1")
        await asyncio.sleep(0.25)
        await steered(seen, "hold", "b", "s")
        await asyncio.sleep(5.0)
        assert "g:relax" in seen.times()
        assert "s:m2" not in seen.times()
        await steered(seen, "continue", "b", "s")
        await performing.outcome

    assert seen.times()["s:m1"] == 1.0
    assert seen.times()["g:relax"] == seen.times()["f:relax"] == 2.5


@pytest.mark.parametrize("since", [0.1, 0.6])
async def test_what_waits_for_what_is_held_is_waited_for_in_other_blocks_and_so_on(since: float) -> None:
    """The voice waits for the gesture that is held, the nod for the voice, the beat for the nod."""
    words = Speech(id="s", text="one two three", marks=(Mark("m", 3),))
    wave = Gesture(id="g", lexeme="WAVE", mode="RIGHT_HAND")
    async with stage(FakeBody(pauses=True)) as seen:
        asked = [
            seen.ask(block((words, timed(wave, stroke="s:m")), id="a")),
            seen.ask(block((timed(NOD, stroke="a:s:end"),), id="b")),
            seen.ask(block((timed(OTHER, stroke="b:nod:stroke+0.3"),), id="c")),
        ]
        await asyncio.sleep(since)
        await steered(seen, "hold", "a", "g")
        await asyncio.sleep(6.0)
        assert not {"nod:stroke", "h:stroke"} & instants(seen).keys()
        await steered(seen, "continue", "a", "g")
        await asyncio.gather(*(each.outcome for each in asked))

    times = instants(seen)
    assert times["g:stroke"] > since + 6.0
    assert times["nod:stroke"] == pytest.approx(times["s:end"], abs=0.02)
    assert times["h:stroke"] == pytest.approx(times["nod:stroke"] + 0.3, abs=0.02)
    assert seen.warnings() == []


async def test_what_is_tied_to_a_block_that_waits_for_one_that_is_held_does_not_go_on_without_it() -> None:
    async with stage() as seen:
        asked = [
            seen.ask(block((Wait(id="w", duration=2.0),))),
            seen.ask(block((BEAT,), id="c", composition="APPEND")),
            seen.ask(block((timed(NOD, stroke="c:beat:stroke-0.5"),), id="d")),
        ]
        await asyncio.sleep(1.0)
        await steered(seen, "hold", "b")
        await asyncio.sleep(9.0)
        await steered(seen, "continue", "b")
        await asyncio.gather(*(each.outcome for each in asked))

    times = instants(seen)
    assert times["w:end"] == pytest.approx(11.0)
    assert times["nod:stroke"] - times["beat:stroke"] == pytest.approx(-0.5, abs=0.02)


@pytest.mark.parametrize("is_one_block", [True, False])
async def test_who_was_told_to_pass_before_the_other_was_held_waits_for_it_all_the_same(is_one_block: bool) -> None:
    """Both set out at once, and need not stop; then one of them is held on its way."""
    tied = timed(OTHER, stroke="b:beat:stroke" if not is_one_block else "beat:stroke")
    async with stage() as seen:
        asked = [seen.ask(block((BEAT, tied) if is_one_block else (BEAT,)))]
        if not is_one_block:
            asked.append(seen.ask(block((tied,), id="c")))
        await asyncio.sleep(0.1)
        await steered(seen, "hold", "b", "beat")
        await asyncio.sleep(5.0)
        assert "h:stroke" not in instants(seen)
        await steered(seen, "continue", "b", "beat")
        await asyncio.gather(*(each.outcome for each in asked))

    times = instants(seen)
    assert times["h:stroke"] == pytest.approx(times["beat:stroke"], abs=0.02)
    assert seen.warnings() == []


@pytest.mark.parametrize("held", ["", "w"])
async def test_nobody_sets_out_for_what_is_held_to_wait_with_a_raised_arm(held: str) -> None:
    words, wait = timed(Speech(id="s", text="one"), start="w:end"), Wait(id="w", duration=3.0)
    tied = timed(OTHER, stroke="b:s:start")
    async with stage() as seen:
        asked = [seen.ask(block((wait, words))), seen.ask(block((tied,), id="c"))]
        await asyncio.sleep(1.0)
        await steered(seen, "hold", "b", held)
        await asyncio.sleep(9.0)
        assert "h:start" not in instants(seen)
        await steered(seen, "continue", "b", held)
        await asyncio.gather(*(each.outcome for each in asked))

    times = instants(seen)
    assert times["s:start"] == pytest.approx(12.0)
    assert times["h:stroke"] == pytest.approx(12.0)
    assert times["h:start"] == pytest.approx(12.0 - 1.25 - 0.375)
    assert seen.warnings() == []


async def test_who_sets_out_for_a_word_before_the_voice_stands_is_in_time_for_it() -> None:
    """The voice is held within a word, goes on to its end, and would say the next at once."""
    words = Speech(id="s", text="one two three", marks=(Mark("m", 3), Mark("l", 7)))
    async with stage(FakeBody(pauses=True)) as seen:
        asked = [
            seen.ask(block((words,))),
            seen.ask(block((timed(OTHER, stroke="b:s:l+0.6"),), id="c")),
        ]
        await asyncio.sleep(1.2)
        await steered(seen, "hold", "b", "s")
        await asyncio.sleep(9.0)
        await steered(seen, "continue", "b", "s")
        await asyncio.gather(*(each.outcome for each in asked))

    times = instants(seen)
    assert times["h:start"] == pytest.approx(2.6 - 1.25 - 0.375)
    assert times["h:stroke"] == pytest.approx(times["s:l"] + 0.6, abs=0.02)
