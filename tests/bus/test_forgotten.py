"""A link that Zenoh has forgotten is opened anew, and all that was on its way comes.

That Zenoh forgets one needs full links and late threads, seconds of them: `python -m tests.rigs.deaf`. Here its table
is read as one that lacks a process; all else is real.
"""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest
import zenoh

from engage_hri.schemas import keys
from engage_hri.services.bus.zenoh.bridge import LoopBridge
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.bus.zenoh.links import Forgotten
from engage_hri.services.bus.zenoh.router import routing
from engage_hri.services.bus.zenoh.session import open_router
from tests.bus.places import PATIENCE, acquainted, free_endpoint, messages, numbers, state

pytestmark = pytest.mark.real_time


class Forgetful:
    """A session whose table of transports lacks one process, once; or the session as it is."""

    def __init__(self, session: zenoh.Session, run: str = "") -> None:
        self.info = self
        self._real: Any = session.info
        self._run = run

    def transports(self) -> list[Any]:
        run, self._run = self._run, ""
        return [each for each in self._real.transports() if str(each.zid) != run]

    def __getattr__(self, name: str) -> Any:
        return getattr(self._real, name)


@pytest.mark.parametrize("where", ["router", "process"])
async def test_a_link_that_zenoh_has_forgotten_is_opened_anew_and_nothing_is_lost(where: str) -> None:
    endpoint, lines = free_endpoint(), asyncio.Queue[str]()
    bridge = LoopBridge(lambda error, what: lines.put_nowait(f"{what}: {error}"))
    router = open_router([], [endpoint], {})
    here = await open_hub("robot", connect=[endpoint], mode="client")
    there = await open_hub("robot", connect=[endpoint], mode="client")
    await acquainted(here, there)
    inbox, far = here.join("here").subscribe(keys.BLOCK), there.join("there")
    ended = asyncio.Event()
    info: Any = here.session.info
    listener = info.declare_transport_events_listener(
        bridge.on_loop(lambda event: ended.set() if event.kind == zenoh.SampleKind.DELETE else None)
    )

    session, run = (router, here.run) if where == "router" else (here.session, str(router.zid()))
    forgetful: Any = Forgetful(session, run)
    forgotten = Forgotten(forgetful, lines.put_nowait)
    changes = forgetful.declare_link_events_listener(bridge.on_loop(forgotten.changed), history=True)
    for number in range(100):
        far.publish(keys.BLOCK, state(number))
    async with asyncio.timeout(PATIENCE):
        assert await lines.get() == f"deaf: Zenoh sends process {run} nothing any more; their link is opened anew"
        await ended.wait()
    for number in range(100, 200):
        far.publish(keys.BLOCK, state(number))

    assert numbers(await messages(inbox, 200)) == list(range(200))
    assert lines.empty()
    for each in (changes, listener):
        each.undeclare()
    forgotten.close()
    for hub in (here, there):
        await hub.close()
    bridge.close()
    router.close()  # type: ignore[no-untyped-call]


async def test_links_that_zenoh_knows_are_left_alone_also_while_they_come_and_go() -> None:
    endpoint, lines = free_endpoint(), list[str]()
    async with routing([endpoint], [], lines.append):
        for _ in range(12):
            hub = await open_hub("robot", connect=[endpoint], mode="client")
            assert await hub.is_linked(asyncio.get_running_loop().time() + PATIENCE)
            await hub.close()
    assert not [line for line in lines if "deaf" in line]


def test_a_session_that_forgets_nobody_is_read_as_it_is() -> None:
    session: Any = SimpleNamespace(info=SimpleNamespace(transports=lambda: [SimpleNamespace(zid="a")]))
    forgetful = Forgetful(session, "a")

    assert [len(forgetful.transports()) for _ in range(2)] == [0, 1]
