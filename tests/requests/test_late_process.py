"""A server that stood still: what came meanwhile is heard before anything is ended for being overdue."""

import asyncio

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, PerformBlock
from engage_hri.schemas.body import DescribeBody, Estimates
from engage_hri.schemas.faults import NoReply
from engage_hri.schemas.messages import Message
from engage_hri.schemas.requests import Cancel, KeepAlive, Kept
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.deadlines import LATE
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.bus.samples import Received
from engage_hri.services.requests.ends import RequestDesk, unfinished
from tests.standing_still import stand_still

TERM: Seconds = 2.0
BLOCK = PerformBlock(id="a", requester="client", life="1", block=Block(id="b"))


async def test_a_question_that_was_slept_through_is_asked_again(hub: MemoryHub) -> None:
    bus, control = hub.join("realizer"), hub.join("control")

    async def describe(question: Message) -> Message:
        await asyncio.sleep(0.5)
        return Estimates(items=())

    control.answer(keys.DESCRIBE, describe)
    control.declare_alive()
    asyncio.get_running_loop().call_at(0.2, stand_still, 5.0)

    assert await bus.query(keys.DESCRIBE, DescribeBody(), 1.0) == Estimates(items=())
    await asyncio.sleep(2.0)
    with pytest.raises(NoReply, match="it is there, but does not answer"):
        await bus.query(keys.DESCRIBE, DescribeBody(), 0.3)


@pytest.mark.parametrize(("came", "is_ended"), [(0.5 * LATE, False), (2.0 * LATE, True)])
async def test_a_renewal_that_came_while_the_server_stood_still_is_heard_first(
    hub: MemoryHub, came: Seconds, is_ended: bool
) -> None:
    ended: list[Cancel] = []
    bus = hub.join("realizer")
    desk = RequestDesk(bus, "realizer", ended.append, term=TERM)
    key = keys.command(keys.BLOCK, "manager", "client")
    assert desk.take(Received(key, BLOCK, "client", 0.0, life="1")) is not None
    desk.accept("a")
    loop = asyncio.get_running_loop()
    renewal = KeepAlive(
        live=(Kept("perform_block", "a", 0, "", 20.0),), at=Stamp(bus.clock, 1.5), requester="client", life="1"
    )
    renewed = keys.command(keys.keep_alive("realizer"), "manager", "client")

    loop.call_at(1.9, stand_still, 5.0)
    loop.call_at(5.0 + came, lambda: desk.take(Received(renewed, renewal, "client", 5.0 + came, life="1")))
    await asyncio.sleep(10.0)

    assert [each.id for each in ended] == (["a"] if is_ended else [])


@pytest.mark.parametrize(("done", "is_left"), [(5.0 + 0.5 * LATE, False), (5.0 + 2.0 * LATE, True)])
async def test_what_others_have_done_while_one_stood_still_is_not_unfinished(
    hub: MemoryHub, done: Seconds, is_left: bool
) -> None:
    """It has 2 s, and the process stands still from 1.9 to 5."""
    bus, loop = hub.join("realizer"), asyncio.get_running_loop()
    theirs, others = loop.create_future(), loop.create_future()
    loop.call_at(1.0, others.set_result, None)
    loop.call_at(1.9, stand_still, 5.0)
    loop.call_at(done, theirs.set_result, None)

    assert await unfinished([theirs, others], 2.0, bus) == ({theirs} if is_left else set())


async def test_who_has_all_its_time_and_has_not_finished_is_told_when_that_is_over(hub: MemoryHub) -> None:
    bus, loop = hub.join("realizer"), asyncio.get_running_loop()

    assert await unfinished([never := loop.create_future()], 2.0, bus) == {never}
    assert loop.time() == 2.0
    assert await unfinished([], 2.0, bus) == set()
    assert loop.time() == 2.0
