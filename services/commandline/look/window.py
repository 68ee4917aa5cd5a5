"""The page of the window, served by this process: beside a robot that runs elsewhere, or with the demo in it."""

import errno
import os
import sys
import webbrowser
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager, suppress
from importlib.util import find_spec
from socket import AF_INET, AF_INET6, SOCK_DGRAM, gethostname, socket
from types import ModuleType
from typing import TYPE_CHECKING, Any

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Hub
from engage_hri.services.commandline.shell.options import Shown
from engage_hri.services.commandline.shell.outputs import complain
from engage_hri.services.commandline.shell.process import unique_name
from engage_hri.services.runtime.installation import extra_command
from engage_hri.services.web.https import server_keys
from engage_hri.services.web.tokens import kept_token, new_token

if TYPE_CHECKING:
    from engage_hri.services.console.web.service import WindowServer
    from engage_hri.services.web.guard import Hosts

NEEDED = ("starlette", "uvicorn", "nicegui")
"""Packages without which there is no window."""
LOCAL = ("127.0.0.1", "::1", "localhost")
ANY = ("0.0.0.0", "::")


def lacking() -> str:
    """A package that the window needs and that is not installed; empty: there is none."""
    return next((name for name in NEEDED if find_spec(name) is None), "")


def can_open(terminal: bool) -> bool:
    """Tell whether somebody would see a window: there is a terminal and a display, and what it needs is installed."""
    shows = sys.platform in ("darwin", "win32") or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    return terminal and shows and not lacking()


def web() -> ModuleType:
    """Load the web server, which takes a second. Raises InputRefused if it is not installed."""
    if package := lacking():
        fault = Fault(reason=f"{package} is not installed", where="console", advice=extra_command("console"))
        raise InputRefused(fault)
    from engage_hri.services.console.web import server

    return server


def seat_refusal(option: str) -> InputRefused:
    """Error of an option for whoever sits at the page, where there is none."""
    return InputRefused(Fault(reason="the seat is in the window", where=option, advice="leave out --no-window"))


def names(shown: Shown) -> tuple[str, ...]:
    """Names by which the page may be called."""
    own = gethostname()
    more = () if shown.host in LOCAL else (*filter(None, (shown.host, outward(shown.host))), own, f"{own}.local")
    return (*LOCAL, *more, *(shown.called or ()))


def outward(host: str) -> str:
    """Address of this machine as others see it, by its routes. Empty: it has none, or `host` is not any."""
    if host not in ANY:
        return ""
    inet6 = host == "::"
    with suppress(OSError), socket(AF_INET6 if inet6 else AF_INET, SOCK_DGRAM) as way:
        way.connect(("2001:db8::1" if inet6 else "192.0.2.1", 9))  # a socket of this kind sends nothing for that
        return str(way.getsockname()[0])
    return ""


def hosts(shown: Shown) -> "Hosts":
    """All that the page may be called: else a page of others could call it by a name of theirs."""
    from engage_hri.services.web.guard import Hosts

    return Hosts(names(shown), addresses=shown.host not in LOCAL)


@asynccontextmanager
async def served(
    app: Any,
    shown: Shown,
    pages: Mapping[str, str],
    tell: Callable[[str], None],
    *,
    role: str,
    opens: bool = True,
) -> AsyncIterator[None]:
    """Serve pages while the body of `async with` runs.

    Raises RunFailed if the port is taken, and InputRefused if there is no certificate where `--https` says.

    pages: the address of each below the server's, and what is said before it. tell: gets a line for each.
    role: of whoever has the token. opens: show the first in the browser.
    """
    from engage_hri.services.web.serving import serving

    keys = server_keys(shown.https, names(shown)) if shown.https else None
    async with AsyncExitStack() as stack:
        try:
            port = await stack.enter_async_context(serving(app, shown.host, shown.port, keys))
        except OSError as error:
            is_taken = error.errno == errno.EADDRINUSE
            free = "is another window there? --port 0 takes any that is free"
            advice = free if is_taken else "--host takes an address of this machine"
            reason = os.strerror(error.errno) if error.errno else str(error)
            raise RunFailed(Fault(reason=reason, where=f"{shown.host}:{shown.port}", advice=advice)) from error
        other = outward(shown.host)
        home, abroad = (
            f"http{'s' if keys else ''}://{f'[{host}]' if ':' in host else host}:{port}/"
            for host in ("127.0.0.1" if shown.host in ANY else shown.host, other)
        )
        for page, called in pages.items():
            tell(f"{called}{home}{page}")
            if other:
                tell(f"{called.removesuffix(': ')} from other machines: {abroad}{page}")
        if shown.host not in LOCAL:
            where = "this machine" if shown.host in ANY else shown.host
            seen = f"everybody who reaches {where} sees all of this robot, and the people before it"
            seen += (
                "" if keys else ", unencrypted, and browsers there give neither microphone nor voice: --https FILE"
            )
            more = f"; who has the token in the address of the workshop takes part as {role}"
            complain(seen if role == "observer" else seen + more)
        if opens:
            webbrowser.open(home + next(iter(pages)))
        yield


@asynccontextmanager
async def looking_on(hub: Hub, began: Seconds) -> AsyncIterator["WindowServer"]:
    """Follow all that goes on at this hub for a window, while the body of `async with` runs.

    began: the instant from which the page counts its seconds.
    """
    from engage_hri.services.console.web.orders import Script
    from engage_hri.services.console.web.service import window

    bus = hub.join(unique_name("console"), "wizard")
    async with window(hub, bus, Script(()), began=began) as following:
        bus.declare_alive()
        yield following


def windowed(
    following: "WindowServer",
    shown: Shown,
    tell: Callable[[str], None],
    *,
    language: str,
    examples: Iterable[str] = (),
    kiosk: bool = False,
    opens: bool = True,
) -> AbstractAsyncContextManager[None]:
    """Show in the browser what a window follows, while the body of `async with` runs.

    It begins once the robot stands: what is refused is told before an address is. tell: gets the addresses of stage
    and workshop. language: of what one says to the robot, as a tag. examples: of it. kiosk: the stage begins anew
    when its visitor has gone. opens: show the stage in the browser.
    """
    token = token_of(shown)
    app = web().application(following, hosts(shown), token, language, tuple(examples))
    stage = stage_page(token) + ("&kiosk" if kiosk else "")
    pages = {stage: "the stage: ", workshop_page(token): "the workshop: "}
    return served(app, shown, pages, tell, role=following.bus.role, opens=opens)


def token_of(shown: Shown) -> str:
    """The token of the address: that in `--token-file`, or else a new one."""
    return new_token() if shown.token_file is None else kept_token(shown.token_file)


def workshop_page(token: str) -> str:
    """Address of the workshop below that of the server. token: empty: its visitors only look on."""
    return f"?token={token}" if token else ""


def stage_page(token: str) -> str:
    """Address of the stage, whose visitors sit down and do no more. token: that of the workshop."""
    return f"stage?token={web().stage_token(token)}"
