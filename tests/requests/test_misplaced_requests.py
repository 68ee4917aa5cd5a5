"""A request of the wrong kind for its key is refused, and told what belongs there and where it belongs itself."""

import asyncio
from typing import get_args

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import TurnSignal
from engage_hri.schemas.blocks import Block, InterruptBehavior, PerformBlock
from engage_hri.schemas.body import GoHome
from engage_hri.schemas.fragments import Inhibit, PerformFragment, TurnFragment
from engage_hri.schemas.messages import COMMANDS, Message
from engage_hri.schemas.recognition import SignalTurn
from engage_hri.schemas.requests import Refused, Request
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.shell.roster import service
from engage_hri.services.requests.ends import Requester, RequestRefused
from engage_hri.services.runtime.service import running
from tests.commanding import command

FRAGMENT = PerformFragment(id="r", requester="test", fragment=TurnFragment(id="f", turn_status="full"))
BLOCK = PerformBlock(id="r", requester="test", block=Block(id="b"))
SIGNAL = SignalTurn(
    id="r",
    requester="test",
    signal=TurnSignal(id="s", turn="t", signal="ended", actor="human"),
    at=Stamp("", 0.0),
)
SERVERS = ("generation", "realizer", "recognition", "control")
MISPLACED: list[tuple[Request, str, str, str]] = [
    (FRAGMENT, keys.BLOCK, "PerformBlock and InterruptBehavior", keys.FRAGMENT),
    (BLOCK, keys.FRAGMENT, "PerformFragment", keys.BLOCK),
    (BLOCK, keys.INHIBIT, "Inhibit", keys.BLOCK),
    (Inhibit(id="r", requester="test", part="gaze", ttl=1.0), keys.FRAGMENT, "PerformFragment", keys.INHIBIT),
    (InterruptBehavior(id="r", requester="test", block="b", behavior="x"), keys.BEHAVIOR, "GoHome", keys.BLOCK),
    (SIGNAL, keys.EVENT, "RequestEvent", keys.TURN),
    (GoHome(id="r", requester="test"), keys.TURN, "SignalTurn", keys.BEHAVIOR),
]


@pytest.mark.parametrize(("request_", "key", "expected", "home"), MISPLACED)
async def test_it_is_refused_by_every_service(request_: Request, key: str, expected: str, home: str) -> None:
    services = {name: service(name, Config()) for name in SERVERS}
    async with MemoryHub() as hub, running(hub, services):
        bus = hub.join("test")
        async with Requester(bus) as requests:
            pending = requests.send(key, request_)
            with pytest.raises(RequestRefused) as refusal:
                await asyncio.wait_for(asyncio.shield(pending.outcome), 1.0)
        await bus.leave()

    fault = refusal.value.fault
    here, there = (keys.command(expression, "manager", "test") for expression in (key, home))
    assert fault.reason.startswith(f"{type(request_).__name__} came on {here}, which takes ")
    assert expected in fault.reason
    assert fault.advice == f"send it on {there}"
    assert (fault.where, fault.service) == ("r", keys.server_of(key))


@pytest.mark.parametrize(
    ("key", "xml", "home"),
    [
        (keys.BLOCK, '<ebml:ebml xmlns:ebml="edu.wpi.ebml" id="x" turnStatus="full"/>', keys.FRAGMENT),
        (keys.FRAGMENT, '<bml id="x"/>', keys.BLOCK),
    ],
)
async def test_so_is_xml_by_its_id(key: str, xml: str, home: str) -> None:
    services = {name: service(name, Config()) for name in SERVERS}
    async with MemoryHub() as hub, running(hub, services):
        with hub.join("test").subscribe(keys.ANY_REQUEST_STATE) as inbox:
            hub.inject(keys.command(key, "manager", "me"), xml.encode(), "application/xml")
            received = await asyncio.wait_for(inbox.next(), 1.0)

    assert received is not None
    assert isinstance(received.message, Refused)
    told = received.message
    there = keys.command(home, "manager", "me")
    assert (told.id, told.requester, told.fault.advice) == ("x", "me", f"send it on {there}")


async def test_what_is_under_way_by_the_same_id_goes_on() -> None:
    services = {name: service(name, Config()) for name in SERVERS}
    async with MemoryHub() as hub, running(hub, services):
        bus = hub.join("test")
        async with Requester(bus) as requests:
            inhibited = requests.send(keys.INHIBIT, Inhibit(id="r", requester="test", part="gaze", ttl=5.0))
            await inhibited.accepted
            command(bus, keys.INHIBIT, BLOCK)
            await asyncio.sleep(1.0)

            assert not inhibited.outcome.done()
            requests.cancel("r")
            await inhibited.outcome
        await bus.leave()


def test_every_command_that_may_travel_has_its_key() -> None:
    commands = {kind for kind in get_args(Message) if issubclass(kind, Request)}

    assert {kind for kinds in COMMANDS.values() for kind in kinds} == {
        kind for kind in commands if kind.__name__ != "Cancel"
    }
