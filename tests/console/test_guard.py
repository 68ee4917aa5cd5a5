"""Who is let in to the window: its own pages, by its own names, over every way there is."""

import importlib.util
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import aiohttp
import pytest

from engage_hri.services.web.guard import Guarded, Hosts, refusal
from tests.bus.places import free_endpoint
from tests.console.browser import waited
from tests.console.windows import URL, engage

LOCAL = ("127.0.0.1", "localhost", "::1")
OPEN = Hosts((*LOCAL, "robot.local"), addresses=True)
needs_window = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
]


# -- by the headers alone --------------------------------------------------------------------------------------------


def status(hosts: Hosts, host: str = "", origin: str | None = None, **how: bool) -> int:
    """The status with which a request is refused; 0: it is served."""
    headers = [(b"host", host.encode())] if host else []
    headers += [] if origin is None else [(b"origin", origin.encode())]
    refused = refusal(headers, hosts, **{"socket": False, **how})
    return refused[0] if refused else 0


@pytest.mark.parametrize(
    ("host", "locally", "openly"),
    [
        ("127.0.0.1:8137", 0, 0), ("localhost", 0, 0), ("LOCALHOST.:8137", 0, 0), ("[::1]:8137", 0, 0),
        ("192.0.2.7:8137", 400, 0), ("[2001:db8::7]:8137", 400, 0), ("robot.local:8137", 400, 0),
        ("evil.example:8137", 400, 400), ("127.0.0.1.evil.example", 400, 400), ("localhost.evil.example", 400, 400),
        ("192.0.2.7.evil.example", 400, 400), ("evil.example@127.0.0.1", 0, 0), ("[::1", 400, 400), ("", 400, 400),
        ("2130706433", 400, 400), ("0x7f.1", 400, 400),
    ],
)  # fmt: skip
def test_it_is_called_by_its_own_names_or_by_an_address_if_it_listens_to_others(
    host: str, locally: int, openly: int
) -> None:
    assert status(Hosts(LOCAL), host) == locally
    assert status(OPEN, host) == openly


@pytest.mark.parametrize(
    ("origin", "served"),
    [
        ("http://127.0.0.1:8137", True), ("https://127.0.0.1:8137", True), (None, True),
        ("http://127.0.0.1:8138", False), ("http://127.0.0.1", False), ("http://localhost:8137", False),
        ("http://evil.example", False), ("null", False), ("", False), ("http://[", False), ("file://", False),
        ("http://127.0.0.1:8137.evil.example", False),
    ],
)  # fmt: skip
def test_no_page_from_elsewhere_is_served(origin: str | None, served: bool) -> None:
    host = "127.0.0.1:8137"

    assert (status(Hosts(LOCAL), host, origin) == 0) == served
    assert (status(Hosts(LOCAL), host, origin, socket=True, programs=True) == 0) == served
    assert (status(Hosts(LOCAL), host, origin, socket=True) == 0) == (served and origin is not None)


async def test_a_link_that_the_server_has_ended_is_one_that_has_gone() -> None:
    """As uvicorn: after a frame that is too large it takes no more, before its application knows."""

    async def app(scope: Any, receive: Any, send: Any) -> None:
        with pytest.raises(OSError, match="after sending"):
            await send({"type": "websocket.send", "text": "so"})

    async def server(message: Any) -> None:
        raise RuntimeError("Unexpected ASGI message 'websocket.send', after sending 'websocket.close'.")

    own = [(b"host", b"127.0.0.1:8137"), (b"origin", b"http://127.0.0.1:8137")]
    scope = {"type": "websocket", "path": "/voice", "headers": own}
    await Guarded(app, Hosts(LOCAL))(scope, server, server)  # type: ignore[arg-type]


def test_of_two_headers_none_is_overlooked() -> None:
    one, other = b"127.0.0.1:8137", b"evil.example"
    own, elsewhere = b"http://127.0.0.1:8137", b"http://evil.example"

    assert refusal([(b"host", one), (b"host", other)], Hosts(LOCAL), socket=False) is not None
    assert refusal([(b"host", one), (b"origin", own), (b"origin", elsewhere)], Hosts(LOCAL), socket=True) is not None


# -- a window --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=["127.0.0.1", "0.0.0.0"])
def home(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Iterator[str]:
    """Address of a window without a robot. It ends without a word of a bug."""
    folder = tmp_path_factory.mktemp("guarded")
    here = ("--connect", free_endpoint(), "--host", request.param, "--port", "0")
    with engage(folder / "console", "console", *here, "--called", "Robot.Example") as window:
        yield waited(window, folder / "console", URL)
    assert "Traceback" not in (folder / "console").read_text()


WAYS = ("frames", "messages")


class TestWindow:
    """A window that runs."""

    pytestmark = needs_window

    @pytest.mark.parametrize("way", WAYS)
    @pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1"])
    async def test_a_page_from_elsewhere_opens_no_socket(self, home: str, way: str, origin: str) -> None:
        async with aiohttp.ClientSession() as session:
            with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                await session.ws_connect(f"{home}{way}", headers={"Origin": origin})
            assert refused.value.status == 403
            async with session.get(f"{home}{way}", headers={"Origin": origin}) as answer:
                assert answer.status == 403

    async def test_its_own_page_opens_those_of_the_page_and_a_program_the_messages(self, home: str) -> None:
        own = {"Origin": home.rstrip("/")}
        async with aiohttp.ClientSession() as session:
            for way in WAYS:
                async with session.ws_connect(f"{home}{way}", headers=own) as socket:
                    assert not socket.closed
            async with session.ws_connect(f"{home}messages") as socket:
                assert not socket.closed
            with pytest.raises(aiohttp.WSServerHandshakeError):
                await session.ws_connect(f"{home}frames")

    @pytest.mark.parametrize(("name", "expected"), [("evil.example", 400), ("robot.example", 200)])
    async def test_it_is_served_under_its_names_alone(self, home: str, name: str, expected: int) -> None:
        port = urlsplit(home).port
        named = {"Host": f"{name}:{port}"}
        async with aiohttp.ClientSession() as session, session.get(home, headers=named) as answer:
            assert answer.status == expected

    @pytest.mark.parametrize("way", ["frames", "messages"])
    async def test_a_socket_that_sends_bytes_is_closed_with_the_reason(self, home: str, way: str) -> None:
        own = {"Origin": home.rstrip("/")}
        async with aiohttp.ClientSession() as session, session.ws_connect(f"{home}{way}", headers=own) as socket:
            await socket.send_bytes(b"\x00\xff")
            while (message := await socket.receive(timeout=20)).type == aiohttp.WSMsgType.TEXT:
                pass

        assert (socket.close_code, message.extra) == (1003, "send text, not bytes")
