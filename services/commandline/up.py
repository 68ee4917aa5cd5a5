"""Command `engage up`: run the services as processes on this machine, supervised until Ctrl-C."""

import asyncio
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import typer
from rich.console import Console
from rich.text import Text

from engage_hri.services.bus.config import mode_of
from engage_hri.services.commandline.claim import claiming
from engage_hri.services.commandline.config import Config
from engage_hri.services.commandline.demo import DEFAULTS, Tallying, scene_view
from engage_hri.services.commandline.options import Listening, Simulated, Written
from engage_hri.services.commandline.outputs import Outputs
from engage_hri.services.commandline.process import DONE, forever, run_until_signal
from engage_hri.services.commandline.roster import ROBOT
from engage_hri.services.commandline.run import ready_line
from engage_hri.services.commandline.supervisor import Child, supervised
from engage_hri.services.console import tally
from engage_hri.services.console.follow import following

WITHOUT_TASK = ("simulation.human=attentive",)
"""Setting without the task: a person who reacts to the robot."""
STYLES = ("cyan", "magenta", "green", "yellow", "blue", "red")


@dataclass(frozen=True, kw_only=True)
class Options(Written, Simulated, Listening):
    task: Annotated[bool, typer.Option("--task", help="Also run the tangram task, and end when it ends.")] = False


def main(options: Options) -> int:
    # A bad configuration is refused here, and not by every child.
    config = options.load(defaults=DEFAULTS if options.task else WITHOUT_TASK)
    with Outputs(options.events, options.feedback) as outputs:
        console = outputs.console(quiet=options.quiet)
        run_until_signal(_up(options, config, outputs, console))
    return DONE


async def _up(options: Options, config: Config, outputs: Outputs, console: Console) -> None:
    # Our own session comes first and stays, for children find one another through it, and may crash.
    async with await options.open(config.bus, "up", options.listen or ()) as hub, claiming(hub) as claim:
        await claim.granted()
        await hub.wait_until_free(*_names(options))
        bus = claim.bus
        tallying = Tallying(bus.now())
        live = options.task and console.is_terminal and not options.quiet
        arrivals = Arrivals(_names(options), console)
        children = _children(options, config, console, arrivals)
        with scene_view(console, config.robot, bus.now(), live) as show:
            sinks = (show, tallying, outputs) if options.task else (outputs,)
            async with following(bus, sinks), supervised(children), asyncio.TaskGroup() as group:
                holding = group.create_task(claim.held_until(arrivals.complete), name="claim")
                if options.task:
                    await children["collaboration"].ended.wait()
                else:
                    await forever()
                holding.cancel()
    if options.task:
        console.print(tally.render(tallying.tally, config.robot, console.width))


def _names(options: Options) -> tuple[str, ...]:
    return (*ROBOT, "simulation", "collaboration") if options.task else (*ROBOT, "simulation")


def _children(options: Options, config: Config, console: Console, arrivals: "Arrivals") -> dict[str, Child]:
    names = _names(options)
    width = max(map(len, names))
    styles = dict(zip(names, STYLES, strict=False))

    def tell(name: str, line: str) -> None:
        console.print(Text(f"{name:>{width}} │ ", style=styles[name]) + Text(line), soft_wrap=True)
        if line == ready_line(name):
            arrivals(name)

    return {name: Child(name, command(name, options, config), tell, once=name == "collaboration") for name in names}


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
