"""Command `engage steer`: hold what a running robot performs, let it continue, or stop it."""

from dataclasses import dataclass
from typing import Annotated, Literal

import typer

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.shell.options import Connected
from engage_hri.services.commandline.shell.process import DONE, run_until_signal, unique_name
from engage_hri.services.commandline.shell.settings import RobotConfig

PATIENCE: Seconds = 5.0
"""Seconds in which the realizer has to answer."""
VERBS = {"hold": "held", "continue": "continued", "stop": "stopped"}


@dataclass(frozen=True, kw_only=True)
class Options(Connected):
    to: Annotated[Literal["hold", "continue", "stop"], typer.Argument(metavar="hold|continue|stop")]
    block: Annotated[str, typer.Argument(metavar="[BLOCK]", help="Id of a live block; without it everything.")] = ""
    behavior: Annotated[str, typer.Argument(metavar="[BEHAVIOR]", help="Id of one of its behaviors.")] = ""


def main(options: Options) -> int:
    config = options.load()
    if options.behavior and not options.block:
        raise InputRefused(Fault(reason="a behavior without its block", where=options.behavior))
    run_until_signal(_steer(options, config))
    return DONE


async def _steer(options: Options, config: RobotConfig) -> None:
    from engage_hri.services.client.robot import Robot

    async with (
        await options.open(config.bus, "operator", patience=PATIENCE) as hub,
        Robot.on(hub.join(unique_name("steer"), "operator")) as robot,
    ):
        steer = {"hold": robot.hold, "continue": robot.resume, "stop": robot.stop}[options.to]
        blocks = await steer(options.block, options.behavior, timeout=PATIENCE)
    what = f"{options.block}: {options.behavior}" if options.behavior else ", ".join(blocks)
    coming = "; so is what comes, until `engage steer continue`" if options.to == "hold" and not options.block else ""
    print(f"{VERBS[options.to]}: {what or 'nothing is being performed'}{coming}")
