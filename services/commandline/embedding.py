"""A robot with all its services in this process, over a bus in memory: for programs, and for commands.

async with embedded(human="listening") as robot:
    outcome = await robot.perform({"turn_status": "full", "parts": [{"say": "Hello!"}]})
    async with perceive("ben", hub=robot.hub) as ben:
        await ben.say("Hello, robot.")
"""

import asyncio
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import asynccontextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from engage_hri.schemas import keys
from engage_hri.services.bus.interface import Hub
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import Robot
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.recording_file import recording
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.console.follow import Sink, following
from engage_hri.services.control.bases.driver_guard import GuardedBody
from engage_hri.services.control.contract.body import Body
from engage_hri.services.runtime.configuration import read
from engage_hri.services.runtime.service import Service, running

if TYPE_CHECKING:
    from engage_hri.services.tangram.people.config import HumanKind


class EmbeddedRobot(Robot):
    """The client of a robot in this process. hub: its bus, for `perceive(..., hub=)` and `connect(hub=)`."""

    hub: Hub


@asynccontextmanager
async def embedded(
    *, human: "HumanKind" = "attentive", body: Body | None = None, settings: Iterable[str] = ()
) -> AsyncIterator[EmbeddedRobot]:
    """Run a robot and what is around it in this process, until the end of `async with`. Nobody else sees its bus.

    Nothing is read from files and environment. The robot is before the tangram table.

    human: who sits at the table: `attentive` looks where the robot looks, and answers; `none` is nobody, for people
        that `perceive` brings; docs/commands.md tells of the others.
    body: what moves, with the voice that it has; None: that of the settings, which simulate one.
    settings: `key=value` of docs/configuration.md, as `engage up --set` takes them; they are stronger than `human`.

    Raises:
        InputRefused: there is no such setting or body, or the tangram is not installed.
        RunFailed: the body cannot be had.
    """
    config = read(roster.complete(), settings=settings, defaults=(f"simulation.human={human}",))
    async with in_memory(config, services(config, *roster.ROBOT, "simulation", body=body)) as hub:
        bus = hub.join("program")
        try:
            async with EmbeddedRobot.on(bus) as robot:
                robot.hub = hub
                bus.declare_alive()
                yield robot
        finally:
            await bus.leave()


def services(config: RobotConfig, *names: str, body: Body | None = None) -> dict[str, Service]:
    """Bind these services to the configuration. body: that of control instead of the configured one.

    Raises InputRefused.
    """
    own = {} if body is None else {"control": {"body": GuardedBody(type(body).__name__, body)}}
    return {name: roster.service(name, config, **own.get(name, {})) for name in names}


@asynccontextmanager
async def in_memory(config: RobotConfig, services: Mapping[str, Service]) -> AsyncIterator[Hub]:
    """Run services in this process on a bus of their own, until the end of `async with`.

    An error in there is raised as it is, and so is that of a service which ends all; of several: an ExceptionGroup.
    """
    try:
        async with MemoryHub(config.robot, decodes=False) as hub, running(hub, services):
            yield hub
    except ExceptionGroup as group:
        if len(group.exceptions) > 1:
            raise
        raise group.exceptions[0] from None


async def play_tangram(config: RobotConfig, sinks: Iterable[Sink]) -> None:
    """Run all services until the task is over. sinks: get all messages, with instants of this loop."""
    async with tangram(config, sinks) as over:
        await over.wait()


@asynccontextmanager
async def tangram(
    config: RobotConfig,
    sinks: Iterable[Sink],
    hub: Hub | None = None,
    record: Path | None = None,
    *,
    senses: Iterable[str] = (),
) -> AsyncIterator[asyncio.Event]:
    """Run all services: the body of `async with` begins once they stand. Yields an event: the task is over.

    sinks: get all messages, with instants of this loop. hub: the bus on which they run, for others to look on; None:
    one in memory. record: a file for all that is said. senses: services that run as well.
    """
    async with MemoryHub(config.robot, decodes=False) if hub is None else nullcontext(hub) as hub:
        bound = services(config, *roster.PLAY, *senses)
        kept = recording(hub.join("record"), record, (keys.EVERYTHING,), {}) if record else nullcontext()
        bus = hub.join("console")
        try:
            async with kept, following(bus, sinks), running(hub, bound) as over:
                yield over
        finally:
            await bus.leave()
