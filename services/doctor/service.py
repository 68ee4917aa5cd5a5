"""Gathering of the facts for `engage doctor`: from this machine, from the bus, and from all who take part in it.

Each question has a bound, and who is silent is not asked again.
"""

import asyncio
import os
import platform
import socket
import ssl
import time
import uuid
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import msgspec

from engage_hri.schemas import keys
from engage_hri.schemas.access import PARTICIPANTS, ROUTER, Holder, role_of
from engage_hri.schemas.body import Capabilities, DescribeBody
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.participants import AskStatus, ProcessFacts, Status
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.bus.config import ENDPOINT, BusConfig, is_encrypted, is_on_this_machine
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.keyring import HOLDERS, WHO, Keys, Who, read_keys
from engage_hri.services.bus.zenoh.hub import ZenohHub, open_hub
from engage_hri.services.bus.zenoh.neighbors import protocols, robots
from engage_hri.services.bus.zenoh.session import RENDEZVOUS, ROUTER_WITH_KEYS
from engage_hri.services.doctor.findings import (
    BodyFacts,
    Certificate,
    EndpointFacts,
    ParticipantFacts,
    SystemFacts,
    WorldFacts,
)
from engage_hri.services.runtime.service import installed_version

KNOCK: Seconds = 2.0
"""Time in which an endpoint has to open."""
OPEN: Seconds = 5.0
"""Time for joining the bus."""
COME: Seconds = 2.0
"""Time for all who are there to show, at most."""
QUIET: Seconds = 0.3
ANSWER: Seconds = 1.5
"""Time for an answer."""
AGAIN: Seconds = 1.0
"""Time between two looks at what is lost."""
TELLS: Seconds = 0.3
"""Time that a router takes to refuse a certificate."""
TRIPS = 5
HOLDER = "viewer"
"""Whose keys are taken, where the folder of keys is that of several."""


@asynccontextmanager
async def examining(bus: BusConfig) -> AsyncIterator[SystemFacts]:
    """Gather the facts, for the body of `async with`; then leave the bus. What cannot be had is a fact, too."""
    facts, own = await _outside(bus)
    endpoints = tuple(door.endpoint for door in facts.doors)
    if facts.problem is not None or all(door.problem for door in facts.doors):
        yield facts
        return
    try:
        async with asyncio.timeout(OPEN):
            hub = await open_hub(bus.robot, connect=endpoints, mode=bus.mode, rendezvous=None, keys=own)
    except TimeoutError:
        reason = "somebody opens there, and lets us in to no bus"
        advice = "is it a router of Engage, and does its log tell of a refused link?"
        yield msgspec.structs.replace(facts, problem=Fault(reason=reason, where=", ".join(endpoints), advice=advice))
        return
    except EngageError as error:
        yield msgspec.structs.replace(facts, problem=error.fault)
        return
    async with hub:
        yield await _look_around(hub, facts, endpoints)


async def _outside(bus: BusConfig) -> tuple[SystemFacts, Keys | None]:
    """Gather what can be learned without the bus."""
    own, problem = _keys(bus)
    endpoints = bus.connect or ((ROUTER_WITH_KEYS,) if bus.keys else (RENDEZVOUS,))
    doors = tuple(await asyncio.gather(*(_knock(endpoint, own) for endpoint in endpoints)))
    facts = SystemFacts(
        robot=bus.robot, at=time.time(), version=installed_version(), protocol=keys.PREFIX, own=_itself(),
        services=keys.SERVICES, doors=doors, bus=False, problem=problem,
        certificates=tuple(_certificates(bus)),
    )  # fmt: skip
    return facts, own


def _itself() -> ProcessFacts:
    """Tell what this process runs on, without a bus."""
    zenoh = version("eclipse-zenoh")
    return ProcessFacts(host=platform.node(), python=platform.python_version(), wall=time.time(), zenoh=zenoh)


async def _look_around(hub: ZenohHub, facts: SystemFacts, endpoints: tuple[str, ...]) -> SystemFacts:
    """Add what can be learned on the bus."""
    bus = hub.join(f"doctor-{uuid.uuid4().hex[:8]}", "observer")
    hub.peers.see(keys.ANY_ALIVE)
    with suppress(TimeoutError):
        async with asyncio.timeout(COME):
            await hub.peers.wait_for_quiet(QUIET)
    known, body, sight = await asyncio.gather(_participants(hub, bus), _body(hub, bus), _sight(bus))
    found: tuple[str, ...] = ()
    spoken: tuple[str, ...] = ()
    if hub.rights is None:
        spoken = await protocols(hub.session, COME)
        if not any(one.name in keys.SERVICES for one in known):
            found = tuple(name for name in await robots(endpoints) if name != hub.robot)
    return msgspec.structs.replace(
        facts, bus=True, own=hub.facts(), known=known, clocks=hub.clocks.offsets, found=found, protocols=spoken,
        body=body if any(one.name == "control" for one in known) else None, sight=sight,
    )  # fmt: skip


async def _participants(hub: ZenohHub, bus: Bus) -> tuple[ParticipantFacts, ...]:
    seen = {name: tuple(runs) for name, runs in hub.peers.names.items() if name != bus.name}
    first = dict(
        zip(seen, await asyncio.gather(*(_ask(hub, bus, name, runs) for name, runs in seen.items())), strict=True)
    )
    elsewhere = {name for one in first.values() if one.status is not None for name in one.status.bus.peers}
    hidden = sorted(elsewhere - set(seen) - {bus.name})
    await asyncio.sleep(AGAIN)
    later = await asyncio.gather(*(_status(bus, name) for name, one in first.items() if one.status is not None))
    afterwards = {status.participant: status for status in later if status is not None}
    parts = {name: part for part, name in hub.peers.participants}
    known = [
        msgspec.structs.replace(one, part=parts.get(name, one.part), later=afterwards.get(name))
        for name, one in first.items()
    ]
    known += [
        ParticipantFacts(
            name=name, part=keys.part_of(role_of(name)), seen=False, lives=0, answers=name in PARTICIPANTS
        )
        for name in hidden
    ]
    order = {name: number for number, name in enumerate(PARTICIPANTS)}
    return tuple(sorted(known, key=lambda one: (order.get(one.name, len(order)), one.name)))


async def _ask(hub: ZenohHub, bus: Bus, name: str, runs: tuple[str, ...]) -> ParticipantFacts:
    """Ask one participant all that it can answer for itself."""
    trips = []
    for _ in range(TRIPS):
        trip = await hub.peers.round_trip(runs[0], ANSWER)
        if trip is None:
            break  # it is silent: it is not asked again
        trips.append(trip)
    asked = time.time()
    status = await _status(bus, name) if trips else None
    wall = 0.0
    if status is not None and status.process.wall:
        wall = status.process.wall - (asked + time.time()) / 2
    return ParticipantFacts(
        name=name, lives=len(runs), answers=status is not None or name in PARTICIPANTS, status=status,
        trip=min(trips, default=None), wall=wall,
    )  # fmt: skip


async def _status(bus: Bus, name: str) -> Status | None:
    try:
        answer = await bus.query(keys.status(name), AskStatus(), ANSWER)
    except EngageError:
        return None
    return answer if isinstance(answer, Status) else None


async def _body(hub: ZenohHub, bus: Bus) -> BodyFacts | None:
    """Ask for the body; None if our keys do not let us ask."""
    try:
        if hub.rights is not None:
            hub.rights.check(bus.name, "asks", keys.DESCRIBE)
    except InputRefused:
        return None
    try:
        answer = await bus.query(keys.DESCRIBE, DescribeBody(), ANSWER)
    except EngageError as error:
        return BodyFacts(problem=error.fault.reason)
    return (
        BodyFacts(name=answer.body, types=answer.types)
        if isinstance(answer, Capabilities)
        else BodyFacts(problem="nonsense")
    )


async def _sight(bus: Bus) -> WorldFacts | Literal["unknown"] | None:
    """Wait for the last world; `unknown` if our keys do not let us look."""
    try:
        subscription = bus.subscribe(keys.WORLD)
    except InputRefused:
        return "unknown"
    with subscription as worlds:
        received = await worlds.next(bus.now() + ANSWER)
    if received is None or not isinstance(received.message, World):
        return None
    world = received.message
    age = 0.0 if world.at is None else max(0.0, bus.now() - bus.local(world.at))
    return WorldFacts(source=received.source, people=len(world.people), objects=len(world.objects), age=age)


# -- this machine ---------------------------------------------------------------------------------------------------


def _keys(bus: BusConfig) -> tuple[Keys | None, Fault | None]:
    if not bus.keys:
        return None, None
    try:
        return read_keys(bus.keys, HOLDER), None
    except InputRefused as error:
        return None, error.fault


def _certificates(bus: BusConfig) -> Iterator[Certificate]:
    """Certificates of all holders in the folder of keys who were not revoked, as far as the folder tells.

    What cannot be read is a problem that `_keys` tells.
    """
    folder = Path(bus.keys)
    let_in: set[str] | None = None
    with suppress(OSError, msgspec.DecodeError, UnicodeDecodeError):
        listed = msgspec.json.decode((folder / ROUTER / HOLDERS).read_bytes(), type=list[Holder])
        let_in = {holder.common_name for holder in listed}
    for file in sorted([*folder.glob(WHO), *folder.glob(f"*/{WHO}")]) if bus.keys else ():
        with suppress(OSError, msgspec.DecodeError, UnicodeDecodeError):
            who = msgspec.json.decode(file.read_bytes(), type=Who)
            if let_in is None or who.common_name in let_in:
                yield Certificate(name=who.common_name, until=who.until)


async def _knock(endpoint: str, own: Keys | None) -> EndpointFacts:
    """Try whether somebody opens at an endpoint, and, with keys, whether both sides like the other's certificate."""
    is_closed = is_encrypted(endpoint)
    door = EndpointFacts(endpoint=endpoint, is_local=is_on_this_machine(endpoint), is_closed=is_closed)
    match = ENDPOINT.fullmatch(endpoint)
    assert match is not None, "the configuration has checked it"
    host, port = match["host"].strip("[]"), int(match["port"])
    secured: Any = None
    try:
        if is_closed and own is not None:
            secured = ssl.create_default_context(cafile=own.authority)
            secured.load_cert_chain(own.certificate, own.private)
        async with asyncio.timeout(KNOCK):
            reader, writer = await asyncio.open_connection(host, port, ssl=secured)
        try:
            shown = writer.get_extra_info("peercert") or {}
            until = int(ssl.cert_time_to_seconds(shown["notAfter"])) if "notAfter" in shown else None
            if secured is not None:  # one who dislikes our certificate says so after we have shown it
                with suppress(TimeoutError):
                    async with asyncio.timeout(TELLS):
                        await reader.read(1)
        finally:
            writer.transport.abort()
    except TimeoutError:
        return msgspec.structs.replace(door, problem=f"no answer within {KNOCK:g} s")
    except socket.gaierror:
        return msgspec.structs.replace(door, problem=f"nobody knows the name {host!r}")
    except ssl.SSLCertVerificationError as error:
        return msgspec.structs.replace(door, problem=f"its certificate is not good: {error.verify_message}")
    except ssl.SSLError as error:
        reason = (error.reason or str(error)).replace("_", " ").lower()
        return msgspec.structs.replace(
            door, problem=f"it refuses our certificate, or is no router with keys: {reason}"
        )
    except OSError as error:
        return msgspec.structs.replace(door, problem=_reason(error))
    return msgspec.structs.replace(door, until=until)


def _reason(error: OSError) -> str:
    match error:
        case ConnectionRefusedError():
            return "no process listens there"
        case ConnectionResetError():
            return "it closes the link at once"
    return os.strerror(error.errno) if error.errno else str(error)
