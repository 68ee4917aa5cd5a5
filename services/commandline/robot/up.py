"""Command `engage up`: run services on this machine until Ctrl-C, each as a process, in groups, or all in this."""

import asyncio
import sys
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import typer
from rich.console import Console
from rich.text import Text

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.config import mode_of
from engage_hri.services.bus.interface import Hub
from engage_hri.services.commandline.embedding import services as bound
from engage_hri.services.commandline.robot.one_per_robot import claiming
from engage_hri.services.commandline.robot.run import ready_line
from engage_hri.services.commandline.shell.options import Embodied, Listening, Simulated, Written
from engage_hri.services.commandline.shell.outputs import Outputs
from engage_hri.services.commandline.shell.process import DONE, run_until_signal
from engage_hri.services.commandline.shell.roster import ROBOT, TASK, Groups, complete, groups, widest
from engage_hri.services.commandline.shell.settings import ELSEWHERE, TRANSCRIPT, RobotConfig
from engage_hri.services.commandline.shell.supervisor import Child, supervised
from engage_hri.services.console.follow import Sink, following
from engage_hri.services.console.terminal import tally
from engage_hri.services.console.terminal.live import Tallying, scene_view
from engage_hri.services.control.bases import drivers
from engage_hri.services.runtime.service import Service, running

WITHOUT_TASK = ("simulation.human=attentive",)
"""Setting without the task: a person who reacts to the robot."""
STYLES = ("cyan", "magenta", "green", "yellow", "blue", "red")


@dataclass(frozen=True, kw_only=True)
class Options(Written, Simulated, Embodied, Listening):
    task: Annotated[bool, typer.Option("--task", help="Also run the tangram task, and end when it ends.")] = False
    together: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME,NAME",
            help="Services that share a process, and speak in memory: realizer,control. May be repeated.",
            show_default="a process for each",
        ),
    ] = None
    in_one: Annotated[
        bool, typer.Option("--in-one", help="All services together, in this process: one that crashes ends all.")
    ] = False


def main(options: Options) -> int:
    # A bad configuration is refused here, and not by every child.
    kind = complete() if options.task else widest()
    config = options.read(kind, defaults=TRANSCRIPT if options.task else WITHOUT_TASK)
    drivers.check(config.control)
    grouped = _groups(options, config)
    with Outputs(options.events, options.feedback) as outputs:
        console = outputs.console(quiet=options.quiet)
        run_until_signal(_up(options, grouped, config, outputs, console))
    return DONE


async def _up(options: Options, grouped: Groups, config: RobotConfig, outputs: Outputs, console: Console) -> None:
    # Nobody is left to look after one group of all: it is this process. Loaded before there is a bus: messages would
    # wait for that.
    services = bound(config, *grouped[0]) if len(grouped) == 1 else {}
    # Our own session comes first and stays, for children find one another through it, and may crash.
    async with await options.open(config.bus, "up", options.listen or ()) as hub, claiming(hub) as claim:
        await claim.granted()
        await hub.wait_until_free(*(name for names in grouped for name in names))
        bus = claim.bus
        tallying = Tallying(bus.now())
        live = options.task and console.is_terminal and not options.quiet
        with scene_view(console, config.robot, bus.now(), live) as show:
            sinks = (without_faults(show), tallying, outputs) if options.task else (outputs,)
            async with AsyncExitStack() as stack:
                await stack.enter_async_context(following(bus, sinks))
                if services:
                    hubs = await stack.enter_async_context(options.hubs(config.bus, services, hub))
                    serving = in_one(services, hubs, console)
                else:
                    serving = _each(options, grouped, config, console)
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


def _groups(options: Options, config: RobotConfig) -> Groups:
    """Divide the services among processes. Raises InputRefused."""
    others = (*ELSEWHERE,) if options.task else tuple(name for name in ("simulation",) if hasattr(config, name))
    names = (*ROBOT, *others)
    if options.in_one and options.together:
        reason, advice = "--in-one is all together already", "leave one of the two out"
        raise InputRefused(Fault(reason=reason, where="--together", advice=advice))
    return (names,) if options.in_one else groups(names, options.together or ())


class Life(NamedTuple):
    """Events in the life of the services. up: all of them are ready. over: the task has ended; never without one."""

    up: asyncio.Event
    over: asyncio.Event


@asynccontextmanager
async def _each(options: Options, grouped: Groups, config: RobotConfig, console: Console) -> AsyncIterator[Life]:
    """Run each group of services in a process of its own."""
    ready = {ready_line(name): name for names in grouped for name in names}
    arrivals = Arrivals(ready.values(), console)
    titles = {",".join(names): names for names in grouped}
    width = max(map(len, titles))
    styles = dict(zip(titles, STYLES, strict=False))

    def tell(title: str, line: str) -> None:
        console.print(Text(f"{title:>{width}} │ ", style=styles[title]) + Text(line), soft_wrap=True)
        if line in ready:
            arrivals(ready[line])

    children = {
        title: Child(title, command(title, options, config), tell, once=TASK in names)
        for title, names in titles.items()
    }
    async with supervised(children):
        over = [child.ended for child in children.values() if child.once]
        yield Life(arrivals.complete, over[0] if over else asyncio.Event())


@asynccontextmanager
async def in_one(services: Mapping[str, Service], hubs: Mapping[str, Hub], console: Console) -> AsyncIterator[Life]:
    """Run the services in this process, each on its hub. The error that ends one of them is raised."""
    arrivals = Arrivals(services, console)
    async with running(hubs, services) as over:
        for name in services:
            arrivals(name)
        yield Life(arrivals.complete, over)


def command(names: str, options: Options, config: RobotConfig) -> list[str]:
    """Make a child's command line: `engage run NAMES`, with our interpreter, bus and configuration."""
    # Values decided here, by default or by option, are passed on, so that all children agree.
    simulation = getattr(config, "simulation", None)
    settings = (
        *options.overrides,
        f"recognition.gaze_resolution={config.recognition.gaze_resolution}",
        *([f"simulation.human={simulation.human}"] if simulation is not None else []),
        f"bus.mode={mode_of(config.bus.mode, config.bus.connect, options.listen or (), config.bus.keys)}",
    )
    endpoints = (*(options.listen or ()), *config.bus.connect)
    return [
        *(sys.executable, "-P", "-m", "engage_hri", "run", names, "--attended", "--robot", config.robot),
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
