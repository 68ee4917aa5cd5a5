"""The door as a server: who comes in, how many and how large requests may be, and each as one call of `Robot`.

A request is open until what it asks for is over. If its connection ends before, the call is cancelled, as that of a
Python program whose task is: the robot stops at a word. So a program that dies leaves nothing going on.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Mapping, Sequence
from contextlib import ExitStack, asynccontextmanager, suppress
from itertools import count
from typing import Any, TypeVar

import msgspec
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import HTTPConnection, Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from engage_hri.schemas.access import LARGEST_XML_SENT
from engage_hri.schemas.faults import EngageError, Fault, InputRefused, NoReply, NotReady
from engage_hri.schemas.summary import Summary
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.client.feeds import Feed
from engage_hri.services.client.performing import PerformFailed
from engage_hri.services.client.robot import Robot
from engage_hri.services.door.openapi import DoorRefusal, document
from engage_hri.services.door.operations import OPERATIONS, SPEAKS, TOPICS, Operation, Right, queried, topics
from engage_hri.services.door.speaking import (
    AnyWritingOrder,
    BeginTurn,
    EndTurn,
    HoldTurn,
    ResumeTurn,
    StopTurn,
    TurnHeld,
    TurnOver,
    TurnResumed,
    TurnStarted,
    WordSounded,
    WritePart,
    WriteText,
    order,
)
from engage_hri.services.frameworks.written_turn import WrittenTurn
from engage_hri.services.web.links import sent, text_of
from engage_hri.services.web.outbox import Outbox
from engage_hri.services.web.tokens import is_token

MOST_AT_ONCE = 64
"""Requests that are being answered at once, and turns that are being written."""
MOST_NEWS = 100
"""Links on which news are told at once."""
HEARTBEAT: Seconds = 10.0
"""Time after which a link of lines gets an empty one: else nobody would see that its program has died."""
NO_ENTRY = 4401
"""Code with which a WebSocket is closed that has no token, as 401 of HTTP."""
NOT_ALLOWED = 4403
"""The same for a role that may not do that."""
WRONG = 4400
"""The same for an address in which something is wrong."""
NO_ROOM = 4429
"""The same if there is no room."""


T = TypeVar("T")


class _Refused(Exception):
    """Reason for which a request is not answered. code: status of HTTP."""

    def __init__(self, code: int, reason: str, advice: str = "", where: str = "") -> None:
        super().__init__(reason)
        self.code = code
        self.fault = Fault(reason=reason, advice=advice, where=where, service="door")


class DoorServer:
    """Server of all requests. tokens: that of each role that has one."""

    def __init__(self, robot: Robot, bus: Bus, tokens: Mapping[str, str]) -> None:
        self.robot = robot
        self.bus = bus
        self._tokens = tokens
        self._calls = 0
        self._links = 0
        self._life = bus.new_life()
        self._numbers = count(1)

    def application(self) -> Starlette:
        """Make the application."""
        paths = dict.fromkeys(each.path for each in OPERATIONS)
        routes: list[BaseRoute] = [
            Route(path, self._answers({each.method: each for each in OPERATIONS if each.path == path}),
                  methods=[each.method for each in OPERATIONS if each.path == path])
            for path in paths
        ]  # fmt: skip
        routes += [
            Route("/v1/openapi.json", self._refusing(self._describe)),
            Route("/v1/news", self._refusing(self._lines)),
            WebSocketRoute("/v1/news", self._news),
            WebSocketRoute("/v1/speak", self._speak),
        ]
        # Any page may ask: what lets it in is a token that it has to know, and no cookie that a browser adds.
        anybody = Middleware(
            CORSMiddleware, allow_origins=["*"], allow_methods=["*"], allow_headers=["authorization", "content-type"]
        )
        return Starlette(routes=routes, middleware=[anybody])

    def new_id(self) -> str:
        """Make the id of a turn."""
        return f"{self.bus.name}-{self._life}-{next(self._numbers)}"

    # -- who comes in -----------------------------------------------------------------------------------------------

    def _enter(self, connection: HTTPConnection, *rights: Right) -> None:
        """Raise _Refused if the one who has connected may not do this."""
        scheme, _, given = connection.headers.get("authorization", "").partition(" ")
        if scheme.lower() != "bearer":
            given = connection.query_params.get("token", "")
        role = next((role for role, token in self._tokens.items() if is_token(given.strip(), token)), "")
        if not role:
            raise _Refused(401, "no token of this door", "send it as `Authorization: Bearer TOKEN`")
        for right in rights:
            if not right.has(role):
                raise _Refused(403, f"the role {role} may not do that", "use the token of another role")
            if not right.has(self.bus.role):
                raise _Refused(403, f"the door has the role {self.bus.role} on the bus, which may not do that")

    def _refusing(self, answer: Callable[[Request], Awaitable[Response]]) -> Callable[[Request], Awaitable[Response]]:
        """Turn whatever goes wrong into an answer."""

        async def answering(request: Request) -> Response:
            outcome = None
            try:
                return await answer(request)
            except _Refused as refused:
                code, fault = refused.code, refused.fault
            except EngageError as error:
                code, fault = _status(error), error.fault
                outcome = (
                    msgspec.Raw(msgspec.json.encode(error.outcome)) if isinstance(error, PerformFailed) else None
                )
            except Exception as error:
                code, fault = 500, self.bus.failed(error, f"{request.method} {request.url.path}")
            headers = {401: {"www-authenticate": "Bearer"}, 429: {"retry-after": "1"}}.get(code)
            return _json(DoorRefusal(fault=fault, outcome=outcome), code, headers)

        return answering

    # -- requests ---------------------------------------------------------------------------------------------------

    def _answers(self, operations: Mapping[str, Operation]) -> Callable[[Request], Awaitable[Response]]:
        async def answer(request: Request) -> Response:
            operation = operations["GET" if request.method == "HEAD" else request.method]
            self._enter(request, operation.right)
            query = queried(operation.query, _parameters(request))
            if self._calls >= MOST_AT_ONCE:
                raise _Refused(429, f"{MOST_AT_ONCE} requests are being answered", "wait for answers, then ask again")
            self._calls += 1
            try:
                body = await _body(request, operation.right.most)
                if operation.body is None and body.strip() not in (b"", b"{}"):
                    raise InputRefused(Fault(reason="nothing is taken here", where="body", advice="leave it empty"))
                return _json(await _unless_gone(request, operation.call(self.robot, body, query)))
            finally:
                self._calls -= 1

        return self._refusing(answer)

    async def _describe(self, request: Request) -> Response:
        self._enter(request)
        return _json(document())

    # -- news -------------------------------------------------------------------------------------------------------

    def _wanted(self, connection: HTTPConnection) -> Sequence[str]:
        """Topics that a link asks for, and may hear. Raises _Refused, or InputRefused."""
        asked = _parameters(connection)
        if more := sorted({*asked} - {"only"}):
            raise InputRefused(Fault(reason=f"there is no parameter {more[0]!r:.80}", where="address", advice="only"))
        wanted = topics(asked.get("only", ""))
        self._enter(connection, *(TOPICS[each].right for each in wanted))
        if self._links >= MOST_NEWS:
            raise _Refused(429, f"{MOST_NEWS} programs listen already")
        return wanted

    @asynccontextmanager
    async def _telling(self, wanted: Sequence[str]) -> AsyncIterator[tuple[Outbox, asyncio.Event]]:
        """Put news of these topics into an outbox. The event is set whenever something was put there."""
        outbox, news = Outbox(), asyncio.Event()

        async def pump(feed: Feed[Any]) -> None:
            async for message in feed:
                outbox.put(message)
                news.set()

        self._links += 1
        try:
            with ExitStack() as stack:
                feeds = [stack.enter_context(TOPICS[each].feed(self.robot)) for each in wanted]
                pumps = [asyncio.create_task(pump(feed), name="news of the door") for feed in feeds]
                try:
                    yield outbox, news
                finally:
                    for task in pumps:
                        task.cancel()
                    await asyncio.wait(pumps)
        finally:
            self._links -= 1

    async def _lines(self, request: Request) -> Response:
        wanted = self._wanted(request)

        async def lines() -> AsyncIterator[str]:
            async with self._telling(wanted) as (outbox, news):
                while True:
                    with suppress(TimeoutError):
                        await asyncio.wait_for(news.wait(), HEARTBEAT)
                    news.clear()
                    yield "".join(f"{text}\n" for text in outbox.take()) or "\n"

        return StreamingResponse(lines(), media_type="application/x-ndjson")

    async def _news(self, program: WebSocket) -> None:
        await program.accept()  # who is refused before learns no reason
        if (wanted := await _admitted(program, lambda: self._wanted(program))) is not None:
            async with self._telling(wanted) as (outbox, news):
                with suppress(WebSocketDisconnect):
                    await sent(program, outbox, news)

    # -- turns that are written -------------------------------------------------------------------------------------

    async def _speak(self, program: WebSocket) -> None:
        def enter() -> bool:
            self._enter(program, SPEAKS)
            if self._calls >= MOST_AT_ONCE:
                raise _Refused(429, f"{MOST_AT_ONCE} requests are being answered")
            return True

        await program.accept()
        if await _admitted(program, enter):
            self._calls += 1
            try:
                await _SpeakingLink(self, program).serve()
            finally:
                self._calls -= 1


class _SpeakingLink:
    """A link on which one turn after the other is written."""

    def __init__(self, door: DoorServer, program: WebSocket) -> None:
        self._door = door
        self._program = program
        self._outbox, self._news = Outbox(), asyncio.Event()
        self._turn: WrittenTurn | None = None
        self._following: asyncio.Task[None] | None = None

    async def serve(self) -> None:
        """Carry out orders until the program has gone, which stops its turn."""
        sending = asyncio.create_task(self._send(), name="news of turns")
        try:
            while True:
                text = await text_of(self._program)
                try:
                    await self._take(order(text))
                except EngageError as error:
                    self._tell(error.fault)
        except WebSocketDisconnect:
            pass
        finally:
            sending.cancel()
            if self._turn is not None:
                self._turn.stop()
            await asyncio.wait([sending, *filter(None, [self._following])])

    async def _take(self, said: AnyWritingOrder) -> None:
        match said:
            case BeginTurn():
                self._begin(said)
            case WriteText(text=text):
                self._written().write(text)
            case WritePart():
                part = said.read()
                self._written().write(part)
            case EndTurn():
                self._running().end()
            case StopTurn():
                self._running().stop()
            case HoldTurn():
                await (turn := self._running()).hold()
                self._tell(TurnHeld(turn=turn.id))
            case ResumeTurn():
                await (turn := self._running()).resume()
                self._tell(TurnResumed(turn=turn.id))

    def _begin(self, said: BeginTurn) -> WrittenTurn:
        if self._turn is not None:
            reason, advice = "the turn before is not over", "wait for `over`, or `stop` it"
            raise InputRefused(Fault(reason=reason, where=self._turn.id, advice=advice))
        options, id = said.options(), self._door.new_id()

        def word(word: str) -> None:
            self._tell(WordSounded(turn=id, word=word, said=turn.said))

        turn = self._turn = WrittenTurn(
            self._door.robot,
            id,
            turn=options,
            await_answer=said.await_answer,
            on_start=lambda: self._tell(TurnStarted(turn=id)),
            on_word=word,
        )
        self._following = asyncio.create_task(self._follow(turn), name=f"end of {id}")
        return turn

    def _written(self) -> WrittenTurn:
        return self._turn or self._begin(BeginTurn())

    def _running(self) -> WrittenTurn:
        if self._turn is None:
            raise InputRefused(Fault(reason="no turn has begun", where="order", advice="write some text first"))
        return self._turn

    async def _follow(self, turn: WrittenTurn) -> None:
        over: Summary = await turn.over()
        self._turn = None
        self._tell(TurnOver(turn=turn.id, summary=over))

    def _tell(self, told: msgspec.Struct) -> None:
        self._outbox.put(told)
        self._news.set()

    async def _send(self) -> None:
        with suppress(WebSocketDisconnect):
            while True:
                await self._news.wait()
                self._news.clear()
                for text in self._outbox.take():
                    await self._program.send_text(text)


async def _admitted(program: WebSocket, enter: Callable[[], T]) -> T | None:
    """Return what `enter` returns; None: it has refused the program, whose link is closed."""
    codes = {401: NO_ENTRY, 403: NOT_ALLOWED, 429: NO_ROOM}
    try:
        return enter()
    except _Refused as refused:
        await program.close(codes[refused.code], str(refused.fault)[:120])
    except InputRefused as error:
        await program.close(WRONG, str(error)[:120])
    return None


def _parameters(connection: HTTPConnection) -> dict[str, str]:
    return {name: value for name, value in connection.query_params.items() if name != "token"}


async def _body(request: Request, most: int) -> bytes:
    """Read the body. Raises _Refused if it is too large, before it is in memory."""

    def check(size: int, limit: int) -> None:
        if size > limit:
            raise _Refused(413, f"{size} bytes; at most {limit} are taken", "split it into several", "body")

    with suppress(ValueError):
        check(int(request.headers.get("content-length", "0")), most)
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        check(len(body), most)
    if body.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        check(len(body), LARGEST_XML_SENT)
    return bytes(body)


async def _unless_gone(request: Request, call: Coroutine[Any, Any, Any]) -> Any:
    """Return what the call returns; it is cancelled if the connection ends before."""
    calling = asyncio.ensure_future(call)
    leaving = asyncio.create_task(_gone(request), name="connection of a request")
    try:
        await asyncio.wait([calling, leaving], return_when=asyncio.FIRST_COMPLETED)
        if not calling.done():
            raise _Refused(499, "the connection has ended")
        return calling.result()
    finally:
        for task in (calling, leaving):
            task.cancel()
        await asyncio.wait([calling, leaving])


async def _gone(request: Request) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass


def _status(error: EngageError) -> int:
    if isinstance(error, NotReady):
        return 409
    if isinstance(error, InputRefused):
        return 400
    return 504 if isinstance(error, NoReply) else 502


def _json(content: Any, code: int = 200, headers: Mapping[str, str] | None = None) -> Response:
    return Response(msgspec.json.encode(content), code, headers, "application/json")
