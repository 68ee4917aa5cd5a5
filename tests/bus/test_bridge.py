"""What waits between Zenoh's threads and the loop."""

import asyncio
import os
from types import SimpleNamespace

import pytest
import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message, encode
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.services.bus.interface import Keep, Received, Subscription
from engage_hri.services.bus.zenoh import bridge as bridging
from engage_hri.services.bus.zenoh.bridge import PLACES, Arrived
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.bus.zenoh.readers import LOOK
from tests.bus.places import PATIENCE, acquainted, free_endpoint, matched, messages, numbers, state

BLOCK = zenoh.CongestionControl.BLOCK


def arrived(item: object) -> list[Arrived]:
    """Messages in an item of a queue."""
    return [one for one in (item if isinstance(item, tuple) else (item,)) if isinstance(one, Arrived)]


pytestmark = pytest.mark.real_time


@pytest.mark.parametrize("key", [keys.FEEDBACK, keys.NET])
async def test_a_message_that_waits_for_the_loop_keeps_nothing_of_zenohs_buffers(key: str):
    """Each sample would keep all of the buffer that it came in: kilobytes for a few bytes of message."""
    robot, end, loop = f"bridge-{os.getpid()}", free_endpoint(), asyncio.get_running_loop()
    here, there = await open_hub(robot, listen=[end]), await open_hub(robot, connect=[end])
    await acquainted(here, there)
    inbox, speaker = here.join("here").subscribe(key), there.join("there")
    await matched(there, key)

    speaker.publish(key, state(1))
    queue, deadline = here.bridge._streams if key == keys.NET else here.bridge._ordered, loop.time() + PATIENCE
    while not (waiting := [one for _, item, *_ in tuple(queue) for one in arrived(item)]):
        assert loop.time() < deadline

    assert [each.key for each in waiting] == [key]
    assert all(type(getattr(waiting[0], name)) in (str, bytes, bool) for name in waiting[0].__struct_fields__)
    assert numbers(await messages(inbox)) == [1]
    await there.close()
    await here.close()


async def test_a_flood_of_one_process_costs_the_others_nothing(monkeypatch: pytest.MonkeyPatch):
    """Who comes and goes is told, what others send arrives, and a question is answered, however much waits."""
    robot, end = f"flooded-{os.getpid()}", free_endpoint()
    here = await open_hub(robot, listen=[end])
    hubs = [await open_hub(robot, connect=[end]) for _ in range(3)]
    loud, quiet, comer = (hub.join(name) for hub, name in zip(hubs, ("loud", "quiet", "comer"), strict=True))
    for hub in hubs:
        await acquainted(here, hub)
    inbox = here.join("here").subscribe(keys.FEEDBACK, keys.ANY_ALIVE, capacity=100)
    for hub in hubs:
        await matched(hub, keys.FEEDBACK)

    monkeypatch.setattr(bridging, "CROWD_OF_ONE", 1000 * bridging.EACH)
    for _ in range(3000):  # nothing runs on the loop meanwhile
        hubs[0].session.put(keys.FEEDBACK, encode(state(0)), encoding="application/msgpack", congestion_control=BLOCK)
    deadline = asyncio.get_running_loop().time() + PATIENCE
    while not here.bridge.traffic.dropped:
        assert asyncio.get_running_loop().time() < deadline
    comer.declare_alive()
    quiet.publish(keys.FEEDBACK, state(1))
    trip = asyncio.create_task(hubs[1].peers.round_trip(here.run, PATIENCE))

    found: set[object] = set()
    async with asyncio.timeout(PATIENCE):
        while len(found) < 2:
            received = await inbox.next()
            assert received is not None
            if isinstance(received.message, PeerAlive) and received.message.participant == "comer":
                found.add("comer")
            if received.source == "quiet":
                found.add("quiet")
    assert await trip is not None
    assert await hubs[0].peers.round_trip(here.run, PATIENCE) is not None  # behind all that it has sent
    assert here.bridge._came == here.bridge._left == {}
    await loud.leave()
    for hub in (*hubs, here):
        await hub.close()


async def test_one_item_waits_for_a_share_of_a_flood_only():
    order: list[str] = []
    bridge = bridging.LoopBridge(lambda error, what: None)
    for number in range(5000):
        bridge._let_in_of("loud", 1, order.append, f"loud {number}")
    bridge._let_in_of("quiet", 1, order.append, "quiet")
    for _ in range(5001 // bridging.BATCH + 2):
        await asyncio.sleep(0)

    assert bridge.waiting == 0
    assert order.index("quiet") == PLACES
    assert [one for one in order if one != "quiet"] == [f"loud {number}" for number in range(5000)]
    assert bridge._came == bridge._left == {}


async def test_a_token_overtakes_no_message_of_its_process_that_waits():
    robot, end = f"gone-{os.getpid()}", free_endpoint()
    here, there = await open_hub(robot, listen=[end]), await open_hub(robot, connect=[end])
    await acquainted(here, there)
    inbox, loud = here.join("here").subscribe(keys.FEEDBACK, keys.ANY_ALIVE), there.join("loud")
    loud.declare_alive()
    await matched(there, keys.FEEDBACK)
    loud.publish(keys.FEEDBACK, state(0))
    async with asyncio.timeout(PATIENCE):
        while (first := await inbox.next()) is None or isinstance(first.message, PeerAlive):
            pass  # from then on no message waits for the answer to a question about the past
    for number in range(10 * PLACES):
        loud.publish(keys.FEEDBACK, state(number))
    deadline = asyncio.get_running_loop().time() + PATIENCE

    def waiting() -> int:
        return sum(getattr(item, "key", "") == keys.FEEDBACK for _, item, *_ in list(here.bridge._ordered))

    while waiting() < 10 * PLACES:  # nothing runs on the loop meanwhile
        assert asyncio.get_running_loop().time() < deadline
    loud._token.undeclare()
    loud._token = None

    came: list[object] = []
    async with asyncio.timeout(PATIENCE):
        while not came or not isinstance(came[-1], PeerGone):
            received = await inbox.next()
            assert received is not None
            came.append(received.message)
    assert len([one for one in came if not isinstance(one, PeerAlive | PeerGone)]) == 10 * PLACES
    await there.close()
    await here.close()


async def test_the_links_are_not_looked_at_for_each_message_of_a_stranger():
    looks: list[float] = []

    class Session:
        @property
        def info(self) -> object:
            looks.append(0.0)
            return SimpleNamespace(routers_zid=lambda: ["router"], peers_zid=list)

    async with await open_hub(f"looks-{os.getpid()}", listen=[free_endpoint()]) as hub:
        readers, loop = hub.readers, asyncio.get_running_loop()
        readers._session = Session()  # type: ignore[assignment]
        began = loop.time()
        lives = {
            readers._foreign_life(Arrived("k", b"", "", None, "", stamped_by, is_put=True))
            for _ in range(2000)
            for stamped_by in ("router", "itself")
        }

        assert lives == {"", "itself"}
        assert len(looks) <= 1 + (loop.time() - began) / LOOK


def test_a_full_queue_drops_of_the_loudest_and_never_who_comes_and_goes():
    closed: list[Subscription] = []
    inbox = Subscription(["**"], Keep.EVERY, 10, closed.append)

    def offer(life: str, message: Message, number: int) -> None:
        inbox.offer(Received(f"engage/v1/evt/{life}/fault", message, life, float(number), life=life))

    for number in range(4):
        offer("quiet", state(number), number)
    for number in range(8):
        name = f"p{number}"
        inbox.offer(Received(keys.alive(name, "client"), PeerGone(participant=name), name, float(number)))
    for number in range(1000):
        offer("loud", state(number), number)

    kept = list(inbox._queue)
    assert len([one for one in kept if isinstance(one.message, PeerGone)]) == 8
    assert [one.at for one in kept if one.life == "loud"] == [999.0]
    assert [one.at for one in kept if one.life == "quiet"] == [3.0]
    assert inbox.overflowed == 1002


async def test_the_lag_of_the_loop_is_that_of_the_first_that_waited_whatever_came_after_it():
    bridge, taken, loop = bridging.LoopBridge(lambda error, text: None), [], asyncio.get_running_loop()
    until = loop.time() + 0.05

    bridge._let_in(taken.append, 1)
    while loop.time() < until:  # nothing runs on the loop meanwhile
        pass
    bridge._let_in(taken.append, 2)
    await asyncio.sleep(0)

    assert taken == [1, 2]
    assert bridge.traffic.lag > 0.04
