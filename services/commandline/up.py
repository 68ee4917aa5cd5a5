"""Command `engage up`: run the services on this machine until Ctrl-C, as processes or all in this one."""

import asyncio
import sys
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import typer
from rich.console import Console
from rich.text import Text

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.config import mode_of
from engage_hri.services.bus.interface import Hub
from engage_hri.services.commandline.claim import claiming
from engage_hri.services.commandline.config import Config
from engage_hri.services.commandline.demo import DEFAULTS, Tallying, scene_view
from engage_hri.services.commandline.embedding import services as bound
from engage_hri.services.commandline.options import Embodied, Listening, Simulated, Written
from engage_hri.services.commandline.outputs import Outputs
from engage_hri.services.commandline.process import DONE, run_until_signal
from engage_hri.services.commandline.roster import ROBOT
from engage_hri.services.commandline.run import ready_line
from engage_hri.services.commandline.supervisor import Child, supervised
from engage_hri.services.commandline.tangram import ending
from engage_hri.services.console import tally
from engage_hri.services.console.follow import Sink, following
from engage_hri.services.control import drivers
from engage_hri.services.runtime.service import Service, running

WITHOUT_TASK = ("simulation.human=attentive",)
"""Setting without the task: a person who reacts to the robot."""
TASK = "collaboration"
"""Service that ends by itself, with the task."""
STYLES = ("cyan", "magenta", "green", "yellow", "blue", "red")


@dataclass(frozen=True, kw_only=True)
class Options(Written, Simulated, Embodied, Listening):
    task: Annotated[bool, typer.Option("--task", help="Also run the tangram task, and end when it ends.")] = False
    in_one: Annotated[
        bool,
        typer.Option("--in-one", help="All services in this process: lighter, but one that crashes ends all."),
    ] = False


def main(options: Options) -> int:
    # A bad configuration is refused here, and not by every child.
    config = options.load(defaults=DEFAULTS if options.task else WITHOUT_TASK)
    drivers.check(config.control)
    with Outputs(options.events, options.feedback) as outputs:
        console = outputs.console(quiet=options.quiet)
        run_until_signal(_up(options, config, outputs, console))
    return DONE


async def _up(options: Options, config: Config, outputs: Outputs, console: Console) -> None:
    # Loaded before there is a bus: messages would wait for that.
    services = bound(config, *_names(options)) if options.in_one else {}
    # Our own session comes first and stays, for children find one another through it, and may crash.
    async with await options.open(config.bus, "up", options.listen or ()) as hub, claiming(hub) as claim:
        await claim.granted()
        await hub.wait_until_free(*_names(options))
        bus = claim.bus
        tallying = Tallying(bus.now())
        live = options.task and console.is_terminal and not options.quiet
        with scene_view(console, config.robot, bus.now(), live) as show:
            sinks = (without_faults(show), tallying, outputs) if options.task else (outputs,)
            async with AsyncExitStack() as stack:
                await stack.enter_async_context(following(bus, sinks))
                hubs = await _hubs(options, config, services, hub, stack)
                serving = in_one(services, hubs, console) if services else _each(options, config, console)
                life = await stack.enter_async_context(serving)
                group = await stack.enter_async_context(asyncio.TaskGroup())
                holding = group.create_task(claim.held_until(life.up), name="claim")
                await life.over.wait()
                holding.cancel()
    if options.task:
        console.print(tally.render(tallying.tally, config.robot, console.width))


def without_faults(show: Sink) -> Sink:
    """Show all but faults: the services print theirs on standard error."""

    def told(message: Message, at: Seconds) -> None:
        if not isinstance(message, Fault):
            show(message, at)

    return told


def _names(options: Options) -> tuple[str, ...]:
    return (*ROBOT, "simulation", TASK) if options.task else (*ROBOT, "simulation")


class Life(NamedTuple):
    """Events in the life of the services. up: all of them are ready. over: the task has ended; never without one."""

    up: asyncio.Event
    over: asyncio.Event


@asynccontextmanager
async def _each(options: Options, config: Config, console: Console) -> AsyncIterator[Life]:
    """Run each service in a process of its own."""
    names = _names(options)
    arrivals = Arrivals(names, console)
    width = max(map(len, names))
    styles = dict(zip(names, STYLES, strict=False))

    def tell(name: str, line: str) -> None:
        console.print(Text(f"{name:>{width}} │ ", style=styles[name]) + Text(line), soft_wrap=True)
        if line == ready_line(name):
            arrivals(name)

    children = {name: Child(name, command(name, options, config), tell, once=name == TASK) for name in names}
    async with supervised(children):
        yield Life(arrivals.complete, children[TASK].ended if options.task else asyncio.Event())


async def _hubs(
    options: Options, config: Config, names: Iterable[str], hub: Hub, stack: AsyncExitStack
) -> dict[str, Hub]:
    """The hub of each service in this process: `hub`, or one of its own with its keys."""
    if not config.bus.keys:
        return dict.fromkeys(names, hub)
    return {name: await stack.enter_async_context(await options.open(config.bus, name)) for name in names}


@asynccontextmanager
async def in_one(services: Mapping[str, Service], hubs: Mapping[str, Hub], console: Console) -> AsyncIterator[Life]:
    """Run the services in this process, each on its hub. The error that ends one of them is raised."""
    arrivals, over = Arrivals(services, console), asyncio.Event()
    task = {TASK: ending(services[TASK], over)} if TASK in services else {}
    async with running(hubs, {**services, **task}):
        for name in services:
            arrivals(name)
        yield Life(arrivals.complete, over)


def command(name: str, options: Options, config: Config) -> list[str]:
    """Make a child's command line: `engage run NAME`, with our interpreter, bus and configuration."""
    # Values decided here, by default or by option, are passed on, so that all children agree.
    settings = (
        *options.overrides,
        f"recognition.gaze_resolution={config.recognition.gaze_resolution}",
        f"simulation.human={config.simulation.human}",
        f"bus.mode={mode_of(config.bus.mode, config.bus.connect, options.listen or (), config.bus.keys)}",
    )
    endpoints = (*(options.listen or ()), *config.bus.connect)
    return [
        *(sys.executable, "-P", "-m", "engage_hri", "run", name, "--attended", "--robot", config.robot),
        *(("--config", str(options.config)) if options.config else ()),
        *(("--log", str(options.log)) if options.log else ()),
        *(part for level in _log_levels(options) for part in ("--log-level", level)),
        *(part for setting in settings for part in ("--set", setting)),
        *(part for endpoint in endpoints for part in ("--connect", endpoint)),
    ]


def _log_levels(options: Options) -> list[str]:
    """Log levels of a child. Peers are logged once, by `up` itself, unless the command line says otherwise."""
    given = options.log_level or []
    return ["peers=warning", *given] if options.log else given


class Arrivals:
    """Counter of the children that are ready; prints once that all are. Those of another `up` do not count."""

    def __init__(self, names: Iterable[str], console: Console) -> None:
        self._missing = set(names)
        self._console = console
        self.complete = asyncio.Event()

    def __call__(self, name: str) -> None:
        self._missing.discard(name)
        if not self._missing and not self.complete.is_set():
            self.complete.set()
            self._console.print("all services are up; Ctrl-C stops them", highlight=False)
