"""Command `engage steer`: hold what a running robot performs, let it continue, or stop it; set a condition."""

from dataclasses import dataclass
from typing import Annotated, Literal

import typer

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import LONGEST_NAME, condition_words
from engage_hri.schemas.units import Seconds
from engage_hri.services.client.robot import Robot
from engage_hri.services.commandline.shell.options import Connected
from engage_hri.services.commandline.shell.process import DONE, run_until_signal, unique_name
from engage_hri.services.commandline.shell.settings import RobotConfig

PATIENCE: Seconds = 5.0
"""Seconds in which the realizer, or generation, has to answer."""
VERBS = {"hold": "held", "continue": "continued", "stop": "stopped"}
NONE = "none"


@dataclass(frozen=True, kw_only=True)
class Options(Connected):
    to: Annotated[
        Literal["hold", "continue", "stop", "condition"], typer.Argument(metavar="hold|continue|stop|condition")
    ]
    name: Annotated[
        str,
        typer.Argument(
            metavar="[BLOCK|NAME]",
            help="Id of a live block; without it everything. Of a condition: any name, which begins now; `none`: "
            "what comes belongs to no condition; without it the present one is shown.",
            show_default=False,
        ),
    ] = ""
    behavior: Annotated[
        str, typer.Argument(metavar="[BEHAVIOR]", help="Id of one of its behaviors.", show_default=False)
    ] = ""
    speech_only: Annotated[
        bool,
        typer.Option("--speech-only", help="Condition: the robot says the words of the task and does nothing else."),
    ] = False
    by: Annotated[
        str, typer.Option(metavar="WHO", help="Condition: who sets it, for the record.", show_default=False)
    ] = ""


def main(options: Options) -> int:
    config = options.load()
    if options.behavior and (not options.name or options.to == "condition"):
        raise InputRefused(Fault(reason="a behavior without its block", where=options.behavior))
    if options.speech_only or options.by:
        option = "--speech-only" if options.speech_only else "--by"
        if options.to != "condition":
            raise InputRefused(Fault(reason="is for `engage steer condition`", where=option))
        if not options.name:
            advice = f"give its name, or `{NONE}`; without a name the present one is shown"
            raise InputRefused(Fault(reason="of which condition?", where=option, advice=advice))
    for given in (options.name, options.by) if options.to == "condition" else ():
        if len(given) > LONGEST_NAME:
            reason = f"{len(given)} characters; a name has {LONGEST_NAME} at most"
            raise InputRefused(Fault(reason=reason, where=f"{given[:20]}..."))
    run_until_signal(_steer(options, config))
    return DONE


async def _steer(options: Options, config: RobotConfig) -> None:
    asks = options.to == "condition" and not options.name
    holder, role = ("viewer", "observer") if asks else ("operator", "operator")
    async with (
        await options.open(config.bus, holder, patience=PATIENCE) as hub,
        Robot.on(hub.join(unique_name("steer"), role)) as robot,
    ):
        print(await (_condition(options, robot) if options.to == "condition" else _movement(options, robot)))


async def _movement(options: Options, robot: Robot) -> str:
    """Hold, continue or stop. Returns what that came to."""
    steer = {"hold": robot.hold, "continue": robot.resume, "stop": robot.stop}[options.to]
    blocks = await steer(options.name, options.behavior, timeout=PATIENCE)
    what = f"{options.name}: {options.behavior}" if options.behavior else ", ".join(blocks)
    coming = "; so is what comes, until `engage steer continue`" if options.to == "hold" and not options.name else ""
    return f"{VERBS[options.to]}: {what or 'nothing is being performed'}{coming}"


async def _condition(options: Options, robot: Robot) -> str:
    """Begin a condition, if one is named. Returns the one that is in force."""
    if not options.name:
        now = await robot.condition(PATIENCE)
        return f"{now.sentence}, for {robot.now() - robot.local(now.at):.0f} s"
    name = "" if options.name == NONE else options.name
    await robot.set_condition(name, speech_only=options.speech_only, by=options.by, timeout=PATIENCE)
    return f"condition of the study, from now on: {condition_words(name, options.speech_only)}"
