"""What nobody has foreseen in one behavior ends its block, and nothing waits for that block in vain."""

import asyncio

import pytest

from engage_hri.schemas.behaviors import Gesture, Pointing, Wait
from engage_hri.schemas.blocks import Block, BlockOutcome
from engage_hri.schemas.body import BehaviorOutcome
from engage_hri.services.realizer.report import Spoken
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import stage

BEAT = Gesture(id="beat", lexeme="BEAT", mode="RIGHT_HAND")


@pytest.mark.contained
async def test_a_block_that_breaks_ends_as_failed_and_those_behind_it_are_performed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def breaks(self: Spoken, outcome: BehaviorOutcome) -> None:
        raise KeyError(outcome.behavior)

    monkeypatch.setattr(Spoken, "end", breaks)
    behind = Block(id="behind", behaviors=(Wait(id="w", duration=0.5),), composition="APPEND")
    async with stage(FakeBody({"p": Script(slow=4.0)})) as scene:
        broken = scene.ask(
            Block(
                id="broken",
                behaviors=(BEAT, Pointing(id="p", target="a", mode="LEFT_HAND"), Wait(id="w", duration=9.0)),
            )
        )
        await asyncio.sleep(0.1)
        outcome = await asyncio.wait_for(scene.ask(behind).outcome, 60.0)
        first = await asyncio.wait_for(broken.outcome, 1.0)

    assert isinstance(first, BlockOutcome)
    assert first.status == "failed"
    assert scene.body.aborted == ["p"]  # it was still pointing, and nobody would have ended that
    assert scene.body.homes == [("left_arm", "right_arm")]
    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "done"
