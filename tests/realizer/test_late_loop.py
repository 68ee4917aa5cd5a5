"""A loop that is late: its process stood still between two readings of the clock, and the body had not been asked."""

import asyncio
import math

import pytest

from engage_hri.schemas.behaviors import Gesture, Speech
from engage_hri.schemas.blocks import BlockOutcome
from engage_hri.services.realizer.decide.decisions import Begin, Extend
from engage_hri.services.realizer.perform.behavior_run import BehaviorRun
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop
from tests.realizer.fake_body import FakeBody
from tests.realizer.stage import after, block, stage


def stand_still(monkeypatch: pytest.MonkeyPatch, begun: int, reading: int) -> None:
    """Let 4 s pass at this reading of the clock after so many behaviors were told to begin."""
    loop, command = asyncio.get_running_loop(), BehaviorRun.command
    assert isinstance(loop, VirtualTimeLoop)
    time, left = loop.time, [begun, 0]

    def counted(run: BehaviorRun, asked: Begin | Extend) -> None:
        command(run, asked)
        left[0] -= isinstance(asked, Begin)
        if isinstance(asked, Begin) and left[0] == 0:
            left[1] = reading

    def late() -> float:
        left[1] -= 1
        if left[1] == 0:
            loop._virtual_now += 4.0
            loop._clock_resolution = math.ulp(loop._virtual_now)  # type: ignore[attr-defined]
        return time()

    monkeypatch.setattr(BehaviorRun, "command", counted)
    monkeypatch.setattr(loop, "time", late)


@pytest.mark.parametrize("begun", range(1, 9))
@pytest.mark.parametrize("reading", range(1, 8))
async def test_no_behavior_breaks_its_block_and_none_is_lost_before_the_body_was_asked(
    monkeypatch: pytest.MonkeyPatch, begun: int, reading: int
) -> None:
    """Any bug fails a test (see conftest.py). The body answers at once here, so that none is late with its start."""
    left, right = Gesture(id="l", lexeme="BEAT", mode="LEFT_HAND"), Gesture(id="r", lexeme="BEAT", mode="RIGHT_HAND")
    again, words = Gesture(id="a", lexeme="BEAT", mode="LEFT_HAND"), Speech(id="s", text="one two")
    stand_still(monkeypatch, begun, reading)
    async with stage(FakeBody()) as scene:
        first = scene.ask(block((left, right, again, words), after("r:end", "s:start"), id="one"))
        tied = block((right, words), after("one:l:stroke", "r:start"), id="two", composition="MERGE")
        outcomes = [await first.outcome, await scene.ask(tied).outcome]

    assert all(isinstance(each, BlockOutcome) for each in outcomes)
    assert not [each.message for each in scene.warnings() if "stalled before" in each.message]
