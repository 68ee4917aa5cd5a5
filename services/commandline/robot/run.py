"""Command `engage run SERVICES`: one service, or several together, as one process on the real bus."""

from collections.abc import Mapping
from contextlib import AsyncExitStack
from dataclasses import dataclass
from typing import Annotated

import typer
from msgspec import json

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.bus.interface import Hub
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.options import Embodied, Hearing, Listening
from engage_hri.services.commandline.shell.outputs import complain
from engage_hri.services.commandline.shell.process import (
    DONE,
    end_after_the_parent,
    first_of,
    run_until_signal,
    unique_name,
    until_closed,
)
from engage_hri.services.commandline.shell.roster import DOOR, ROBOT, SENSES, complete
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.runtime.service import Service, running


@dataclass(frozen=True, kw_only=True)
class Options(Embodied, Hearing, Listening):
    """Options of the command. attended: run only until standard input closes, as it does when our parent dies."""

    services: Annotated[
        str,
        typer.Argument(
            metavar="SERVICE[,SERVICE...]",
            help=f"One of {', '.join(roster.NAMES)}; several share the process, and speak in memory.",
            show_default=False,
            autocompletion=lambda: list(roster.NAMES),
        ),
    ]
    task: Annotated[
        str | None,
        typer.Option(metavar="TASK", help="What pieces lie there: a task's name, or its file.", show_default=False),
    ] = None
    attended: Annotated[bool, typer.Option("--attended", hidden=True)] = False

    @property
    def sense(self) -> str:
        """Section of the service for which the source is."""
        return next((name for name in ("eyes", "pieces") if name in roster.group(self.services)), "hearing")

    @property
    def overrides(self) -> tuple[str, ...]:
        """Settings of the options, which are stronger than `--set`."""
        own = (f"pieces.task={json.encode(self.task).decode()}",) if self.task else ()
        return (*super().overrides, *own)


def ready_line(name: str) -> str:
    """Line that a service prints on standard error when it serves. `engage up` waits for it."""
    return f"{name} is ready"


def main(options: Options) -> int:
    """Serve until a signal."""
    names = roster.group(options.services)
    if (options.body or options.voice) and "control" not in names:
        raise InputRefused(Fault(reason="--body and --voice are for control", advice="engage run control --body ..."))
    if options.source and len({*names} & {*SENSES}) != 1:
        advice = "engage run hearing --from FILE.wav, or engage run eyes --from film:PATH"
        raise InputRefused(Fault(reason="--from is for hearing, eyes or pieces, one of them", advice=advice))
    if options.task and "pieces" not in names:
        raise InputRefused(Fault(reason="--task is for pieces", advice="engage run pieces --task FILE"))
    if options.attended:
        end_after_the_parent()
    on_robot = {*names} <= {*ROBOT, *SENSES, DOOR}
    config = options.load() if on_robot else options.read(complete())
    run_until_signal(_serve(options, names, config))
    return DONE


async def _serve(options: Options, names: tuple[str, ...], config: RobotConfig) -> None:
    from engage_hri.services.bus.zenoh.neighbors import hinting

    services = {name: roster.service(name, config) for name in names}
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(await options.open(config.bus, names[0], options.listen or ()))
        others = await stack.enter_async_context(options.hubs(config.bus, names[1:], hub))
        if not options.attended:  # `engage up` sees for itself who is there
            await stack.enter_async_context(
                hinting(hub.join(unique_name("run")), config.bus.connect, {*ROBOT} - {*names})
            )
        serving = _until_over({names[0]: hub, **others}, services)
        await first_of(serving, *((until_closed(),) if options.attended else ()))


async def _until_over(hubs: Mapping[str, Hub], services: Mapping[str, Service]) -> None:
    async with running(hubs, services) as over:
        for name in services:
            complain(ready_line(name))
        await over.wait()
