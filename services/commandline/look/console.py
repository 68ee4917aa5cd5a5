"""Command `engage console`: a page in the browser that shows a running robot, and lets people take part."""

import os
import re
import secrets
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.commandline.look.window import TOKEN, hosts, served, stage_page, web, workshop_page
from engage_hri.services.commandline.shell.options import Connected, Shown
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
    port: Annotated[
        int, typer.Option(metavar="PORT", min=0, max=65535, help="Port of the page; 0: any that is free.")
    ] = PORT
    token_file: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="File with the token of the address, made if there is none: then the address stays the same when "
            "the window is started again, and its pages take part as before.",
            show_default=False,
        ),
    ] = None
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
    async with served(app, options, {"": ""}, _tell, role="observer", port=options.port, opens=options.browser):
        await forever()


async def _show(options: Options, config: RobotConfig, things: tuple[Thing, ...]) -> None:
    server = web()
    from engage_hri.services.bus.zenoh.neighbors import hinting
    from engage_hri.services.console.web.orders import RIGHTS, Script
    from engage_hri.services.console.web.service import window

    token = kept_token(options.token_file) if options.token_file else secrets.token_urlsafe(TOKEN)
    async with await options.open(config.bus, HOLDERS[options.role]) as hub:
        bus = hub.join(unique_name("console"), options.role)
        if bus.role != options.role:
            complain(f"the window has the role {bus.role}, that of its keys, and not --role {options.role}")
        async with window(hub, bus, Script(things), keyed=bool(config.bus.keys)) as shown:
            bus.declare_alive()
            app = server.application(shown, hosts(options), token, options.pages)
            pages = {workshop_page(token if bus.role in RIGHTS else ""): ""}
            if "seat" in RIGHTS.get(bus.role, ()):
                pages[stage_page(token)] = "the stage, for visitors: "
            async with (
                served(app, options, pages, _tell, role=options.role, port=options.port, opens=options.browser),
                hinting(bus, config.bus.connect, tell=shown.warn),
            ):
                await forever()


def _tell(line: str) -> None:
    print(line, flush=True)


def kept_token(path: Path) -> str:
    """The token in a file, which is made for its owner alone if there is none. Raises InputRefused.

    On the command line, every user of the machine could read it.
    """
    try:
        with suppress(FileExistsError), open(path, "x", opener=partial(os.open, mode=0o600)) as file:
            file.write(f"{secrets.token_urlsafe(TOKEN)}\n")
        token, mode = path.read_text(encoding="utf-8").strip(), path.stat().st_mode
    except (OSError, UnicodeDecodeError) as error:
        reason = f"cannot be read or made: {getattr(error, 'strerror', None) or error}"
        raise InputRefused(Fault(reason=reason, where=str(path))) from error
    if os.name == "posix" and mode & 0o077:
        raise InputRefused(Fault(reason="others may read it", where=str(path), advice=f"chmod 600 {path}"))
    if not re.fullmatch(r"[\w-]{12,}", token, re.ASCII):
        reason = "this is no token: at least 12 letters, digits, - and _, on one line"
        raise InputRefused(Fault(reason=reason, where=str(path), advice="name a new file, and it is made"))
    return token


HOLDERS = {"observer": "viewer", "operator": "operator", "wizard": "wizard"}
"""Whose keys each role takes, where the folder of keys is that of several."""
