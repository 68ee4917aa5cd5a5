"""Command `engage demo`: the whole system in this process plays the anchor tangram with a simulated person."""

import asyncio
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.embedding import play_tangram
from engage_hri.services.commandline.look.window import can_open, web, windowed
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.shell.options import Embodied, Shown, Simulated, VirtualTime, Written
from engage_hri.services.commandline.shell.outputs import Outputs
from engage_hri.services.commandline.shell.process import DONE, run
from engage_hri.services.commandline.shell.recording_file import needed
from engage_hri.services.commandline.shell.settings import TRANSCRIPT
from engage_hri.services.console.follow import Sink
from engage_hri.services.console.terminal import tally
from engage_hri.services.console.terminal.live import Tallying, scene_view

FOR_YOU = ("collaboration.mode=task",)
"""Settings for somebody who knows no transcript: the robot says good of what is right, and sees which piece it is."""


@dataclass(frozen=True, kw_only=True)
class Options(Written, Simulated, Embodied, Shown):
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

    people: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=8,
            help="N people talk with each other, without a tangram; the robot asks now and then.",
        ),
    ] = None
    record: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Record all of it into FILE, as `engage record` does.", show_default=False),
    ] = None

    @property
    def overrides(self) -> tuple[str, ...]:
        """Settings of the options."""
        you = ("simulation.human=none",) if self.you else ()
        party = ("simulation.human=party", f"simulation.people={self.people}", "collaboration.mode=host")
        return (*super().overrides, *you, *(party if self.people else ()))


def main(options: Options) -> int:
    config = options.read(Config, defaults=FOR_YOU if options.you else TRANSCRIPT)
    _check(options)
    with Outputs(options.events, options.feedback) as outputs:
        console = outputs.console(quiet=options.quiet)
        live = console.is_terminal and not options.virtual_time and not options.quiet
        window = can_open(live) if options.window is None and not options.you else options.window is not False
        if window:
            web()
        result = run(demonstrate(config, outputs, console, live, options, window), virtual_time=options.virtual_time)
        console.print(tally.render(result, config.robot))
    return DONE


def _check(options: Options) -> None:
    """Refuse what needs a window that cannot be, or a file that cannot be written. Raises InputRefused."""
    if options.record is not None:
        needed()
    for option, given in (("--window", options.window), ("--you", options.you)):
        if given and options.virtual_time:
            reason, advice = "the clock of a window cannot jump", "leave out --virtual-time"
            raise InputRefused(Fault(reason=reason, where=option, advice=advice))
    if options.you and options.window is False:
        raise InputRefused(Fault(reason="the seat is in the window", where="--you", advice="leave out --no-window"))
    for option, taken in (("--you", options.you), ("--human", options.human)):
        if options.people and taken:
            raise InputRefused(Fault(reason="the people of --people sit there", where=option, advice="leave it out"))


async def demonstrate(
    config: Config, outputs: Sink, console: Console, live: bool, options: Options, window: bool = False
) -> tally.Tally:
    """Run everything until the task is over. Returns the tally of the events. window: show it in the browser, too."""
    began = asyncio.get_running_loop().time()
    tallying = Tallying(began)
    tell = partial(console.print, highlight=False, markup=False)
    async with MemoryHub(config.robot, decodes=False) as hub:
        beside = windowed(hub, options, began, tell) if window else nullcontext()
        with scene_view(console, config.robot, began, live) as show:
            async with beside:
                await play_tangram(config, (show, tallying, outputs), hub, options.record)
    return tallying.tally
