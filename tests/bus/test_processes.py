"""Real processes on real sockets: started in any order, killed, restarted."""

import asyncio
import os
import signal
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, BlockOutcome, PerformBlock
from engage_hri.schemas.faults import RunFailed
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.services.bus.zenoh import hub as hub_module
from engage_hri.services.bus.zenoh.hub import ZenohHub, open_hub
from engage_hri.services.bus.zenoh.session import PEER_AFAR
from engage_hri.services.requests.ends import Requester
from tests.bus.peer import FAR
from tests.bus.places import PATIENCE, free_endpoint, messages, take

pytestmark = pytest.mark.real_time
PEER = Path(__file__).with_name("peer.py")


class Process:
    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process

    async def says(self, *words: str) -> None:
        """Wait until it says a line that starts like this."""
        assert self.process.stdout is not None
        heard = []
        async with asyncio.timeout(PATIENCE):
            while line := (await self.process.stdout.readline()).decode().split():
                heard.append(line)
                if line[: len(words)] == list(words):
                    return
        raise AssertionError(f"never said {words}, but {heard}")

    async def kill(self) -> None:
        self.process.send_signal(signal.SIGKILL)
        await self.process.wait()


class Town:
    """A rendezvous of its own, and the processes that use it."""

    def __init__(self) -> None:
        self.robot = f"town-{os.getpid()}"
        self.rendezvous = free_endpoint()
        self.processes: list[Process] = []
        self.hubs: list[ZenohHub] = []

    async def start(self, role: str, argument: str = "", **environment: str) -> Process:
        process = await asyncio.create_subprocess_exec(
            sys.executable, str(PEER), role, self.robot, self.rendezvous, argument,
            stdout=asyncio.subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": str(PEER.parents[2]), **environment},
        )  # fmt: skip
        self.processes.append(Process(process))
        return self.processes[-1]

    async def hub(self) -> ZenohHub:
        self.hubs.append(await open_hub(self.robot, rendezvous=self.rendezvous))
        return self.hubs[-1]

    async def close(self) -> None:
        for hub in self.hubs:
            await hub.close()
        for process in self.processes:
            if process.process.returncode is None:
                await process.kill()
            process.process._transport.close()  # type: ignore[attr-defined]


@pytest_asyncio.fixture
async def town() -> AsyncIterator[Town]:
    town = Town()
    yield town
    await town.close()


async def test_a_killed_process_is_missed_at_once(town: Town):
    inbox = (await town.hub()).join("watch").subscribe(keys.ANY_ALIVE)
    idler = await town.start("idle")
    [came] = await messages(inbox)
    assert isinstance(came, PeerAlive)
    loop = asyncio.get_running_loop()

    await idler.kill()
    killed = loop.time()
    [gone] = await take(inbox)

    assert gone.message == PeerGone(participant="idler")
    assert gone.at - killed < 1.0


@pytest.mark.parametrize("first", ["serve", "ask"])
async def test_requester_and_server_start_in_either_order(town: Town, first: str):
    if first == "serve":
        server = await town.start("serve", "0.05")
        await server.says("stands")
        client = await town.start("ask", "b")
    else:
        client = await town.start("ask", "b")
        await client.says("sent")
        server = await town.start("serve", "0.05")

    await client.says("outcome", "done")
    await client.says("leaves", "with", "1", "thread")

    assert await client.process.wait() == 0


async def test_the_first_process_may_go_and_come_back_while_others_stay(town: Town):
    holder = await town.start("idle")
    await holder.says("stands")
    server = await town.start("serve", "0.05")
    await server.says("stands")

    await holder.kill()
    client = await town.start("ask", "b")
    await client.says("outcome", "done")
    again = await town.start("ask", "c")
    await again.says("outcome", "done")


async def test_a_server_killed_in_the_middle_and_restarted_gives_one_terminal_state(town: Town):
    client = (await town.hub()).join("client")
    client.declare_alive()
    server = await town.start("serve", "60")
    states = client.subscribe(keys.ANY_REQUEST_STATE)
    async with Requester(client) as requests:
        pending = requests.send(keys.BLOCK, PerformBlock(id="b", requester="client", block=Block(id="b")))
        await asyncio.wait_for(pending.accepted, PATIENCE)

        await server.kill()
        again = await town.start("serve", "0.05")
        with pytest.raises(RunFailed, match="realizer"):
            await asyncio.wait_for(pending.outcome, PATIENCE)

        next_one = requests.send(keys.BLOCK, PerformBlock(id="c", requester="client", block=Block(id="c")))
        outcome = await asyncio.wait_for(next_one.outcome, PATIENCE)
        await again.says("ended", "c", "done")

    assert isinstance(outcome, BlockOutcome)
    assert (outcome.id, outcome.status) == ("c", "done")
    ended = []
    while len(states):
        [state] = await messages(states)
        ended += [state.id] if isinstance(state, BlockOutcome) else []
    assert ended == ["c"]


async def test_a_requester_killed_in_the_middle_ends_its_request_at_the_server(town: Town):
    server = await town.start("serve", "60")
    await server.says("stands")
    client = await town.start("ask", "b")
    await server.says("accepted", "b")

    await client.kill()

    await server.says("ended", "b", "interrupted")


async def test_what_is_published_right_before_the_end_arrives(town: Town):
    inbox = (await town.hub()).join("ear").subscribe(keys.FEEDBACK, keys.ANY_REQUEST_STATE)

    for _ in range(5):
        teller = await town.start("tell", "100")
        assert await teller.process.wait() == 0
        received = await messages(inbox, 101)

        assert [message.block for message in received[:100]] == [str(number) for number in range(100)]
        assert received[100] == BlockOutcome(id="last", block="last", status="done")


async def test_nobody_at_the_other_end_does_not_delay_opening_or_closing():
    loop = asyncio.get_running_loop()
    began = loop.time()

    async with await open_hub("lonely", connect=[free_endpoint()]) as hub:
        hub.join("me").publish(keys.FEEDBACK, BlockOutcome(id="b", block="b", status="done"))

    assert loop.time() - began < 1.0


async def test_stamps_of_another_machine_are_read_through_the_measured_offset(town: Town):
    hub = await town.hub()
    bus = hub.join("ear")
    measured = asyncio.Event()
    measure = hub.clocks.measured

    def and_tell(*trip: Any) -> None:
        measure(*trip)
        measured.set()

    hub.clocks.measured = and_tell  # type: ignore[method-assign]
    inbox = bus.subscribe(keys.FEEDBACK)
    await town.start("remark", FAR_CLOCK="1")

    [received] = await take(inbox)
    await asyncio.wait_for(measured.wait(), PATIENCE)

    stamp = received.message.at
    assert stamp.clock != bus.clock
    assert stamp.seconds - bus.now() > 12000.0
    assert 0.0 < hub.clocks.error(stamp.clock) < PATIENCE
    assert abs(bus.local(stamp) - (stamp.seconds - FAR)) <= hub.clocks.error(stamp.clock)


async def test_a_peer_of_other_machines_is_told_what_it_will_not_find_again(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    robot, end = f"afar-{os.getpid()}", free_endpoint()
    near = await open_hub(robot, listen=[end])
    await (await open_hub(robot, connect=[end], mode="peer")).close()
    assert caplog.messages == []

    monkeypatch.setattr(hub_module, "is_on_this_machine", lambda endpoint: False)
    for mode in ("peer", "client"):
        await (await open_hub(robot, connect=[end], mode=mode)).close()  # type: ignore[arg-type]

    assert [line for line in caplog.messages if "--connect for each" in line] == [PEER_AFAR]
    await near.close()
