"""Joining of a robot's bus by its collaboration manager."""

import uuid
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager

from engage_hri.services.bus.config import Mode
from engage_hri.services.bus.interface import Hub
from engage_hri.services.client.robot import Robot
from engage_hri.services.runtime.configuration import bus_config


@asynccontextmanager
async def connect(
    robot: str | None = None,
    *,
    connect: Sequence[str] = (),
    mode: Mode | None = None,
    listen: Sequence[str] = (),
    hub: Hub | None = None,
    name: str = "",
    keys: str = "",
) -> AsyncIterator[Robot]:
    """Join a robot's bus as a collaboration manager. The robot may come later: what is asked of it waits.

    If its services are not all in sight after 3 s, a warning in the log `engage` says which, and why. What is not
    given is taken from the variables `ENGAGE_BUS_ROBOT`, `ENGAGE_BUS_CONNECT` and their like, else from the section
    `[bus]` of the file that `ENGAGE_CONFIG` names.

    robot: the robot's namespace on the bus; `robot` where nothing says otherwise.
    connect: Zenoh endpoints to connect to, such as `tcp/192.0.2.1:7447`; none: this machine's.
    mode: client of a router, or peer; auto: client if an endpoint is on another machine.
    listen: Zenoh endpoints to listen on.
    hub: use this one instead; it stays open.
    name: the participant's, unique on the robot's bus; made up when empty. With keys, their holder's comes before it.
    keys: folder of keys that `engage keys` has made.

    Raises:
        InputRefused: the keys are no good, an endpoint is misspelled, or the file or a variable is wrong.
        RunFailed: an endpoint that is to be listened on is taken.
        ValueError: a name that cannot be in a key, or that the hub has already.
    """
    if hub is not None:
        async with _joined(hub, name) as client:
            yield client
        return
    # Only here: a client on an existing hub needs no Zenoh.
    from engage_hri.services.bus.keyring import read_keys
    from engage_hri.services.bus.zenoh.hub import open_hub
    from engage_hri.services.bus.zenoh.neighbors import hinting

    bus = bus_config(robot=robot, connect=tuple(connect), mode=mode, keys=keys)
    own = read_keys(bus.keys, "manager") if bus.keys else None
    async with (
        await open_hub(bus.robot, connect=bus.connect, listen=listen, mode=bus.mode, keys=own) as opened,
        _joined(opened, name) as client,
        hinting(client._bus, bus.connect),
    ):
        yield client


@asynccontextmanager
async def _joined(hub: Hub, name: str) -> AsyncIterator[Robot]:
    bus = hub.join(name or f"client-{uuid.uuid4().hex[:8]}")
    try:
        async with Robot.on(bus) as client:
            bus.declare_alive()
            yield client
    finally:
        await bus.leave()
