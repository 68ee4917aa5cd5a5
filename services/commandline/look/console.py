"""Command `engage console`: a page in the browser that shows a running robot, and lets people take part."""

import os
import re
import secrets
import webbrowser
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from socket import gethostname
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.services.commandline.look.with_window import cannot_listen, lacking, not_installed
from engage_hri.services.commandline.shell.failing_output import complain
from engage_hri.services.commandline.shell.options import Connected, Shown
from engage_hri.services.commandline.shell.process import DONE, forever, run_until_signal, unique_name, until_closed
from engage_hri.services.commandline.shell.recording_file import opened
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.commandline.shell.sources import Thing, read_source

if TYPE_CHECKING:
    from engage_hri.services.console.web.guard import Hosts
    from engage_hri.services.recording.reading import Recording

PORT = 8137
LOCAL = ("127.0.0.1", "::1", "localhost")
TOKEN = 12
"""Bytes of chance in a token."""


@dataclass(frozen=True, kw_only=True)
class Options(Connected, Shown):
    """Options of the command. attended: run only until standard input closes, as it does when our parent dies.

    began: seconds of this machine's clock from which the page counts, as the terminal of our parent does.
    """

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
    began: Annotated[float | None, typer.Option("--began", hidden=True)] = None
    attended: Annotated[bool, typer.Option("--attended", hidden=True)] = False


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
    server = _web()
    await _serve(options, server.recorded(recording, _hosts(options)), "", forever)


async def _show(options: Options, config: RobotConfig, things: tuple[Thing, ...]) -> None:
    server = _web()
    from engage_hri.services.bus.zenoh.neighbors import hinting
    from engage_hri.services.console.web.orders import RIGHTS, Script
    from engage_hri.services.console.web.service import window

    token = kept_token(options.token_file) if options.token_file else secrets.token_urlsafe(TOKEN)
    async with await options.open(config.bus, HOLDERS[options.role]) as hub:
        bus = hub.join(unique_name("console"), options.role)
        if bus.role != options.role:
            complain(f"the window has the role {bus.role}, that of its keys, and not --role {options.role}")
        async with window(hub, bus, Script(things), keyed=bool(config.bus.keys), began=options.began) as shown:
            bus.declare_alive()

            async def stay() -> None:
                async with hinting(bus, config.bus.connect, tell=shown.warn):
                    await (until_closed() if options.attended else forever())

            app = server.application(shown, _hosts(options), token, options.pages)
            await _serve(options, app, token if bus.role in RIGHTS else "", stay)


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


def _web() -> ModuleType:
    """Load the web server. Raises InputRefused if it is not installed."""
    if package := lacking():
        raise InputRefused(not_installed(package))
    from engage_hri.services.console.web import server

    return server


def _hosts(options: Options) -> "Hosts":
    """Names by which the page may be called: else a page of others could call it by a name of theirs."""
    from engage_hri.services.console.web.guard import Hosts

    if options.host in LOCAL:
        return Hosts((*LOCAL, *(options.called or ())))
    own = gethostname()
    return Hosts((*LOCAL, options.host, own, f"{own}.local", *(options.called or ())), addresses=True)


async def _serve(options: Options, app: Any, token: str, stay: Callable[[], Awaitable[None]]) -> None:
    """Serve a page while `stay` lasts. Raises RunFailed if the port is taken."""
    try:
        async with _web().serving(app, options.host, options.port) as port:
            url = _address(options, port, token)
            print(url, flush=True)
            if options.host not in LOCAL:
                complain(_open_to_all(options))
            if options.browser:
                webbrowser.open(url)
            await stay()
    except OSError as error:
        raise RunFailed(cannot_listen(error, options.host, options.port)) from error


HOLDERS = {"observer": "viewer", "operator": "operator", "wizard": "wizard"}
"""Whose keys each role takes, where the folder of keys is that of several."""


def _address(options: Options, port: int, token: str) -> str:
    host = "127.0.0.1" if options.host in ("0.0.0.0", "::") else options.host
    host = f"[{host}]" if ":" in host else host
    return f"http://{host}:{port}/" + (f"?token={token}" if token else "")


def _open_to_all(options: Options) -> str:
    seen = f"everybody who reaches {options.host} sees all of this robot, and the people before it, unencrypted"
    if options.role == "observer":
        return seen
    return f"{seen}; who has the token in the address above takes part as {options.role}"
