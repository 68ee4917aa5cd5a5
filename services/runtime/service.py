"""The life of a service: it joins the hub under its name, subscribes, shows its token, serves until cancelled.

A service is one coroutine function of its bus, its configuration and `ready`, which it calls once its
subscriptions are made. Each answers questions for its status (`keys.status`). No message ends a service: an error
while one is taken ends at most the block or event of that message (`Bus.containing`). An error elsewhere ends the
process, loudly.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine, Mapping
from contextlib import asynccontextmanager
from functools import cache
from typing import Any

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused, NotReady
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import AskStatus, PeerAlive, Status
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus import journal
from engage_hri.services.bus.interface import Bus, Hub, Subscription

Ready = Callable[[], None]
Service = Callable[[Bus, Ready], Coroutine[Any, Any, None]]
"""Coroutine function with its configuration bound already (`functools.partial(realize, config=...)`)."""


def check_name(hub: Hub, name: str) -> None:
    """Raise InputRefused if the keys of this process are somebody else's."""
    called = hub.called(name)
    if called != name:
        reason = f"the keys are those of {called.removesuffix(f'-{name}')!r}, not of {name!r}"
        raise InputRefused(Fault(reason=reason, where=name, advice="give it the folder of its own keys"))


async def serve(hub: Hub, name: str, service: Service, ready: Ready = lambda: None) -> None:
    """Run one service on the hub until it is cancelled or fails. Raises InputRefused if another one is there."""
    check_name(hub, name)
    await hub.wait_until_free(name)
    bus = hub.join(name)
    joined = bus.stamp()
    since: Stamp | None = None

    def stands() -> None:
        nonlocal since
        since = bus.stamp()
        bus.declare_alive()
        ready()

    def status(question: Message) -> Status:
        return Status(
            participant=name, run=bus.run, version=installed_version(),
            at=bus.stamp(), joined=joined, stands=since, bus=bus.health,
            process=hub.facts(),
        )  # fmt: skip

    bus.answer(keys.status(name), status, empty=AskStatus())
    try:
        await while_alone(bus, service(bus, stands))
    finally:
        await bus.leave()


async def while_alone(bus: Bus, work: Coroutine[Any, Any, None]) -> None:
    """Wait for the end of the work, or until another participant of this name has precedence: then raise NotReady.

    One that starts while another is there is refused before it begins. So two of one name have started at once, or
    without seeing one another, as behind a cut. Neither knows who was first; the one of the lesser run stays.
    """
    with bus.subscribe(keys.alive(bus.name, bus.part)) as presence:
        serving = asyncio.ensure_future(work)
        watching = asyncio.create_task(_rival(bus, presence), name=f"rivals of {bus.name}")
        try:
            await asyncio.wait((serving, watching), return_when=asyncio.FIRST_COMPLETED)
        finally:
            is_over = serving.done()
            serving.cancel()
            watching.cancel()
            await asyncio.wait((serving, watching))
        if is_over or not serving.cancelled():
            serving.result()
        elif not watching.cancelled():
            watching.result()


async def _rival(bus: Bus, presence: Subscription) -> None:
    async for received in presence:
        match received.message:
            case PeerAlive(participant=bus.name, run=run) if run and run != bus.run:
                where, advice = bus.name, "stop one of the two, or give it another --robot"
                if run < bus.run:
                    reason = f"robot {bus.robot!r} has this on the bus twice; the other one stays"
                    raise NotReady(Fault(reason=reason, where=where, advice=advice))
                told = "robot %r has %s on the bus twice; this one stays (%s)"
                journal.alert(bus.log, told, bus.robot, where, advice)


@cache
def installed_version() -> str:
    """Version of Engage, as its package says; `unknown` without one."""
    from importlib.metadata import PackageNotFoundError, version  # loads the parser of e-mail, and few ask

    try:
        return version("engage-hri")
    except PackageNotFoundError:  # run from its sources
        return "unknown"


@asynccontextmanager
async def running(hub: Hub | Mapping[str, Hub], services: Mapping[str, Service]) -> AsyncIterator[asyncio.Event]:
    """Run services in this process. The body of `async with` starts when all are ready, and its end stops them.

    hub: that of all, or of each by name. Yields an event: one of them has ended by itself, as the task does.
    """
    hubs = dict.fromkeys(services, hub) if isinstance(hub, Hub) else hub
    ended = asyncio.Event()
    standing = {name: asyncio.Event() for name in services}
    async with asyncio.TaskGroup() as group:
        tasks = [
            group.create_task(
                _until_it_ends(hubs[name], name, service, standing[name], ended), name=f"service {name}"
            )
            for name, service in services.items()
        ]
        try:
            for stands in standing.values():
                await stands.wait()
            yield ended
        finally:
            for task in reversed(tasks):
                if not task.cancelling():  # the group has, if one has failed: a second one would break off its end
                    task.cancel()


async def _until_it_ends(
    hub: Hub, name: str, service: Service, standing: asyncio.Event, ended: asyncio.Event
) -> None:
    await serve(hub, name, service, standing.set)
    if not standing.is_set():
        raise RuntimeError(f"service {name} ended before it stood")
    ended.set()
