"""Where the contract is tested: on the memory bus and on Zenoh with real sockets, each as several processes."""

import asyncio
import os
import socket
from typing import Any

import zenoh

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.requests import Accepted
from engage_hri.services.bus.interface import Bus, Hub, Received, Subscription
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.bus.zenoh.hub import ZenohHub, open_hub
from engage_hri.services.bus.zenoh.session import open_session

PATIENCE = 60.0
"""Seconds until something that must come counts as lost. A limit of failure, never waited for."""


def free_endpoint() -> str:
    """Where nobody listens yet, and nobody else will: each process of tests has a loopback address of its own.

    Ports of 127.0.0.1 are shared with all that runs here, other runs of these tests among them.
    """
    with socket.socket() as probe:
        try:
            probe.bind((OWN_ADDRESS, 0))
        except OSError:  # only Linux has them all without being asked
            probe.bind(("127.0.0.1", 0))
        host, port = probe.getsockname()
        return f"tcp/{host}:{port}"


OWN_ADDRESS = f"127.{64 + (os.getpid() >> 16) % 128}.{os.getpid() >> 8 & 255}.{os.getpid() & 255}"


class MemoryPlace:
    """All processes of a robot share the hub; participants are apart anyway."""

    is_real = False

    def __init__(self) -> None:
        self._hubs: dict[str, MemoryHub] = {}

    async def process(self, robot: str = "robot") -> Hub:
        return self._hubs.setdefault(robot, MemoryHub(robot))

    async def inject(self, key: str, payload: bytes, encoding: str) -> None:
        self._hubs["robot"].inject(key, payload, encoding)

    async def close(self) -> None:
        for hub in self._hubs.values():
            await hub.close()


class ZenohPlace:
    """Each process is a session of its own, over TCP, though in this one process."""

    is_real = True

    def __init__(self) -> None:
        self._rendezvous = free_endpoint()
        self._hubs: list[ZenohHub] = []
        self._robot = f"contract-{os.getpid()}-"

    async def process(self, robot: str = "robot") -> Hub:
        hub = await self._open(self._robot + robot)
        self._hubs.append(hub)
        await acquainted(*(known for known in self._hubs if known.robot == hub.robot))
        return hub

    async def _open(self, robot: str) -> ZenohHub:
        return await open_hub(robot, rendezvous=self._rendezvous)

    async def inject(self, key: str, payload: bytes, encoding: str) -> None:
        """As a program that knows only Zenoh."""
        session = self._outside()
        loop, matched = asyncio.get_running_loop(), asyncio.Event()
        publisher = session.declare_publisher(key, congestion_control=zenoh.CongestionControl.BLOCK)

        def changed(status: zenoh.MatchingStatus) -> None:
            loop.call_soon_threadsafe(matched.set)

        publisher.declare_matching_listener(zenoh.handlers.Callback(changed, indirect=False))
        if not publisher.matching_status.matching:
            await asyncio.wait_for(matched.wait(), PATIENCE)
        publisher.put(payload, encoding=encoding)
        publisher.undeclare()

    def _outside(self) -> Any:
        """A session that is no participant's."""
        return self._hubs[-1].session

    async def close(self) -> None:
        for hub in self._hubs:
            await hub.close()


class SharedPlace(ZenohPlace):
    """Services of one group without keys: each "process" of a robot is one session, and all is in memory."""

    _program: Any = None

    async def _open(self, robot: str) -> ZenohHub:
        return next((hub for hub in self._hubs if hub.robot == robot), None) or await super()._open(robot)

    def _outside(self) -> Any:
        self._program = self._program or open_session(self._hubs[0].robot, [self._rendezvous], [], None)[0]
        return self._program

    async def close(self) -> None:
        await super().close()
        if self._program is not None:
            self._program.close()


class GroupPlace(ZenohPlace):
    """Services of one group with keys: each has a session, and they hear each other in memory.

    Each third one is in another process.
    """

    async def _open(self, robot: str) -> ZenohHub:
        others = [hub for hub in self._hubs if hub.robot == robot]
        beside = others[0] if others and len(others) % 3 != 2 else None
        return await open_hub(robot, rendezvous=self._rendezvous, beside=beside)


class SharedLoop(asyncio.SelectorEventLoop):
    """The loop of a test that runs in a `SharedPlace`."""


class GroupLoop(asyncio.SelectorEventLoop):
    """The loop of a test that runs in a `GroupPlace`."""


Place = MemoryPlace | ZenohPlace


async def acquainted(*hubs: ZenohHub) -> None:
    """Wait until all know one another."""
    loop = asyncio.get_running_loop()
    deadline = loop.time() + PATIENCE
    for hub in hubs:
        for other in hubs:
            while other not in hub.process and await hub.peers.round_trip(other.run, PATIENCE) is None:
                assert loop.time() < deadline, f"{hub.run} never met {other.run}"
                await asyncio.sleep(0.01)


async def matched(hub: ZenohHub, key: str) -> None:
    """Wait until what the hub publishes on the key goes to somebody."""
    loop, match = asyncio.get_running_loop(), asyncio.Event()
    publisher: Any = hub.session.declare_publisher(key)
    handler: Any = zenoh.handlers.Callback(lambda status: loop.call_soon_threadsafe(match.set), indirect=False)
    publisher.declare_matching_listener(handler)
    if not publisher.matching_status.matching:
        await asyncio.wait_for(match.wait(), PATIENCE)
    publisher.undeclare()


async def take(subscription: Subscription, count: int = 1) -> list[Received]:
    """The next `count` messages. Fails when they do not come."""
    taken: list[Received] = []
    for _ in range(count):
        received = await subscription.next(asyncio.get_running_loop().time() + PATIENCE)
        assert received is not None, f"{len(taken)} of {count} messages came: {taken}"
        taken.append(received)
    return taken


async def messages(subscription: Subscription, count: int = 1) -> list[Any]:
    return [received.message for received in await take(subscription, count)]


async def heard(bus: Bus, key: str, message: Message, inbox: Subscription) -> Any:
    """Publish on a stream until it is heard: what goes before the subscription is known is lost, as it may be."""
    while True:
        bus.publish(key, message)
        received = await inbox.next(bus.now() + 0.02)
        if received is not None:
            return received.message


def state(number: int) -> Accepted:
    return Accepted(id=str(number))


def numbers(received: list[Accepted]) -> list[int]:
    return [int(message.id) for message in received]


def echo(question: Message) -> Message:
    assert isinstance(question, Accepted)
    if question.id == "bad":
        raise InputRefused(Fault(reason="bad indeed", where="here"))
    return Accepted(id=question.id + "!")
