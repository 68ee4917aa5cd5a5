"""Command `engage demo`: the whole system in this process plays the anchor tangram with a simulated person."""

import asyncio
from dataclasses import dataclass

from rich.console import Console

from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.config import Config
from engage_hri.services.commandline.options import Embodied, Simulated, VirtualTime, Written
from engage_hri.services.commandline.outputs import Outputs
from engage_hri.services.commandline.process import DONE, run
from engage_hri.services.commandline.tangram import play_tangram
from engage_hri.services.console import tally
from engage_hri.services.console.follow import Sink
from engage_hri.services.console.live import LiveView, Log
from engage_hri.services.console.log import Telling

DEFAULTS = ("recognition.gaze_resolution=table",)
"""Settings for the transcript: its annotators saw that a look went to the table, but rarely to which piece."""


@dataclass(frozen=True, kw_only=True)
class Options(Written, Simulated, Embodied):
    virtual_time: VirtualTime = False


class Tallying:
    """A sink that keeps the tally."""

    def __init__(self, began: Seconds) -> None:
        self.tally = tally.empty(began)

    def __call__(self, message: Message, at: Seconds) -> None:
        self.tally = tally.feed(self.tally, message, at)


def main(options: Options) -> int:
    config = options.load(defaults=DEFAULTS)
    with Outputs(options.events, options.feedback) as outputs:
        console = outputs.console(quiet=options.quiet)
        live = console.is_terminal and not options.virtual_time and not options.quiet
        result = run(demonstrate(config, outputs, console, live), virtual_time=options.virtual_time)
        console.print(tally.render(result, config.robot, console.width))
    return DONE


async def demonstrate(config: Config, outputs: Sink, console: Console, live: bool) -> tally.Tally:
    """Run everything until the task is over. Returns the tally of the events."""
    began = asyncio.get_running_loop().time()
    tallying = Tallying(began)
    with scene_view(console, config.robot, began, live) as show:
        await play_tangram(config, (show, tallying, outputs))
    return tallying.tally


def scene_view(console: Console, robot: str, began: Seconds, live: bool) -> LiveView | Log:
    """Choose the sink that shows the scene: a live view on a terminal, log lines anywhere else."""
    return LiveView(console, robot, began) if live else Log(console, robot, began, Telling(points=False, head=False))
