"""Command `engage console`: a page in the browser that shows a running robot, and lets people take part."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.commandline.look.window import hosts, served, stage_page, token_of, web, workshop_page
from engage_hri.services.commandline.shell.options import Connected, Port, Shown
from engage_hri.services.commandline.shell.outputs import complain
from engage_hri.services.commandline.shell.process import DONE, forever, run_until_signal, unique_name
from engage_hri.services.commandline.shell.recording_file import opened
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.commandline.shell.sources import Thing, read_source

if TYPE_CHECKING:
    from engage_hri.services.recording.reading import Recording

PORT = 8137


@dataclass(frozen=True, kw_only=True)
class Options(Connected, Shown):
    role: Annotated[
        Literal["observer", "operator", "wizard"],
        typer.Option(
            help="observer: only looks; operator: also holds, stops, switches faults; wizard: also speaks as the "
            "robot, and visitors may take a seat."
        ),
    ] = "observer"
    script: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Prepared fragments and blocks, for buttons and the keys 1 to 9."),
    ] = None
    recording: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Play a recording of `engage record` in place of a running robot."),
    ] = None
    pages: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Pages of your own, served at /pages/: they may listen at /messages."),
    ] = None
    port: Port = PORT
    browser: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False


def main(options: Options) -> int:
    """Show the window until a signal."""
    config = options.load()
    if options.pages is not None and not options.pages.is_dir():
        raise InputRefused(
            Fault(reason="this is no folder", where=str(options.pages), advice="give the one that index.html is in")
        )
    if options.recording is not None:
        run_until_signal(_play(options, opened(options.recording)))
        return DONE
    things = read_source(options.script).things if options.script else ()
    run_until_signal(_show(options, config, things))
    return DONE


async def _play(options: Options, recording: "Recording") -> None:
    """Show a recording: without a bus, and for whoever looks."""
    app = web().recorded(recording, hosts(options))
    async with served(app, options, {"": ""}, _tell, role="observer", opens=options.browser):
        await forever()


async def _show(options: Options, config: RobotConfig, things: tuple[Thing, ...]) -> None:
    server = web()
    from engage_hri.services.bus.zenoh.neighbors import hinting
    from engage_hri.services.console.web.orders import RIGHTS, Script
    from engage_hri.services.console.web.service import window

    token = token_of(options)
    async with await options.open(config.bus, HOLDERS[options.role]) as hub:
        bus = hub.join(unique_name("console"), options.role)
        if bus.role != options.role:
            complain(f"the window has the role {bus.role}, that of its keys, and not --role {options.role}")
        async with window(hub, bus, Script(things), keyed=bool(config.bus.keys)) as shown:
            bus.declare_alive()
            spoken = config.hearing
            app = server.application(shown, hosts(options), token, spoken.language, spoken.phrases, options.pages)
            pages = {workshop_page(token if bus.role in RIGHTS else ""): ""}
            if "seat" in RIGHTS.get(bus.role, ()):
                pages[stage_page(token)] = "the stage, for visitors: "
            async with (
                served(app, options, pages, _tell, role=options.role, opens=options.browser),
                hinting(bus, config.bus.connect, tell=shown.warn),
            ):
                await forever()


def _tell(line: str) -> None:
    print(line, flush=True)


HOLDERS = {"observer": "viewer", "operator": "operator", "wizard": "wizard"}
"""Whose keys each role takes, where the folder of keys is that of several."""
