"""The life of a service: it joins the hub under its name, subscribes, shows its token, serves until cancelled.

A service is one coroutine function of its bus, its configuration and `ready`, which it calls once its
subscriptions are made. Each answers questions for its status (`keys.status`). No message ends a service: an error
while one is taken ends at most the block or event of that message (`Bus.containing`). An error elsewhere ends the
process, loudly.
"""

import asyncio
import re
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable, Mapping
from contextlib import asynccontextmanager
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused, NotReady
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import AskStatus, PeerAlive, ServiceSettings, SettingsFile, Status, text_of
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus import journal
from engage_hri.services.bus.interface import Bus, Hub, Subscription

# -- settings that are told ------------------------------------------------------------------------------------------

HIDDEN = "(hidden)"
"""Value that stands for one that is secret."""
LARGEST_FILE = 256 * 1024
"""Bytes: of a longer file only the name is told."""
_SECRET = re.compile(
    r"(?:^|[_\W])(?:(?:api|access|private|ssh)?keys?|tokens?|secrets?|pass(?:word|wd|phrase|code)s?|credentials?"
    r"|cert(?:ificate)?s?|auth(?:orization)?|bearer|cookies?)(?:$|[_\W])"
)
_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
_LOGIN = re.compile(r"(?<=://)[^/@\s]+@")


def tell_settings(bus: Bus, name: str, config: Struct, files: Iterable[str] = (), **more: object) -> None:
    """Publish the settings under which this life of a service runs. What cannot be told is a fault, and no more.

    name: section of the configuration. files: names of the files that it names. more: values that stand beside the
    sections.
    """
    with bus.containing("telling the settings"):
        settings = {**more, name: config}
        texts = {file: text for file in files if (text := _text(file)) is not None}
        told = ServiceSettings(
            participant=bus.name, run=bus.run, version=installed_version(), at=bus.stamp(),
            settings=text_of(shown(settings)),
            files=tuple(SettingsFile(name=file, text=text) for file, text in texts.items()),
        )  # fmt: skip
        bus.publish(keys.settings(bus.name), told)


def shown(settings: object) -> dict[str, Any]:
    """Settings as plain values, without what is secret by the name of its key, or as a login in an address."""
    packed = msgspec.msgpack.encode(msgspec.to_builtins(settings, str_keys=True, enc_hook=str))
    plain: dict[str, Any] = msgspec.msgpack.decode(packed)
    return {name: _shown(value, name) for name, value in plain.items()}


def _shown(value: Any, name: str) -> Any:
    if is_secret(name) and value not in (None, "", [], {}):
        return HIDDEN
    if isinstance(value, dict):
        return {str(inner): _shown(one, str(inner)) for inner, one in value.items()}
    if isinstance(value, list):
        return [_shown(one, name) for one in value]
    return _LOGIN.sub(f"{HIDDEN}@", value) if isinstance(value, str) else value


def is_secret(name: str) -> bool:
    """Tell whether a key by its name holds what nobody else is to know: `api_key`, `password`, `accessToken`."""
    return _SECRET.search(_CAMEL.sub("_", name).lower()) is not None


def _text(file: str) -> str | None:
    """The text of a file; None: it is none, or too long."""
    try:
        data = Path(file).read_bytes()
        return data.decode() if len(data) <= LARGEST_FILE else None
    except (OSError, UnicodeError, ValueError):
        return None


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
