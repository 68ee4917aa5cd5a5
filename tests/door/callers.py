"""Programs at the door in virtual time: requests and links in the form of ASGI, without a socket."""

import asyncio
import json
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import Robot
from engage_hri.services.door.server import DoorServer
from tests.cancelling import whole_robot

TOKENS = {role: f"token-of-{role}" for role in ("observer", "manager", "operator", "wizard")}


class Answered(NamedTuple):
    code: int
    said: Any


class Programs:
    """Programs at one door."""

    def __init__(self, door: DoorServer) -> None:
        self._app = door.application()

    async def ask(
        self,
        method: str,
        address: str,
        body: object = None,
        *,
        role: str = "manager",
        chunks: Iterable[bytes] | None = None,
        gone: asyncio.Event | None = None,
        length: bool = True,
    ) -> Answered:
        """Send a request. chunks: its body as it comes. gone: set when the connection ends. length: is told."""
        sent = list(chunks or [json.dumps(body).encode() if body is not None else b""])
        path, _, query = address.partition("?")
        headers = [(b"authorization", f"Bearer {TOKENS.get(role, role)}".encode())] if role else []
        if length:
            headers.append((b"content-length", str(sum(map(len, sent))).encode()))
        scope = {
            "type": "http", "method": method, "path": path, "query_string": query.encode(), "headers": headers,
            "http_version": "1.1", "scheme": "http", "server": ("door", 80), "client": ("program", 1),
        }  # fmt: skip
        code, kind, said = 0, "", bytearray()

        async def receive() -> dict[str, Any]:
            if sent:
                return {"type": "http.request", "body": sent.pop(0), "more_body": bool(sent)}
            await (gone or asyncio.Event()).wait()
            return {"type": "http.disconnect"}

        async def send(message: Any) -> None:
            nonlocal code, kind
            code = message.get("status", code)
            kind = dict(message.get("headers", ())).get(b"content-type", kind.encode()).decode()
            said.extend(message.get("body", b""))

        await self._app(scope, receive, send)
        return Answered(code, json.loads(said) if kind == "application/json" else said.decode())

    @asynccontextmanager
    async def link(self, address: str, *, role: str = "manager") -> AsyncIterator["Link"]:
        """Open a WebSocket, and end it."""
        path, _, query = address.partition("?")
        query = "&".join(filter(None, (query, f"token={TOKENS.get(role, role)}" if role else "")))
        link = Link()
        scope = {"type": "websocket", "path": path, "query_string": query.encode(), "headers": []}
        serving = asyncio.create_task(self._app(scope, link.receive, link.send), name="link of a program")  # type: ignore[arg-type]
        try:
            yield link
        finally:
            link.says.put_nowait({"type": "websocket.disconnect", "code": 1000})
            await serving


class Link:
    """A WebSocket. closed: code and reason with which the door has ended it."""

    def __init__(self) -> None:
        self.says: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self.says.put_nowait({"type": "websocket.connect"})
        self.receive = self.says.get
        self.got: asyncio.Queue[Any] = asyncio.Queue()
        self.reads = asyncio.Event()
        self.reads.set()
        self.closed: tuple[int, str] | None = None

    async def send(self, message: Any) -> None:
        if message["type"] == "websocket.close":
            self.closed = message["code"], message["reason"]
            self.got.put_nowait(None)
        elif message["type"] == "websocket.send":
            await self.reads.wait()
            self.got.put_nowait(json.loads(message["text"]))

    def say(self, **order: object) -> None:
        self.says.put_nowait({"type": "websocket.receive", "text": json.dumps(order)})

    async def until(self, type: str) -> list[Any]:
        """Read until news of this type come; returns them all."""
        told = []
        while (news := await self.got.get()) is not None:
            told.append(news)
            if news["type"] == type:
                break
        return told


class Stood(NamedTuple):
    programs: Programs
    door: DoorServer
    robot: Robot
    hub: MemoryHub


@asynccontextmanager
async def at_a_door(*settings: str) -> AsyncIterator[Stood]:
    """A door, and a whole robot behind it. robot: a client beside it."""
    async with MemoryHub() as hub, whole_robot(hub, *settings) as beside, Robot.on(hub.join("door")) as robot:
        robot._bus.declare_alive()
        door = DoorServer(robot, robot._bus, TOKENS)
        yield Stood(Programs(door), door, beside, hub)
