"""`engage up`: the services as processes of their own on this machine, watched over until Ctrl-C."""

import asyncio
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.text import Text

from engage_hri.services.commandline.claim import claiming
from engage_hri.services.commandline.config import Config
from engage_hri.services.commandline.demo import DEFAULTS, Tallying, shown
from engage_hri.services.commandline.outputs import Outputs
from engage_hri.services.commandline.process import DONE, run_until_signal
from engage_hri.services.commandline.roster import ROBOT
from engage_hri.services.commandline.run import Where, forever, is_ready
from engage_hri.services.commandline.supervisor import Child, supervised
from engage_hri.services.console import tally
from engage_hri.services.console.follow import following

WITHOUT_TASK = ("simulation.human=attentive",)
"""Whoever tries the robot finds somebody who minds it."""
STYLES = ("cyan", "magenta", "green", "yellow", "blue", "red")


class Options(NamedTuple):
    """task: also run the tangram task, and end with it."""

    where: Where
    task: bool = False
    events: Path | None = None
    feedback: Path | None = None
    quiet: bool = False


def main(options: Options) -> int:
    # A bad one is refused here, not by every child.
    config = options.where.load(defaults=DEFAULTS if options.task else WITHOUT_TASK)
    with Outputs(options.events, options.feedback) as outputs:
        console = outputs.console(quiet=options.quiet)
        run_until_signal(_up(options, config, outputs, console))
    return DONE


async def _up(options: Options, config: Config, outputs: Outputs, console: Console) -> None:
    # Our own session comes first and stays: children may crash, the place where all find one another does not.
    async with await options.where.open(config.robot) as hub, claiming(hub) as claim:
        await claim.granted()
        await hub.vacant(*_names(options))
        bus = claim.bus
        tallying = Tallying(bus.now())
        live = options.task and console.is_terminal and not options.quiet
        arrivals = Arrivals(_names(options), console)
        children = _children(options, config, console, arrivals)
        with shown(console, config.robot, bus.now(), live) as show:
            sinks = (show, tallying, outputs) if options.task else (outputs,)
            async with following(bus, sinks), supervised(children), asyncio.TaskGroup() as group:
                holding = group.create_task(claim.held_until(arrivals.complete), name="claim")
                if options.task:
                    await children["collaboration"].ended.wait()
                else:
                    await forever()
                holding.cancel()
    if options.task:
        console.print(tally.render(tallying.tally, config.robot))


def _names(options: Options) -> tuple[str, ...]:
    return (*ROBOT, "simulation", "collaboration") if options.task else (*ROBOT, "simulation")


def _children(options: Options, config: Config, console: Console, arrivals: "Arrivals") -> dict[str, Child]:
    names = _names(options)
    width = max(map(len, names))
    styles = dict(zip(names, STYLES, strict=False))

    def tell(name: str, line: str) -> None:
        console.print(Text(f"{name:>{width}} │ ", style=styles[name]) + Text(line), soft_wrap=True)
        if line == is_ready(name):
            arrivals(name)

    return {
        name: Child(name, command(name, options.where, config), tell, once=name == "collaboration") for name in names
    }


def command(name: str, where: Where, config: Config) -> list[str]:
    """The child's command line: `engage run NAME`, by our interpreter, on our bus, configured as we are."""
    # What was decided here, by default or by option, is told in full, so that all children agree.
    settings = (
        *where.settings,
        f"recognition.gaze_resolution={config.recognition.gaze_resolution}",
        f"simulation.human={config.simulation.human}",
    )
    endpoints = (*where.listen, *where.connect)
    return [
        *(sys.executable, "-P", "-m", "engage_hri", "run", name, "--attended", "--robot", config.robot),
        *(("--config", str(where.config)) if where.config else ()),
        *(part for setting in settings for part in ("--set", setting)),
        *(part for endpoint in endpoints for part in ("--connect", endpoint)),
    ]


class Arrivals:
    """Told of each child that is ready; says once that all are. Those of another `up` do not count."""

    def __init__(self, names: Iterable[str], console: Console) -> None:
        self._missing = set(names)
        self._console = console
        self.complete = asyncio.Event()

    def __call__(self, name: str) -> None:
        self._missing.discard(name)
        if not self._missing and not self.complete.is_set():
            self.complete.set()
            self._console.print("all services are up; Ctrl-C stops them", highlight=False)
