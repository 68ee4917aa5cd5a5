"""Command `engage run SERVICE`: one service as one process on the real bus."""

import asyncio
from contextlib import AsyncExitStack
from dataclasses import dataclass
from typing import Annotated

import typer

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.commandline import last_resort, roster
from engage_hri.services.commandline.options import Embodied, Listening
from engage_hri.services.commandline.patient import complain
from engage_hri.services.commandline.process import DONE, run_until_signal, unique_name, until_closed
from engage_hri.services.commandline.roster import ROBOT
from engage_hri.services.commandline.settings import ELSEWHERE, RobotConfig
from engage_hri.services.runtime.service import serve


@dataclass(frozen=True, kw_only=True)
class Options(Embodied, Listening):
    """Options of the command. attended: run only until standard input closes, as it does when our parent dies."""

    service: Annotated[roster.ServiceName, typer.Argument(help="Which service.", show_default=False)]
    attended: Annotated[bool, typer.Option("--attended", hidden=True)] = False


def ready_line(name: str) -> str:
    """Line that a service prints on standard error when it serves. `engage up` waits for it."""
    return f"{name} is ready"


def main(options: Options) -> int:
    """Serve until a signal."""
    if (options.body or options.voice) and options.service != "control":
        raise InputRefused(Fault(reason="--body and --voice are for control", advice="engage run control --body ..."))
    if options.attended:
        last_resort.end_after_the_parent()
    on_robot = options.service in ROBOT
    config = options.read(RobotConfig, elsewhere=ELSEWHERE) if on_robot else options.load()
    run_until_signal(_serve(options, config))
    return DONE


async def _serve(options: Options, config: RobotConfig) -> None:
    from engage_hri.services.bus.zenoh.neighbors import hinting

    name = options.service
    service = roster.service(name, config)

    def announce() -> None:
        complain(ready_line(name))

    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(await options.open(config.bus, name, options.listen or ()))
        if not options.attended:  # `engage up` sees for itself who is there
            await stack.enter_async_context(
                hinting(hub.join(unique_name("run")), config.bus.connect, {*ROBOT} - {name})
            )
        serving = asyncio.create_task(serve(hub, name, service, announce), name=f"service {name}")
        waiting = {serving}
        if options.attended:
            waiting.add(asyncio.create_task(until_closed(), name="parent"))
        try:
            await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in waiting:
                task.cancel()
            await asyncio.wait(waiting)
    if not serving.cancelled():
        serving.result()
