"""A link that is cut and comes back, through a proxy between two processes' sessions."""

import asyncio
import os
from collections.abc import AsyncIterator

import pytest
import pytest_asyncio

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, BlockOutcome, PerformBlock
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.services.bus.zenoh.hub import ZenohHub, open_hub
from engage_hri.services.requests.ends import RequestDesk, Requester
from tests.bus.cable import Cable
from tests.bus.places import PATIENCE, acquainted, free_endpoint, messages, numbers, state
from tests.commanding import command

pytestmark = pytest.mark.real_time


@pytest_asyncio.fixture
async def apart() -> AsyncIterator[tuple[ZenohHub, ZenohHub, Cable]]:
    """Two processes that know each other only through the cable."""
    robot, end = f"cut-{os.getpid()}", free_endpoint()
    cable = Cable(end)
    await cable.join()
    here = await open_hub(robot, listen=[end])
    there = await open_hub(robot, connect=[cable.endpoint])
    await acquainted(here, there)
    yield here, there, cable
    await there.close()
    await here.close()
    await cable.cut()


async def test_what_is_published_during_a_cut_arrives_in_order_and_once(apart: tuple[ZenohHub, ZenohHub, Cable]):
    hub, far_hub, cable = apart
    here, there = hub.join("here"), far_hub.join("there")
    ways = [keys.FEEDBACK, keys.BLOCK, keys.request_state("there")]
    inbox = here.subscribe(*ways)
    for number in range(-3, 0):
        there.publish(ways[number], state(number))
    await messages(inbox, 3)

    await cable.cut()
    for number in range(200):
        there.publish(ways[number % 3], state(number))
    await cable.join()
    command(there, keys.BLOCK, state(200))

    assert numbers(await messages(inbox, 201)) == list(range(201))
    assert here.health.lost == 0
    assert there.health.peers == ()


async def test_a_cut_shows_as_gone_and_back_in_the_same_life(apart: tuple[ZenohHub, ZenohHub, Cable]):
    hub, far_hub, cable = apart
    far_hub.join("there").declare_alive()
    inbox = hub.join("here").subscribe(keys.ANY_ALIVE)
    [first] = await messages(inbox)

    await cable.cut()
    [gone] = await messages(inbox)
    await cable.join()
    [back] = await messages(inbox)

    assert gone == PeerGone(participant="there")
    assert isinstance(back, PeerAlive)
    assert back == first


async def test_a_cut_shorter_than_the_grace_neither_loses_nor_doubles_an_outcome(
    apart: tuple[ZenohHub, ZenohHub, Cable],
):
    hub, far_hub, cable = apart
    server, client = hub.join("realizer"), far_hub.join("client")
    taken: list[str] = []
    desk = RequestDesk(server, "realizer", lambda cancel: taken.append("cancel"))
    inbox = server.subscribe(*RequestDesk.patterns("realizer"))
    states = client.subscribe(keys.ANY_REQUEST_STATE)
    server.declare_alive()
    client.declare_alive()

    async def serve() -> None:
        async for received in inbox:
            match desk.take(received):
                case PerformBlock(id=id):
                    taken.append(id)
                    desk.accept(id)

    serving = asyncio.create_task(serve(), name="serve")
    async with Requester(client) as requests:
        pending = requests.send(keys.BLOCK, PerformBlock(id="b", requester="client", block=Block(id="b")))
        await asyncio.wait_for(pending.accepted, PATIENCE)
        await cable.cut()
        desk.end(BlockOutcome(id="b", block="b", status="done"))
        with server.subscribe(keys.WORLD) as never:
            await never.next(server.now() + 0.5)
        await cable.join()

        outcome = await asyncio.wait_for(pending.outcome, PATIENCE)

    assert isinstance(outcome, BlockOutcome)
    assert (outcome.id, outcome.status) == ("b", "done")
    assert taken == ["b"]
    heard = await messages(states, len(states))
    assert {message.status for message in heard if isinstance(message, BlockOutcome)} == {"done"}
    inbox.close()
    await serving


async def test_an_endpoint_where_nobody_listens_yet_is_tried_until_somebody_does():
    robot, end = f"early-{os.getpid()}", free_endpoint()
    early = await open_hub(robot, connect=[end])
    with early.join("early").subscribe(keys.ANY_ALIVE) as inbox:
        assert await inbox.next(asyncio.get_running_loop().time() + 1.0) is None
        late = await open_hub(robot, listen=[end])
        late.join("late").declare_alive()

        [came] = await messages(inbox)

    assert isinstance(came, PeerAlive)
    await late.close()
    await early.close()
