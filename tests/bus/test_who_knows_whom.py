"""Clients see the robot, the robot sees its clients, and nobody is told of anybody else."""

import asyncio
import os
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack

import pytest
import pytest_asyncio

from engage_hri.schemas import keys
from engage_hri.services.bus.zenoh.hub import ZenohHub, open_hub
from engage_hri.services.requests.ends import RequestDesk, Requester
from tests.bus.places import PATIENCE, acquainted, free_endpoint, messages, numbers, state

pytestmark = pytest.mark.real_time

ROLES = {"control": "control", "camera": "perception", "alice": "manager", "bob": "manager", "viewer": "observer"}


@pytest_asyncio.fixture
async def crowd() -> AsyncIterator[dict[str, ZenohHub]]:
    """A process for each of these, with what a program of its kind subscribes to."""
    robot, end = f"known-{os.getpid()}", free_endpoint()
    async with AsyncExitStack() as stack:
        hubs: dict[str, ZenohHub] = {}
        for name, role in ROLES.items():
            options = {"connect": [end]} if hubs else {"listen": [end]}
            hubs[name] = hub = await open_hub(robot, mode="peer", **options)  # type: ignore[arg-type]
            stack.push_async_callback(hub.close)
            bus = hub.join(name, role)
            bus.subscribe(*(RequestDesk.patterns(name) if name == "control" else Requester.PATTERNS))
            bus.declare_alive()
        await acquainted(*hubs.values())
        yield hubs


async def settled(hub: ZenohHub, *others: ZenohHub) -> set[str]:
    """Names that a process knows, once all tokens that come have come: each is there before the next answer."""
    for other in others:
        await hub.peers.round_trip(other.run, PATIENCE)
    return set(hub.peers.names)


@pytest.mark.parametrize(
    ("who", "known"),
    [
        ("control", {"control", "camera", "alice", "bob"}),
        ("alice", {"control", "camera", "alice"}),
        ("viewer", {"control", "camera", "viewer"}),
    ],
)
async def test_each_knows_whom_it_needs_and_nobody_else(crowd: dict[str, ZenohHub], who: str, known: set[str]):
    until = asyncio.get_running_loop().time() + PATIENCE
    while not known <= crowd[who].peers.names.keys():
        assert await crowd[who].peers.change(until)

    assert await settled(crowd[who], *(each for name, each in crowd.items() if name != who)) == known


async def test_whoever_subscribes_to_all_is_told_of_all(crowd: dict[str, ZenohHub]):
    inbox = crowd["viewer"].join("window", "observer").subscribe(keys.ANY_ALIVE)

    seen = {each.participant for each in await messages(inbox, len(ROLES))}

    assert seen == set(ROLES)


async def test_a_client_knows_of_no_other_clients_past_and_the_service_does(crowd: dict[str, ZenohHub]):
    crowd["alice"]._buses["alice"].publish(keys.command(keys.BEHAVIOR, "manager", "alice"), state(1))
    crowd["control"]._buses["control"].publish(keys.FEEDBACK, state(2))
    late = crowd["bob"].join("late").subscribe(keys.FEEDBACK)

    assert numbers(await messages(late)) == [2]
    for other in ("alice", "control"):
        await crowd["bob"].peers.round_trip(crowd[other].run, PATIENCE)
        await crowd["control"].peers.round_trip(crowd["alice"].run, PATIENCE)
    assert set(crowd["bob"].peers.publishers) == {crowd["control"].run}
    assert set(crowd["control"].peers.publishers) == {crowd["alice"].run}


async def test_a_requester_that_goes_is_told_to_the_service(crowd: dict[str, ZenohHub]):
    inbox = crowd["control"]._buses["control"].subscribe(keys.ANY_CLIENT_ALIVE)
    there = {each.participant for each in await messages(inbox, 2)}
    await crowd["bob"].close()

    [gone] = await messages(inbox)

    assert (there, gone.participant) == ({"alice", "bob"}, "bob")
