"""Command `engage fault`: switch faults of a running robot's simulated body, and tell which it can play."""

from dataclasses import dataclass
from typing import Annotated

import typer

from engage_hri.schemas.body import Capabilities, FaultKind
from engage_hri.schemas.body_faults import BodyFault, kind_of, parts_of, told
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.shell.options import Connected
from engage_hri.services.commandline.shell.process import DONE, run_until_signal, unique_name
from engage_hri.services.commandline.shell.settings import RobotConfig

PATIENCE: Seconds = 5.0
"""Seconds in which control has to answer."""
NONE, LIST = "none", "list"


@dataclass(frozen=True, kw_only=True)
class Options(Connected):
    kind: Annotated[str, typer.Argument(metavar="KIND|none|list", help="`list` tells what each kind does.")]
    part: Annotated[str, typer.Option(metavar="PART", help="A body part or a joint; without it all.")] = ""
    amount: Annotated[
        float | None, typer.Option(metavar="X", help="How much, in the unit of the kind.", show_default=False)
    ] = None
    before: Annotated[str, typer.Option(metavar="SYNC", help="The sync point before which it happens.")] = ""
    behavior: Annotated[str, typer.Option(metavar="ID", help="The only behavior that it concerns.")] = ""
    off: Annotated[bool, typer.Option("--off", help="Switch it off; without options all of its kind.")] = False

    @property
    def fault(self) -> BodyFault:
        """The fault that is meant."""
        return BodyFault(
            kind=self.kind, part=self.part, amount=self.amount, before=self.before, behavior=self.behavior
        )


def main(options: Options) -> int:
    config = options.load()
    if options.kind in (NONE, LIST) and (options.fault != BodyFault(kind=options.kind) or options.off):
        raise InputRefused(Fault(reason="takes no further options", where=options.kind))
    run_until_signal(_switch(options, config))
    return DONE


async def _switch(options: Options, config: RobotConfig) -> None:
    from engage_hri.services.client.robot import Robot

    async with (
        await options.open(config.bus, "operator", patience=PATIENCE) as hub,
        Robot.on(hub.join(unique_name("fault"), "operator")) as robot,
    ):
        if options.kind == LIST:
            on = await robot.faults_on(PATIENCE)
            print(listed(await robot.capabilities(PATIENCE), on))
            return
        if options.kind == NONE:
            on = await robot.switch_faults(timeout=PATIENCE)
        elif options.off:
            on = await robot.switch_off(options.fault, timeout=PATIENCE)
        else:
            on = await robot.switch_on(options.fault, timeout=PATIENCE)
    print(f"on: {told(on) if on else 'nothing; the body is healthy'}")


def listed(body: Capabilities, on: tuple[BodyFault, ...]) -> str:
    """Text about all faults that a body can play, and those that are on."""
    lines = []
    for name in body.faults:
        kind = kind_of(name, body)
        lines.append(f"{name}: {kind.does if kind else 'a fault of this body, which does not say what it does'}")
        lines += [f"    --{option}: {what}" for option, what in (_options(kind, body) if kind else {}).items()]
    lines.append(f"on: {told(on)}" if body.faults else "this body can play no faults")
    return "\n".join(lines)


def _options(kind: FaultKind, body: Capabilities) -> dict[str, str]:
    parts, amount = ", ".join(parts_of(kind, body)), kind.amount
    usual = "" if kind.usual is None else f"; without it {kind.usual:g}"
    options = {"part": parts and f"{parts}{'' if kind.on == 'joint' else '; without it all'}"}
    options |= {"amount": amount and f"{amount}{usual}", "before": "a sync point" if kind.before else ""}
    return {option: what for option, what in options.items() if what}
