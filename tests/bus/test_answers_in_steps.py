"""Answers that a server gives in steps: others get their turn in between, and nobody waits for one that is gone."""

import asyncio

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused, NoReply
from engage_hri.schemas.messages import Message
from engage_hri.schemas.requests import Accepted
from engage_hri.services.bus.interface import MOST_ANSWERS, Answering
from engage_hri.services.bus.memory import MemoryHub
from tests.bus.places import Place, echo

pytestmark = pytest.mark.each_bus


class Slowly:
    """Answers once it is told to."""

    def __init__(self) -> None:
        self.asked = 0
        self.goes_on = asyncio.Event()
        self.is_asked, self.is_crowded = asyncio.Event(), asyncio.Event()

    async def __call__(self, question: Message) -> Message:
        self.asked += 1
        self.is_asked.set()
        if self.asked == 100:
            self.is_crowded.set()
        await self.goes_on.wait()
        return echo(question)


async def test_others_are_answered_before_a_long_answer_is_done(place: Place):
    client, server = (await place.process()).join("client"), (await place.process()).join("server")
    slowly = Slowly()
    server.answer(keys.ESTIMATE, slowly)
    server.answer(keys.DESCRIBE, echo)

    long = asyncio.create_task(client.query(keys.ESTIMATE, Accepted(id="long"), timeout=30.0), name="long")
    await slowly.is_asked.wait()

    assert await client.query(keys.DESCRIBE, Accepted(id="short")) == Accepted(id="short!")
    assert not long.done()
    slowly.goes_on.set()
    assert await long == Accepted(id="long!")


async def test_a_long_answer_may_be_a_refusal(place: Place):
    client, server = (await place.process()).join("client"), (await place.process()).join("server")
    slowly = Slowly()
    slowly.goes_on.set()
    server.answer(keys.ESTIMATE, slowly)

    with pytest.raises(InputRefused) as refused:
        await client.query(keys.ESTIMATE, Accepted(id="bad"))

    assert refused.value.fault == Fault(reason="bad indeed", where="here")


@pytest.mark.contained
async def test_an_exception_in_a_long_answer_is_told_and_the_server_goes_on(place: Place):
    client, server = (await place.process()).join("client"), (await place.process()).join("server")

    async def breaks(question: Message) -> Message:
        await asyncio.sleep(0)
        raise ZeroDivisionError("by nothing")

    server.answer(keys.ESTIMATE, breaks)
    server.answer(keys.DESCRIBE, echo)

    with pytest.raises(InputRefused, match="by nothing"):
        await client.query(keys.ESTIMATE, Accepted(id="a"))

    assert server.failures == 1
    assert await client.query(keys.DESCRIBE, Accepted(id="b")) == Accepted(id="b!")


async def test_an_answer_that_comes_too_late_is_none_and_harms_nobody(place: Place):
    client, server = (await place.process()).join("client"), (await place.process()).join("server")
    slowly = Slowly()
    server.answer(keys.ESTIMATE, slowly)

    with pytest.raises(NoReply):
        await client.query(keys.ESTIMATE, Accepted(id="a"), timeout=0.2)
    slowly.goes_on.set()

    assert await client.query(keys.ESTIMATE, Accepted(id="b"), timeout=30.0) == Accepted(id="b!")


async def test_who_gives_up_a_question_is_cancelled_at_once(place: Place):
    client, server = (await place.process()).join("client"), (await place.process()).join("server")
    slowly = Slowly()
    server.answer(keys.ESTIMATE, slowly)
    asking = asyncio.create_task(client.query(keys.ESTIMATE, Accepted(id="a"), timeout=30.0), name="asking")
    await slowly.is_asked.wait()

    asking.cancel()

    with pytest.raises(asyncio.CancelledError):
        await asking


async def test_a_server_that_leaves_breaks_off_its_answers(place: Place):
    client, server = (await place.process()).join("client"), (await place.process()).join("server")
    slowly = Slowly()
    server.answer(keys.ESTIMATE, slowly)
    asking = asyncio.create_task(client.query(keys.ESTIMATE, Accepted(id="a"), timeout=1.0), name="asking")
    await slowly.is_asked.wait()

    await server.leave()

    with pytest.raises(NoReply):
        await asking


async def test_many_long_questions_are_answered_each(place: Place):
    client, server = (await place.process()).join("client"), (await place.process()).join("server")
    slowly = Slowly()
    server.answer(keys.ESTIMATE, slowly)
    asking = [
        asyncio.create_task(client.query(keys.ESTIMATE, Accepted(id=str(each)), timeout=30.0), name=f"asking {each}")
        for each in range(100)
    ]
    await slowly.is_crowded.wait()
    slowly.goes_on.set()

    assert [answer.id for answer in await asyncio.gather(*asking)] == [f"{each}!" for each in range(100)]


async def test_no_more_are_taken_on_than_can_be_remembered() -> None:
    answering, slowly = Answering(MemoryHub().join("server")), Slowly()
    for each in range(MOST_ANSWERS):
        answering.begin(slowly(Accepted(id=str(each))), "key")
    with pytest.raises(InputRefused):
        answering.begin(slowly(Accepted(id="one more")), "key")

    answering.end()
    await asyncio.sleep(0.01)

    answering.begin(slowly(Accepted(id="one more")), "key").cancel()
