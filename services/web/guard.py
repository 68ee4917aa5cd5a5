"""Guard of the page: lets in who calls the window by a name of its own, and whose page is one of the window's own.

Another page in the visitor's browser may call this machine, too. It may open any WebSocket,
and it may have a name of its own point to this machine (DNS rebinding) to read what is served. So each request
is looked at before anything serves it. Pure: it knows the form of ASGI, and no web stack.
"""

import ipaddress
from collections.abc import Awaitable, Callable, Collection, Iterable, MutableMapping
from typing import Any
from urllib.parse import urlsplit

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]
HEADERS = (
    (b"x-frame-options", b"SAMEORIGIN"),
    (b"referrer-policy", b"same-origin"),
    (b"x-content-type-options", b"nosniff"),
)
"""Said with everything. No page from elsewhere shows the window in a frame, where it could have its visitor click on
what he does not see; no link tells another server from where it was followed; a file is only what it says it is."""
REFUSED = 4403
"""Code with which a WebSocket of another page is closed."""


class Hosts:
    """Names by which the window may be called. addresses: True: also by any address written in numbers.

    In an address in numbers nobody can make a name point elsewhere, so that these are safe where the window listens
    to other machines.
    """

    def __init__(self, names: Iterable[str], *, addresses: bool = False) -> None:
        self._names = frozenset(_plain(name) for name in names)
        self._addresses = addresses

    def include(self, called: str) -> bool:
        """Tell whether it may be called so. called: what stands in a header `Host`, with or without a port."""
        try:
            name = _plain(urlsplit(f"//{called}").hostname or "")
        except ValueError:
            return False
        return name in self._names or (self._addresses and _is_address(name))


def refusal(
    headers: Iterable[tuple[bytes, bytes]], hosts: Hosts, *, socket: bool, programs: bool = False
) -> tuple[int, str] | None:
    """Reason for which a request is not served: the status of HTTP, and words; None: it is served.

    socket: it opens a WebSocket, which a page of the window's own always says where it is from. programs: it may come
    from a program that is no browser, which says nothing.
    """
    called, origins = _values(headers, b"host"), _values(headers, b"origin")
    if len(called) != 1 or not hosts.include(called[0]):
        return 400, "the window is not served under this name: `--called NAME` adds one"
    if not origins and socket and not programs:
        return 403, "the page does not say where it is from"
    if any(not is_own(origin, called[0]) for origin in origins):
        return 403, "the page is from elsewhere: --pages serves yours from here"
    return None


def is_own(origin: str, called: str) -> bool:
    """Tell whether a page from there is one of the server that is called so."""
    try:
        return urlsplit(origin).netloc.lower() == called.lower()
    except ValueError:
        return False


class Guarded:
    """An application, for own pages alone. for_programs: paths of WebSockets that programs may open as well."""

    def __init__(self, app: App, hosts: Hosts, for_programs: Collection[str] = ()) -> None:
        self._app = app
        self._hosts = hosts
        self._for_programs = frozenset(for_programs)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request, or refuse it."""
        socket = scope["type"] == "websocket"
        if not socket and scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        programs = scope["path"] in self._for_programs
        refused = refusal(scope["headers"], self._hosts, socket=socket, programs=programs)
        if refused is None:
            await self._app(scope, receive, _while_linked(send) if socket else _with_headers(send))
        elif socket:
            await send({"type": "websocket.close", "code": REFUSED, "reason": refused[1]})
        else:
            body = refused[1].encode()
            headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(body)).encode())]
            send = _with_headers(send)
            await send({"type": "http.response.start", "status": refused[0], "headers": headers})
            await send({"type": "http.response.body", "body": body})


def _with_headers(send: Send) -> Send:
    async def sending(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message.get("headers", ()), *HEADERS]
        await send(message)

    return sending


def _while_linked(send: Send) -> Send:
    """Make sending to a WebSocket end in OSError, as to any that has gone, where the server has ended it already.

    It does so by itself, as for a frame that is too large or no answer to its pings, and says RuntimeError to who
    sends before they have heard of that.
    """

    async def sending(message: MutableMapping[str, Any]) -> None:
        try:
            await send(message)
        except RuntimeError as error:
            raise OSError(str(error)) from error

    return sending


def _values(headers: Iterable[tuple[bytes, bytes]], name: bytes) -> list[str]:
    return [value.decode("latin-1") for key, value in headers if key.lower() == name]


def _plain(name: str) -> str:
    return name.lower().removeprefix("[").removesuffix("]").removesuffix(".")


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
