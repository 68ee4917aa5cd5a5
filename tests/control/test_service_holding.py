"""Held behaviors on the bus: the same request again, with `held` and without."""

import asyncio

import pytest

from engage_hri.schemas.behaviors import Pointing, Speech
from engage_hri.schemas.body import SyncPointArrived, WordSpoken
from engage_hri.services.bus.memory import MemoryHub
from tests.control.directing import robot

POINT = Pointing(id="point", target="near-right")


async def test_a_held_behavior_waits_and_goes_on_when_it_is_sent_again_without(hub: MemoryHub) -> None:
    async with robot(hub) as client:
        pending = client.perform(POINT, "end")
        await asyncio.sleep(0.1)
        client.perform(POINT, "end", held=True)
        await asyncio.sleep(4.9)
        assert [item.sync for item in client.of(SyncPointArrived)] == ["stroke_start"]  # type: ignore[attr-defined]
        assert list(client.reached("point")) == ["start", "ready"]
        client.perform(POINT, "end")
        outcome = await client.outcome(pending)

    assert outcome.status == "done"
    assert client.reached("point")["stroke_start"] == pytest.approx(5.0)


async def test_a_behavior_may_begin_held(hub: MemoryHub) -> None:
    async with robot(hub) as client:
        pending = client.perform(POINT, "end", held=True)
        await asyncio.sleep(4.0)
        assert list(client.reached("point")) == ["start", "ready"]
        client.perform(POINT, "end")

        assert (await client.outcome(pending)).status == "done"


async def test_words_go_on_from_the_next_after_the_gap(hub: MemoryHub) -> None:
    words = Speech(id="words", text="one two three four")
    async with robot(hub) as client:
        pending = client.perform(words)
        await asyncio.sleep(0.5)
        client.perform(words, held=True)
        await asyncio.sleep(1.5)
        said = [item.word for item in client.of(WordSpoken)]  # type: ignore[attr-defined]
        client.perform(words)
        outcome = await client.outcome(pending)

    assert said == ["one", "two"]
    assert [item.word for item in client.of(WordSpoken)] == words.text.split()  # type: ignore[attr-defined]
    assert (outcome.status, outcome.spoken) == ("done", words.text)
