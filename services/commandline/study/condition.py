"""Command `engage condition`: begin a condition of a study on a running robot, or tell which one is in force."""

from dataclasses import dataclass
from typing import Annotated

import typer

from engage_hri.schemas.conditions import LONGEST_NAME, words
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.shell.options import Connected
from engage_hri.services.commandline.shell.process import DONE, run_until_signal, unique_name
from engage_hri.services.commandline.shell.settings import RobotConfig

PATIENCE: Seconds = 5.0
"""Seconds in which generation has to answer."""
NONE = "none"


@dataclass(frozen=True, kw_only=True)
class Options(Connected):
    name: Annotated[
        str,
        typer.Argument(
            metavar="[NAME|none]",
            help="Condition that begins now, by any name; `none`: what comes belongs to none. Without it the present "
            "one is shown.",
            show_default=False,
        ),
    ] = ""
    speech_only: Annotated[
        bool, typer.Option("--speech-only", help="The robot says the words of the task and does nothing else.")
    ] = False
    by: Annotated[str, typer.Option(metavar="WHO", help="Who sets it, for the record.", show_default=False)] = ""


def main(options: Options) -> int:
    config = options.load()
    if (options.speech_only or options.by) and not options.name:
        option = "--speech-only" if options.speech_only else "--by"
        advice = f"give its name, or `{NONE}`; without a name the present one is shown"
        raise InputRefused(Fault(reason="of which condition?", where=option, advice=advice))
    for given in (options.name, options.by):
        if len(given) > LONGEST_NAME:
            reason = f"{len(given)} characters; a name has {LONGEST_NAME} at most"
            raise InputRefused(Fault(reason=reason, where=f"{given[:20]}..."))
    run_until_signal(_begin(options, config) if options.name else _show(options, config))
    return DONE


async def _begin(options: Options, config: RobotConfig) -> None:
    from engage_hri.services.client.robot import Robot

    name = "" if options.name == NONE else options.name
    async with (
        await options.open(config.bus, "operator", patience=PATIENCE) as hub,
        Robot.on(hub.join(unique_name("condition"), "operator")) as robot,
    ):
        await robot.set_condition(name, speech_only=options.speech_only, by=options.by, timeout=PATIENCE)
    print(f"condition of the study, from now on: {words(name, options.speech_only)}")


async def _show(options: Options, config: RobotConfig) -> None:
    from engage_hri.services.client.robot import Robot

    async with (
        await options.open(config.bus, "viewer", patience=PATIENCE) as hub,
        Robot.on(hub.join(unique_name("condition"), "observer")) as robot,
    ):
        now = await robot.condition(PATIENCE)
        print(f"{now.sentence}, for {robot.now() - robot.local(now.at):.0f} s")
