"""Command `engage up`: run services on this machine until Ctrl-C, each as a process, in groups, or all in this."""

import sys
from asyncio import Event
from collections.abc import AsyncIterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from typing import Annotated

import typer
from msgspec import json
from rich.console import Console
from rich.text import Text

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.config import mode_of
from engage_hri.services.bus.interface import Bus, Hub
from engage_hri.services.commandline.embedding import services as bound
from engage_hri.services.commandline.robot.run import ready_line
from engage_hri.services.commandline.shell.options import Embodied, Hearing, Listening, Simulated, Written
from engage_hri.services.commandline.shell.outputs import Outputs, complain
from engage_hri.services.commandline.shell.process import DONE, run_until_signal
from engage_hri.services.commandline.shell.roster import ROBOT, TASK, Groups, complete, groups, widest
from engage_hri.services.commandline.shell.settings import ELSEWHERE, FROM_PAGES, TRANSCRIPT, RobotConfig
from engage_hri.services.commandline.shell.supervisor import Child, supervised
from engage_hri.services.console.follow import Sink, following
from engage_hri.services.console.terminal import tally
from engage_hri.services.console.terminal.live import Tallying, scene_view
from engage_hri.services.control.bases import drivers
from engage_hri.services.perception.hearing.microphone import is_file
from engage_hri.services.runtime.installation import extra_command, has_hearing
from engage_hri.services.runtime.service import Service, check_name, running, while_alone

NAME = "up"
"""Name on the bus: of two of a robot, as of two services of one name, one goes on."""
WITHOUT_TASK = ("simulation.human=attentive",)
"""Setting without the task: a person who reacts to the robot."""
ALL_UP = "all services are up; Ctrl-C stops them"
STYLES = ("cyan", "magenta", "green", "yellow", "blue", "red")


@dataclass(frozen=True, kw_only=True)
class Options(Written, Simulated, Embodied, Hearing, Listening):
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
    config = options.read(kind, defaults=(*(TRANSCRIPT if options.task else WITHOUT_TASK), *FROM_PAGES))
    drivers.check(config.control)
    grouped = _groups(options, config)
    with Outputs(options.events, options.feedback) as outputs:
        console = outputs.console(quiet=options.quiet)
        run_until_signal(_up(options, grouped, config, outputs, console))
    return DONE


async def _up(options: Options, grouped: Groups, config: RobotConfig, outputs: Outputs, console: Console) -> None:
    # Our own session comes first and stays, for children find one another through it, and may crash.
    async with await options.open(config.bus, NAME, options.listen or ()) as hub:
        check_name(hub, NAME)
        await hub.wait_until_free(NAME)
        bus = hub.join(NAME)
        bus.declare_alive()
        try:
            await while_alone(bus, _serve(options, grouped, config, outputs, console, hub, bus))
        finally:
            await bus.leave()


async def _serve(
    options: Options, grouped: Groups, config: RobotConfig, outputs: Outputs, console: Console, hub: Hub, bus: Bus
) -> None:
    # Nobody is left to look after one group of all: it is this process. Loaded before it serves: messages would wait
    # for that.
    services = bound(config, *grouped[0]) if len(grouped) == 1 else {}
    # Whoever is started at the same moment is seen meanwhile: before anything runs, one of the two has ended.
    await hub.wait_until_free(*(name for names in grouped for name in names))
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
            over = await stack.enter_async_context(serving)
            await over.wait()
    if options.task:
        console.print(tally.render(tallying.tally, config.robot))


def without_faults(show: Sink) -> Sink:
    """Show all but faults: the services print theirs on standard error."""

    def told(message: Message, at: Seconds) -> None:
        if not isinstance(message, Fault):
            show(message, at)

    return told


def _groups(options: Options, config: RobotConfig) -> Groups:
    """Divide the services among processes. Raises InputRefused."""
    others = (*ELSEWHERE,) if options.task else tuple(name for name in ("simulation",) if hasattr(config, name))
    names = (*ROBOT, *_senses(options, config), *others)
    if options.in_one and options.together:
        reason, advice = "--in-one is all together already", "leave one of the two out"
        raise InputRefused(Fault(reason=reason, where="--together", advice=advice))
    return (names,) if options.in_one else groups(names, options.together or ())


def _senses(options: Options, config: RobotConfig) -> tuple[str, ...]:
    """Ears for a robot that has a voice, or whose sound is given. Raises InputRefused."""
    if options.source is None and not config.control.has_voice:
        return ()
    if is_file(config.hearing.source):
        reason, advice = (
            "a file ends, and a robot goes on",
            "`engage run hearing --from FILE.wav` beside it",
        )
        raise InputRefused(Fault(reason=reason, where="--from", advice=advice))
    if not has_hearing():
        fault = Fault(reason="nobody is heard: hearing is not installed", advice=extra_command("hearing"))
        if options.source is not None:
            raise InputRefused(fault)
        complain(str(fault))
        return ()
    return ("hearing",)


@asynccontextmanager
async def _each(options: Options, grouped: Groups, config: RobotConfig, console: Console) -> AsyncIterator[Event]:
    """Run each group of services in a process of its own. Yields an event: the task is over; never without one."""
    ready = {ready_line(name) for names in grouped for name in names}
    missing = {*ready}
    titles = {",".join(names): names for names in grouped}
    width = max(map(len, titles))
    styles = dict(zip(titles, STYLES, strict=False))

    def tell(title: str, line: str) -> None:
        console.print(Text(f"{title:>{width}} │ ", style=styles[title]) + Text(line), soft_wrap=True)
        if missing and line in ready:
            missing.discard(line)
            if not missing:
                console.print(ALL_UP, highlight=False)

    children = {
        title: Child(title, command(title, options, config), tell, once=TASK in names)
        for title, names in titles.items()
    }
    async with supervised(children):
        over = [child.ended for child in children.values() if child.once]
        yield over[0] if over else Event()


@asynccontextmanager
async def in_one(services: Mapping[str, Service], hubs: Mapping[str, Hub], console: Console) -> AsyncIterator[Event]:
    """Run the services in this process, each on its hub. Yields an event: the task is over.

    The error that ends a service is raised.
    """
    async with running(hubs, services) as over:
        console.print(ALL_UP, highlight=False)
        yield over


def command(names: str, options: Options, config: RobotConfig) -> list[str]:
    """Make a child's command line: `engage run NAMES`, with our interpreter, bus and configuration."""
    # Values decided here, by default or by option, are passed on, so that all children agree.
    simulation = getattr(config, "simulation", None)
    settings = (
        *options.overrides,
        f"recognition.gaze_resolution={config.recognition.gaze_resolution}",
        *([f"simulation.human={simulation.human}"] if simulation is not None else []),
        f"hearing.source={json.encode(config.hearing.source).decode()}",
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
