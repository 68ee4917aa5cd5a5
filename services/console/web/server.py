"""Server of the page: its files, and the frames over a WebSocket."""

import asyncio
import contextlib
import json
import re
from base64 import b64encode
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Sequence
from hashlib import sha256
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from engage_hri.schemas.behaviors import EVENT_KINDS
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.console.web import orders
from engage_hri.services.console.web.frames import Receipts, Viewer, You
from engage_hri.services.console.web.played import PlayedPicture
from engage_hri.services.console.web.service import WindowServer
from engage_hri.services.console.web.sessions import OVER, PageSession, Sessions
from engage_hri.services.console.web.sights import Sights
from engage_hri.services.console.web.sounds import Sounds
from engage_hri.services.console.web.stage import StageFace
from engage_hri.services.console.web.visitor import Visitor
from engage_hri.services.recording.reading import Recording
from engage_hri.services.web.guard import App, Guarded, Hosts
from engage_hri.services.web.links import sent, text_of
from engage_hri.services.web.outbox import Outbox, message_types
from engage_hri.services.web.tokens import is_token

TICK: Seconds = 1 / 15
"""Least time between two frames of a browser."""
MOST_VIEWERS = 100
FULL = 4429
"""Code with which a WebSocket is closed for which there is no room: 4000 and the status that HTTP has for it."""
WORDS_FULL = f"{MOST_VIEWERS} browsers look on already, and it shows itself to no more"
PAGE = Path(__file__).parent / "page"
"""Files of the workshop's page."""
STAGE = Path(__file__).parents[1] / "stage"
"""Files of the stage's page."""
THREE = "elements/scene/dist"
"""Where NiceGUI keeps three.js, as one module. No more of NiceGUI is used, and none of its Python is loaded."""
TOO_MANY = 4408
"""Code with which a WebSocket is closed whose page gives orders and draws no news of them."""
FRAMES = "/frames"
"""Path of the WebSocket of the workshop's page."""
STAGE_FRAMES = "/stage/frames"
"""Path of the WebSocket of the stage's page."""
MESSAGES = "/messages"
"""Path of the WebSocket for programs of others."""
PAGES = "/pages"
"""Path of pages of others."""
MOST_PROGRAMS = 100
POLICY = (
    "default-src 'none'; script-src 'self' 'sha256-{imports}'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self' ws: wss:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'self'"
)
"""What our own page may load and do. imports: digest of its map of modules, the only script in the page itself."""


def application(
    window: WindowServer,
    hosts: Hosts,
    token: str,
    language: str,
    examples: Sequence[str] = (),
    pages: Path | None = None,
) -> App:
    """The page and its frames, for requests that name one of these hosts.

    pages: a folder of pages of somebody else, which may listen to the messages. token: who takes part has it in the
    address of the page at the first visit, and then in a cookie, which no script can read: the page's address may be
    seen, copied, and kept in the history of the browser. The stage has another one (`stage_token`), with which
    one sits down and does no more. language: of what one says to the robot, as a tag: the stage tells who reads
    another one. examples: what one may say to it, which the stage shows.
    """
    visitors = stage_token(token)
    workshop = Sessions(lambda receipts, trusted: Visitor(window, trusted, receipts), MOST_VIEWERS)
    face = StageFace(window.picture)
    stage = Sessions(lambda receipts, trusted: Visitor(window, trusted, receipts, face), MOST_VIEWERS)

    def shows(sessions: Sessions, token: str) -> Callable[[WebSocket], Awaitable[None]]:
        async def frames(browser: WebSocket) -> None:
            given = browser.query_params.get("token", browser.cookies.get(_cookie(token), ""))
            window.viewers += 1
            try:
                await _shown(browser, sessions, is_token(given, token))
            finally:
                window.viewers -= 1

        return frames

    async def close() -> None:
        await stage.close()
        await workshop.close()

    async def messages(program: WebSocket) -> None:
        only = frozenset(filter(None, program.query_params.get("only", "").split(",")))
        await program.accept()  # who is refused before learns no reason
        if unknown := sorted(only - message_types()):
            await program.close(4400, f"there is no message of type {unknown[0]!r}"[:120])
        elif len(window.listeners) >= MOST_PROGRAMS:
            await program.close(FULL, f"{MOST_PROGRAMS} programs listen already")
        else:
            with contextlib.suppress(WebSocketDisconnect):
                await _tell(window, program, Outbox(only))

    def visitor(session: str) -> Visitor | None:
        guest = workshop.guest(session) or stage.guest(session)
        return guest if isinstance(guest, Visitor) else None

    sounds = Sounds(window.bus, visitor)
    more: list[BaseRoute] = [
        WebSocketRoute(MESSAGES, messages),
        WebSocketRoute("/voice", sounds.voice),
        WebSocketRoute("/microphone", sounds.microphone),
        *Sights(window.bus, visitor).routes(PAGE),
        Route("/stage", _page(STAGE, window.bus.robot, visitors, language, examples)),
        WebSocketRoute(STAGE_FRAMES, shows(stage, visitors)),
        Mount("/stage", _Fresh(directory=STAGE)),
    ]
    if pages is not None:
        more.append(Mount(PAGES, StaticFiles(directory=pages, html=True)))
    return Guarded(_app(window.bus.robot, shows(workshop, token), close, more, token), hosts, {MESSAGES})


def stage_token(token: str) -> str:
    """The token of visitors of the stage, who may sit down. From it nobody learns the window's own."""
    return sha256(f"stage {token}".encode()).hexdigest()[:16]


def _cookie(token: str) -> str:
    """Name of the cookie that holds a token: windows at all ports of a host share their cookies."""
    return f"engage-{sha256(token.encode()).hexdigest()[:12]}"


def recorded(recording: Recording, hosts: Hosts) -> App:
    """The page, playing a recording. Each browser has a place of its own in it."""
    sessions = Sessions(lambda receipts, trusted: _Played(recording, receipts), MOST_VIEWERS)

    async def frames(browser: WebSocket) -> None:
        await _shown(browser, sessions, False)

    return Guarded(_app(recording.robot, frames, sessions.close), hosts)


def page_of(robot: str, folder: Path = PAGE, language: str = "", examples: Sequence[str] = ()) -> str:
    """The page of a robot, which knows the kinds of connection events. folder: its files.

    language, examples: of the talk.
    """
    kinds = [(kind, each.short or each.title, each.is_answered) for kind, each in EVENT_KINDS.items()]
    page = (folder / "index.html").read_text(encoding="utf-8").replace("{kinds}", escape(json.dumps(kinds)))
    page = page.replace("{examples}", escape(json.dumps([*examples])))
    return page.replace("{robot}", escape(robot)).replace("{language}", escape(language))


def _app(
    robot: str,
    frames: Callable[[WebSocket], Awaitable[None]],
    close: Callable[[], Awaitable[None]],
    more: Iterable[BaseRoute] = (),
    token: str = "",
) -> Starlette:
    """The workshop and its frames. close: is called at the end."""

    @contextlib.asynccontextmanager
    async def life(app: Starlette) -> AsyncIterator[None]:
        try:
            yield
        finally:
            await close()

    (nicegui,) = find_spec("nicegui").submodule_search_locations  # type: ignore[union-attr,misc]
    routes = [
        *more,
        Route("/", _page(PAGE, robot, token)),
        Mount("/page", _Fresh(directory=PAGE)),
        Mount("/three", StaticFiles(directory=Path(nicegui) / THREE)),
        WebSocketRoute(FRAMES, frames),
    ]
    return Starlette(routes=routes, lifespan=life)


def _page(
    folder: Path, robot: str, token: str, language: str = "", examples: Sequence[str] = ()
) -> Callable[[Request], Awaitable[Response]]:
    """Answer with the `index.html` of a folder, and take the token out of its address at the first visit.

    token: empty: there is none.
    """
    page = page_of(robot, folder, language, examples)
    imports = re.search("<script type=.importmap.>(.*?)</script>", page)
    assert imports is not None
    digest = b64encode(sha256(imports[1].encode()).digest()).decode()
    headers = {"content-security-policy": POLICY.format(imports=digest)}

    async def answer(request: Request) -> Response:
        asked = dict(request.query_params)
        given = asked.pop("token", None)
        if given is None or not token:
            return HTMLResponse(page, headers=headers)
        rest = f"?{urlencode(asked)}" if asked else ""
        response = RedirectResponse(f"./{request.url.path.rpartition('/')[2]}{rest}", 303)
        if is_token(given, token):
            safe = request.url.scheme == "https"
            # path: that of the page
            response.set_cookie(_cookie(token), token, path=None, httponly=True, samesite="strict", secure=safe)
        return response

    return answer


class _Fresh(StaticFiles):
    """Files that a browser asks for again: after an update none of another version is mixed in."""

    def file_response(self, *args: Any, **more: Any) -> Response:
        response = super().file_response(*args, **more)
        response.headers["cache-control"] = "no-cache"
        return response


async def _shown(browser: WebSocket, sessions: Sessions, trusted: bool) -> None:
    """Serve one link of a page, until it ends."""
    await browser.accept()  # who is refused before learns no reason
    session = await sessions.enter(browser.query_params.get("session", ""), trusted)
    if session is None:
        await browser.close(FULL, WORDS_FULL)
        return
    link, code = session.links, OVER
    try:
        await _show(browser, session)
    except WebSocketDisconnect as end:
        code = end.code
    finally:
        await sessions.part(session, link, code)


async def _show(browser: WebSocket, session: PageSession) -> None:
    """Send frames until the browser has made another link. Raises WebSocketDisconnect when it has gone."""
    viewer, drawn, receipts = Viewer(), asyncio.Event(), session.receipts

    async def listen() -> None:
        while not receipts.is_full:
            try:
                said = orders.message(await text_of(browser))
            except InputRefused as error:
                receipts.tell("part", str(error))
                continue
            if isinstance(said, orders.Drawn):
                receipts.confirm()
                drawn.set()
            else:
                session.take(said)
        await browser.close(TOO_MANY, "orders are given, and news of them are not drawn")
        raise WebSocketDisconnect(TOO_MANY)

    session.link = listening = asyncio.create_task(listen(), name="browser")
    try:
        while not listening.done():
            if (made := session.guest.frame(viewer)) is not None:
                drawn.clear()
                await browser.send_text(made.decode())
                waiting = asyncio.ensure_future(drawn.wait())
                await asyncio.wait((waiting, listening), return_when=asyncio.FIRST_COMPLETED)
                waiting.cancel()
            await asyncio.sleep(TICK)
        if not listening.cancelled():
            listening.result()
    finally:
        listening.cancel()


class _Played:
    """A page that plays a recording."""

    def __init__(self, recording: Recording, receipts: Receipts) -> None:
        self._now = asyncio.get_running_loop().time
        self._receipts = receipts
        self._played = PlayedPicture(recording, self._now())
        self._you = You(denied=dict.fromkeys(orders.ALL_RIGHTS, "this is a recording"))

    def take(self, given: orders.Given) -> None:
        try:
            order = orders.decoded_in_recording(given.order)
        except InputRefused as error:
            self._receipts.tell("player", str(error))
            return
        at = self._now()
        if order.at is not None:
            self._played.seek(order.at, at)
        self._played.play(at, order.speed) if order.on else self._played.pause(at)

    async def leave(self) -> None:
        """End nothing: it has begun nothing that goes on."""

    def frame(self, viewer: Viewer) -> bytes | None:
        """The next frame for this viewer."""
        now = self._now()
        self._played.advance(now)
        place = self._played.place(now)
        return viewer.frame(self._played.picture, place.at, self._you, self._receipts, place, now)


async def _tell(window: WindowServer, program: WebSocket, outbox: Outbox) -> None:
    """Send messages until the program has gone. Raises WebSocketDisconnect then."""
    news = asyncio.Event()

    def take(message: Message) -> None:
        if outbox.put(message):
            news.set()

    window.listeners.add(take)
    try:
        await sent(program, outbox, news)
    finally:
        window.listeners.discard(take)
