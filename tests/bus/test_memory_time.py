"""Questions on the bus in memory give up when they said they would, also long after the clock began."""

import asyncio

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import NoReply
from engage_hri.schemas.messages import Message
from engage_hri.schemas.requests import Accepted
from engage_hri.services.bus.memory import MemoryHub


@pytest.mark.parametrize("began", [0.0, 1.0, 500.0])
async def test_a_question_that_is_answered_too_slowly_is_given_up_at_its_time(hub: MemoryHub, began: float) -> None:
    client, server = hub.join("client"), hub.join("server")

    async def slowly(question: Message) -> Message:
        await asyncio.sleep(60.0)
        return question

    server.answer(keys.ESTIMATE, slowly)
    await asyncio.sleep(began)

    with pytest.raises(NoReply):
        await client.query(keys.ESTIMATE, Accepted(id="a"), timeout=2.0)

    assert client.now() == began + 2.0


@pytest.mark.parametrize("began", [0.0, 500.0])
async def test_a_question_that_nobody_answers_is_given_up_at_its_time(hub: MemoryHub, began: float) -> None:
    client = hub.join("client")
    await asyncio.sleep(began)

    with pytest.raises(NoReply):
        await client.query(keys.ESTIMATE, Accepted(id="a"), timeout=2.0)

    assert client.now() == began + 2.0
