"""Server of the page: the page itself by NiceGUI, and the frames over a WebSocket of their own."""

import asyncio
import contextlib
import secrets
import socket
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path

import uvicorn
from fastapi import FastAPI, WebSocket, WebSocketDisconnect
from nicegui import ui
from starlette.staticfiles import StaticFiles

from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.console.web import orders
from engage_hri.services.console.web.frames import Told, Viewer, You
from engage_hri.services.console.web.guard import App, Guarded, Hosts
from engage_hri.services.console.web.outbox import Outbox, types
from engage_hri.services.console.web.page import build
from engage_hri.services.console.web.played import PlayedPicture
from engage_hri.services.console.web.service import Window
from engage_hri.services.console.web.visitor import Visitor
from engage_hri.services.recording.reading import Recording

TICK: Seconds = 1 / 15
"""Least time between two frames of a browser."""
LARGEST_ORDER = 2**16
"""Bytes of one order of a page."""
AWAY: Seconds = 60.0
"""Time for which NiceGUI waits for a page that sleeps; after that the page is loaded anew, without its seat."""
MOST_VIEWERS = 100
FULL = 4429
"""Code with which a WebSocket is closed for which there is no room: 4000 and the status that HTTP has for it."""
WORDS_FULL = f"{MOST_VIEWERS} browsers look on already, and it shows itself to no more"
FRAMES = "/frames"
"""Path of the WebSocket of our own page."""
MESSAGES = "/messages"
"""Path of the WebSocket for programs of others."""
PAGES = "/pages"
"""Path of pages of others."""
MOST_PROGRAMS = 100
NO_TEXT = 1003
"""Code of RFC 6455 with which a WebSocket is closed that sends bytes."""


def application(window: Window, hosts: Hosts, token: str, pages: Path | None = None) -> App:
    """The page and its frames, for requests that name one of these hosts.

    pages: a folder of pages of somebody else, which may listen to the messages. token: who takes part has it in the
    address of the page.
    """
    app = _empty()

    @app.websocket(FRAMES)
    async def frames(browser: WebSocket) -> None:
        await browser.accept()  # who is refused before learns no reason
        if window.viewers >= MOST_VIEWERS:
            await browser.close(FULL, WORDS_FULL)
            return
        with contextlib.suppress(WebSocketDisconnect):
            given = browser.query_params.get("token", "")
            visitor = Visitor(window, secrets.compare_digest(given.encode(), token.encode()))
            await _show_robot(window, browser, visitor)

    @app.websocket(MESSAGES)
    async def messages(program: WebSocket) -> None:
        only = frozenset(filter(None, program.query_params.get("only", "").split(",")))
        await program.accept()  # who is refused before learns no reason
        if unknown := sorted(only - types()):
            await program.close(4400, f"there is no message of type {unknown[0]!r}"[:120])
        elif len(window.listeners) >= MOST_PROGRAMS:
            await program.close(FULL, f"{MOST_PROGRAMS} programs listen already")
        else:
            with contextlib.suppress(WebSocketDisconnect):
                await _tell(window, program, Outbox(only))

    if pages is not None:
        app.mount(PAGES, StaticFiles(directory=pages, html=True))

    _with_page(app, window.bus.robot)
    return Guarded(app, hosts, {MESSAGES})


def recorded(recording: Recording, hosts: Hosts) -> App:
    """The page, playing a recording."""
    app, viewers = _empty(), set[WebSocket]()

    @app.websocket(FRAMES)
    async def frames(browser: WebSocket) -> None:
        await browser.accept()  # who is refused before learns no reason
        if len(viewers) >= MOST_VIEWERS:
            await browser.close(FULL, WORDS_FULL)
            return
        viewers.add(browser)
        try:
            await _show_recording(recording, browser)
        except WebSocketDisconnect:
            pass
        finally:
            viewers.discard(browser)

    _with_page(app, recording.robot)
    return Guarded(app, hosts)


def _empty() -> FastAPI:
    return FastAPI(docs_url=None, redoc_url=None, openapi_url=None)


async def _text(socket: WebSocket) -> str:
    """Wait for a text. Raises WebSocketDisconnect when the other side has gone, or sends something else."""
    message = await socket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message["code"])
    text = message.get("text")
    if text is None:
        await socket.close(NO_TEXT, "send text, not bytes")
        raise WebSocketDisconnect(NO_TEXT)
    return str(text)


def _with_page(app: FastAPI, robot: str) -> None:
    @ui.page("/", title=f"Engage: {robot}")
    def page() -> None:
        build(robot)

    ui.run_with(
        app, dark=None, language="en-US", tailwind=False, show_welcome_message=False, storage_secret=None,
        reconnect_timeout=AWAY, binding_refresh_interval=None, gzip_middleware_factory=None,
    )  # fmt: skip


async def _show(browser: WebSocket, take: Callable[[str], bool], frame: Callable[[], bytes | None]) -> None:
    """Send frames until the browser has gone. Raises WebSocketDisconnect then.

    take: takes an order; True: it says that the last frame is drawn. frame: makes the next one; None: there is none.
    """
    drawn = asyncio.Event()
    drawn.set()

    async def listen() -> None:
        while True:
            if take(await _text(browser)):
                drawn.set()

    listening = asyncio.create_task(listen(), name="browser")
    try:
        while not listening.done():
            if (made := frame()) is not None:
                drawn.clear()
                await browser.send_text(made.decode())
                waiting = asyncio.ensure_future(drawn.wait())
                await asyncio.wait((waiting, listening), return_when=asyncio.FIRST_COMPLETED)
                waiting.cancel()
            await asyncio.sleep(TICK)
        listening.result()
    finally:
        listening.cancel()


async def _show_robot(window: Window, browser: WebSocket, visitor: Visitor) -> None:
    viewer = Viewer()

    def frame() -> bytes | None:
        window.picture.advance(window.bus.now())
        return viewer.frame(window.picture, window.bus.now(), visitor.you, visitor.told())

    window.viewers += 1
    try:
        await _show(browser, visitor.take, frame)
    finally:
        window.viewers -= 1
        await visitor.leave()


async def _show_recording(recording: Recording, browser: WebSocket) -> None:
    """Each browser has a place of its own in the recording."""
    now = asyncio.get_running_loop().time
    viewer, told, played = Viewer(), list[Told](), PlayedPicture(recording, now())
    reason = "this is a recording"
    you = You(denied=dict.fromkeys(orders.ALL_RIGHTS, reason))

    def take(text: str) -> bool:
        try:
            order = orders.decoded_in_recording(text)
        except InputRefused as error:
            told.append(Told("player", str(error)))
            return False
        if isinstance(order, orders.Play):
            at = now()
            if order.at is not None:
                played.seek(order.at, at)
            played.play(at, order.speed) if order.on else played.pause(at)
        return isinstance(order, orders.Drawn)

    def frame() -> bytes | None:
        played.advance(now())
        place, news = played.place(now()), tuple(told)
        told.clear()
        return viewer.frame(played.picture, place.at, you, news, place, now())

    await _show(browser, take, frame)


async def _tell(window: Window, program: WebSocket, outbox: Outbox) -> None:
    """Send messages until the program has gone. Raises WebSocketDisconnect then."""
    news = asyncio.Event()

    def take(message: Message) -> None:
        if outbox.put(message):
            news.set()

    async def listen() -> None:
        while True:  # what it says means nothing
            await _text(program)

    window.listeners.add(take)
    listening = asyncio.create_task(listen(), name="program")
    try:
        while not listening.done():
            waiting = asyncio.ensure_future(news.wait())
            await asyncio.wait((waiting, listening), return_when=asyncio.FIRST_COMPLETED)
            waiting.cancel()
            news.clear()
            for text in outbox.take():
                await program.send_text(text)
        listening.result()
    finally:
        window.listeners.discard(take)
        listening.cancel()


class _Quiet(uvicorn.Server):
    """The server without its own ways with signals: the process has its own. stands: set when it serves."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.stands = asyncio.Event()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self.stands.set()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Wait for no connection, but let the application end in order: its task would be left behind."""
        await super().shutdown(sockets)
        if self.force_exit:
            await self.lifespan.shutdown()

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


@contextlib.asynccontextmanager
async def serving(app: App, host: str, port: int) -> AsyncIterator[int]:
    """Serve while the body of `async with` runs. port: 0: any that is free. Returns the port.

    Raises OSError if the port is taken.
    """
    # With a configuration of its own for the log, it would close the handlers of ours.
    config = uvicorn.Config(
        app, log_config=None, log_level="warning", access_log=False, lifespan="on", timeout_graceful_shutdown=1,
        ws="websockets-sansio", ws_per_message_deflate=False, ws_max_size=LARGEST_ORDER,
    )  # fmt: skip
    listening = _bound(host, port)
    server = _Quiet(config)
    running = asyncio.create_task(server.serve(sockets=[listening]), name="web server")
    try:
        standing = asyncio.create_task(server.stands.wait())
        await asyncio.wait((standing, running), return_when=asyncio.FIRST_COMPLETED)
        standing.cancel()
        if running.done():
            running.result()
        yield listening.getsockname()[1]
    finally:
        server.should_exit = True
        server.force_exit = True
        await asyncio.wait([running])
        if server.stands.is_set():  # an end by force leaves this out, and the loop then ends it by a traceback
            await server.lifespan.shutdown()


def _bound(host: str, port: int) -> socket.socket:
    """A socket that listens there. Raises OSError if it cannot."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    return socket.create_server((host, port), family=family)
