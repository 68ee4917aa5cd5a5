"""Command `engage demo`: the whole system in this process plays the anchor tangram with a simulated person."""

import asyncio
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager, AsyncExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.embedding import tangram
from engage_hri.services.commandline.look.window import can_open, looking_on, seat_refusal, web, windowed
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.shell.options import Embodied, Kiosk, Shown, Simulated, VirtualTime, Written
from engage_hri.services.commandline.shell.outputs import Outputs
from engage_hri.services.commandline.shell.process import DONE, first_of, run
from engage_hri.services.commandline.shell.recording_file import needed
from engage_hri.services.commandline.shell.settings import AT_PAGES, TRANSCRIPT
from engage_hri.services.console.follow import Sink
from engage_hri.services.console.terminal import tally
from engage_hri.services.console.terminal.live import Tallying, scene_view
from engage_hri.services.runtime.installation import has_hearing

if TYPE_CHECKING:
    from engage_hri.services.console.web.service import WindowServer

FOR_YOU = ("collaboration.mode=task", *AT_PAGES)
"""Settings for somebody who knows no transcript: the robot says good of what is right, and sees which piece it is."""
EMPTY: Seconds = 5.0
"""Time without anybody before the robot after which a kiosk begins anew."""
LOOK: Seconds = 0.5
"""Time between two looks whether somebody is there."""


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
    kiosk: Kiosk = False
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
    def is_for_visitors(self) -> bool:
        """True if whoever sits down in the browser is the person."""
        return self.you or self.kiosk

    @property
    def overrides(self) -> tuple[str, ...]:
        """Settings of the options."""
        you = ("simulation.human=none",) if self.is_for_visitors else ()
        party = ("simulation.human=party", f"simulation.people={self.people}", "collaboration.mode=host")
        return (*super().overrides, *you, *(party if self.people else ()))


def main(options: Options) -> int:
    config = options.read(Config, defaults=FOR_YOU if options.is_for_visitors else TRANSCRIPT)
    _check(options)
    with Outputs(options.events, options.feedback) as outputs:
        console = outputs.console(quiet=options.quiet)
        live = console.is_terminal and not options.virtual_time and not options.quiet
        may = options.window is None and not options.is_for_visitors
        window = can_open(live) if may else options.window is not False
        if window:
            web()
        result = run(demonstrate(config, outputs, console, live, options, window), virtual_time=options.virtual_time)
        console.print(tally.render(result, config.robot))
    return DONE


def _check(options: Options) -> None:
    """Refuse what needs a window that cannot be, or a file that cannot be written. Raises InputRefused."""
    if options.record is not None:
        needed()
    for option, given in (("--window", options.window), ("--you", options.you), ("--kiosk", options.kiosk)):
        if given and options.virtual_time:
            reason, advice = "the clock of a window cannot jump", "leave out --virtual-time"
            raise InputRefused(Fault(reason=reason, where=option, advice=advice))
    for option, given in (("--you", options.you), ("--kiosk", options.kiosk)):
        if given and options.window is False:
            raise seat_refusal(option)
    if options.kiosk and options.record is not None:
        reason, advice = "what strangers do there is in no recording", "leave it out"
        raise InputRefused(Fault(reason=reason, where="--record", advice=advice))
    for option, taken in (("--you", options.you), ("--kiosk", options.kiosk), ("--human", options.human)):
        if options.people and taken:
            raise InputRefused(Fault(reason="the people of --people sit there", where=option, advice="leave it out"))


async def demonstrate(
    config: Config, outputs: Sink, console: Console, live: bool, options: Options, window: bool = False
) -> tally.Tally:
    """Run everything until the task is over. Returns the tally of the events. window: show it in the browser, too."""
    began = asyncio.get_running_loop().time()
    tallying = Tallying(began)
    tell = partial(console.print, highlight=False, markup=False)
    ears = ("hearing",) if config.control.has_voice and has_hearing() else ()
    senses = (*ears, "eyes") if options.is_for_visitors else ()
    async with MemoryHub(config.robot, decodes=False) as hub:
        with scene_view(console, config.robot, began, live) as show:
            play = partial(tangram, config, (show, tallying, outputs), hub, options.record, senses=senses)
            if not window:
                async with play() as over:
                    await over.wait()
                return tallying.tally
            async with looking_on(hub, began) as shown:
                spoken = config.hearing
                page = windowed(
                    shown, options, tell, language=spoken.language, examples=spoken.phrases, kiosk=options.kiosk
                )
                again = options.is_for_visitors and options.record is None
                await _shown(play, page, shown, again=again, kiosk=options.kiosk)
    return tallying.tally


async def _shown(
    play: Callable[[], AbstractAsyncContextManager[asyncio.Event]],
    page: AbstractAsyncContextManager[None],
    shown: "WindowServer",
    *,
    again: bool,
    kiosk: bool,
) -> None:
    """Play in a window, until the task is over.

    again: then anew, as soon as its visitor has left, until cancelled. kiosk: whether it is over or not.
    """
    async with AsyncExitStack() as stays:
        is_open = False
        while again or not is_open:
            async with play() as over:
                if not is_open:  # nothing was refused
                    await stays.enter_async_context(page)
                    is_open = True
                if kiosk:
                    await first_of(over.wait(), _left(shown, None))
                else:
                    await over.wait()
                    if again:
                        await _left(shown, shown.bus.now())


async def _left(shown: "WindowServer", last: Seconds | None) -> None:
    """Wait until nobody has been there for a while. last: when somebody was; None: until somebody has been at all.

    Who is there is looked at first: a process that stood still for that while has not seen anybody leave.
    """
    while shown.picture.present or last is None or shown.bus.now() - last < EMPTY:
        if shown.picture.present:
            last = shown.bus.now()
        await asyncio.sleep(LOOK)
