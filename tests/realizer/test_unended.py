"""A behavior that has told all its points, and whose request the body does not end."""

import asyncio

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gesture
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.requests import Cancel, KeepAlive
from tests.realizer.fake_body import FakeBody
from tests.realizer.stage import stage


async def test_it_is_cancelled_with_its_block_and_not_kept_alive(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FakeBody, "_end", lambda self, act, status, fault=None: self.acts.pop(act.perform.id, None))
    async with stage() as scene:
        with scene.hub.join("listener").subscribe(keys.commands("control")) as inbox:
            outcome = await scene.perform(Block(id="b", behaviors=(Gesture(id="beat", lexeme="BEAT"),)))
            await asyncio.sleep(60.0)
            told = [received for received in [await inbox.next(0.0) for _ in range(len(inbox))] if received]

    ended_at = max(each.at for each in told if isinstance(each.message, Cancel))
    assert outcome.status == "done"
    assert not [each for each in told if isinstance(each.message, KeepAlive) and each.at > ended_at]
    assert told[-1].at < 30.0
