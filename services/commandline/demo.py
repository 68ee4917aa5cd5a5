"""Command `engage demo`: the whole system in this process plays the anchor tangram with a simulated person."""

import asyncio
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import typer
from rich.console import Console

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.config import Config
from engage_hri.services.commandline.options import Embodied, Simulated, VirtualTime, Written
from engage_hri.services.commandline.outputs import Outputs
from engage_hri.services.commandline.process import DONE, run
from engage_hri.services.commandline.tangram import play_tangram
from engage_hri.services.commandline.windowed import can_open, windowed
from engage_hri.services.console import tally
from engage_hri.services.console.follow import Sink
from engage_hri.services.console.live import LiveView, Log
from engage_hri.services.console.log import Telling

DEFAULTS = ("recognition.gaze_resolution=table",)
"""Settings for the transcript: its annotators saw that a look went to the table, but rarely to which piece."""
FOR_YOU = ("collaboration.mode=task",)
"""Settings for somebody who knows no transcript: the robot says good of what is right, and sees which piece it is."""


@dataclass(frozen=True, kw_only=True)
class Options(Written, Simulated, Embodied):
    """Options of the command. window: None: where somebody would see one."""

    virtual_time: VirtualTime = False
    window: Annotated[
        bool | None,
        typer.Option(
            help="Show it in the browser, too; without a display or a terminal it is not.", show_default=False
        ),
    ] = None
    you: Annotated[
        bool, typer.Option("--you", help="You are the person: take the seat in the browser, and lay the pieces.")
    ] = False

    @property
    def overrides(self) -> tuple[str, ...]:
        """Settings of the options."""
        return (*super().overrides, *(("simulation.human=none",) if self.you else ()))


class Tallying:
    """A sink that keeps the tally."""

    def __init__(self, began: Seconds) -> None:
        self.tally = tally.empty(began)

    def __call__(self, message: Message, at: Seconds) -> None:
        self.tally = tally.feed(self.tally, message, at)


def main(options: Options) -> int:
    config = options.load(defaults=FOR_YOU if options.you else DEFAULTS)
    _check(options)
    with Outputs(options.events, options.feedback) as outputs:
        console = outputs.console(quiet=options.quiet)
        live = console.is_terminal and not options.virtual_time and not options.quiet
        window = can_open(live) if options.window is None and not options.you else options.window is not False
        result = run(demonstrate(config, outputs, console, live, window), virtual_time=options.virtual_time)
        console.print(tally.render(result, config.robot, console.width))
    return DONE


def _check(options: Options) -> None:
    """Refuse what needs a window that cannot be. Raises InputRefused."""
    for option, given in (("--window", options.window), ("--you", options.you)):
        if given and options.virtual_time:
            reason, advice = "the clock of a window cannot jump", "leave out --virtual-time"
            raise InputRefused(Fault(reason=reason, where=option, advice=advice))
    if options.you and options.window is False:
        raise InputRefused(Fault(reason="the seat is in the window", where="--you", advice="leave out --no-window"))


async def demonstrate(
    config: Config, outputs: Sink, console: Console, live: bool, window: bool = False
) -> tally.Tally:
    """Run everything until the task is over. Returns the tally of the events. window: show it in the browser, too."""
    began = asyncio.get_running_loop().time()
    tallying = Tallying(began)
    with scene_view(console, config.robot, began, live) as show:
        if window:
            async with windowed(config.robot, partial(console.print, highlight=False, markup=False)) as hub:
                await play_tangram(config, (show, tallying, outputs), hub)
        else:
            await play_tangram(config, (show, tallying, outputs))
    return tallying.tally


def scene_view(console: Console, robot: str, began: Seconds, live: bool) -> LiveView | Log:
    """Choose the sink that shows the scene: a live view on a terminal, log lines anywhere else."""
    return LiveView(console, robot, began) if live else Log(console, robot, began, Telling(points=False, head=False))
