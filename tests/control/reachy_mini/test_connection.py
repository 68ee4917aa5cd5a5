"""What the driver of Reachy Mini makes of answers of a daemon: a small server of HTTP and WebSockets, on loopback."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from typing import Any

import msgspec
import pytest

pytest.importorskip("aiohttp", reason="the extra reachy-mini is not installed")

from aiohttp import WSMsgType, web

from engage_hri.services.control.bases.linked import Link, Lost
from engage_hri.services.control.reachy_mini import messages
from engage_hri.services.control.reachy_mini.connection import connected
from engage_hri.services.control.reachy_mini.settings import ReachyMiniSettings

pytestmark = pytest.mark.real_time
STATE = {
    "control_mode": "enabled", "head_pose": {"x": 0.0, "y": 0.0, "z": 0.0, "roll": 0.1, "pitch": 0.2, "yaw": 0.3},
    "body_yaw": 0.05, "antennas_position": [-0.17, 0.18], "timestamp": "2026-11-24T09:35:20Z", "passive_joints": None,
}  # fmt: skip


class Server:
    """A daemon that answers as it is told, and remembers what it was asked and told."""

    def __init__(self) -> None:
        self.status: Any = {"state": "running", "backend_status": {"error": None}, "error": None, "version": "1.12.0"}
        self.mode = "enabled"
        self.moves = 0
        """How often it still says that a move of its own is running."""
        self.answer = 200
        self.asked: list[str] = []
        self.targets: list[Any] = []
        self.refusal = ""
        self.pongs = asyncio.Event()
        self.url = ""

    def app(self) -> web.Application:
        app = web.Application()
        app.router.add_get("/api/daemon/status", self._status)
        app.router.add_post("/api/move/set_target", self._ready)
        app.router.add_get("/api/motors/status", self._motors)
        app.router.add_post("/api/motors/set_mode/enabled", self._enable)
        app.router.add_get("/api/state/ws/full", self._send)
        app.router.add_get("/api/move/ws/set_target", self._take)
        return app

    async def _json(self, told: Any) -> web.Response:
        return web.json_response(told, status=self.answer)

    async def _status(self, request: web.Request) -> web.Response:
        return web.Response(text=self.status) if isinstance(self.status, str) else await self._json(self.status)

    async def _ready(self, request: web.Request) -> web.Response:
        self.moves -= 1
        return await self._json({"status": "ok" if self.moves < 0 else "ignored", "reason": "move_running"})

    async def _motors(self, request: web.Request) -> web.Response:
        return await self._json({"mode": self.mode})

    async def _enable(self, request: web.Request) -> web.Response:
        self.mode = "enabled"
        self.asked.append("enable")
        return await self._json({"status": "enabled"})

    async def _send(self, request: web.Request) -> web.WebSocketResponse:
        self.asked.append(str(request.rel_url))
        socket = web.WebSocketResponse()
        await socket.prepare(request)
        await socket.send_str(json.dumps(STATE))
        await socket.receive()
        return socket

    async def _take(self, request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse(autoping=False)
        await socket.prepare(request)
        await socket.ping()
        async for message in socket:
            if message.type is WSMsgType.TEXT:
                self.targets.append(json.loads(message.data))
                if self.refusal:
                    await socket.send_str(self.refusal)
            elif message.type is WSMsgType.PONG:
                self.pongs.set()
        return socket


@pytest.fixture
async def server() -> AsyncIterator[Server]:
    server = Server()
    runner = web.AppRunner(server.app())
    await runner.setup()
    site = web.TCPSite(runner, "127.0.0.1", 0)
    await site.start()
    server.url = site._server.sockets[0].getsockname()[1]  # type: ignore[union-attr, assignment]
    server.url = f"http://127.0.0.1:{server.url}/"
    yield server
    await runner.cleanup()


async def test_it_reads_measurements_and_writes_targets_in_the_daemon_s_frame(server: Server):
    async with connected(ReachyMiniSettings(url=server.url)) as daemon:
        measured = messages.read(await daemon.measurement())
        await daemon.command(messages.target(measured.pose))

    assert measured.pose == pytest.approx(
        {"head_yaw": 0.3, "head_pitch": -0.2, "head_roll": -0.1, "body_yaw": 0.05, "body_lean": 0.0,
         "right_antenna": -0.17, "left_antenna": 0.18}
    )  # fmt: skip
    assert server.targets == [
        {
            "target_head_pose": pytest.approx(STATE["head_pose"]),
            "target_antennas": [-0.17, 0.18],
            "target_body_yaw": 0.05,
        }
    ]
    assert server.asked == ["/api/state/ws/full?frequency=50"]


async def test_it_answers_the_pings_of_the_daemon_without_which_that_hangs_up(server: Server):
    async with connected(ReachyMiniSettings(url=server.url)), asyncio.timeout(5.0):
        await server.pongs.wait()


async def insist(daemon: Link) -> None:
    """Send targets until that fails."""
    async with asyncio.timeout(5.0):
        while True:
            await daemon.command("{}")
            await asyncio.sleep(0)


async def test_a_target_that_is_refused_is_told_with_the_daemon_s_words(server: Server):
    server.refusal = '{"status": "error", "detail": "1 validation error"}'
    async with connected(ReachyMiniSettings(url=server.url)) as daemon:
        await daemon.measurement()
        with pytest.raises(Lost, match=r"refuses a target: .*1 validation error"):
            await insist(daemon)


async def test_it_waits_for_a_move_of_the_daemon_s_own_and_switches_the_motors_on(server: Server):
    server.moves, server.mode = 3, "disabled"
    async with connected(ReachyMiniSettings(url=server.url)):
        assert server.mode == "enabled"
        assert server.moves == -1


async def test_it_leaves_the_motors_alone_if_it_is_told_so(server: Server):
    server.mode = "disabled"
    async with connected(ReachyMiniSettings(url=server.url, enable_motors=False)):
        assert server.mode == "disabled"


def robot_gone(server: Server) -> None:
    server.status["state"] = "error"
    server.status["backend_status"]["error"] = "No response from the robot's motor for the last second."


def starting(server: Server) -> None:
    server.status |= {"state": "starting", "backend_status": None}


def another_program(server: Server) -> None:
    server.status = "<html>hello</html>"


def other_answers(server: Server) -> None:
    server.status = "[1, 2]"


def refusing(server: Server) -> None:
    server.answer = 503


@pytest.mark.parametrize(
    ("state", "told"),
    [
        (robot_gone, "is error: No response from the robot's motor"),
        (starting, "is starting"),
        (another_program, "answers api/daemon/status with '<html>"),
        (other_answers, "answers api/daemon/status with '[1, 2]'"),
        (refusing, "refuses api/daemon/status: 503"),
    ],
)
async def test_what_is_wrong_with_a_daemon_is_told_in_its_words(
    server: Server, state: Callable[[Server], None], told: str
):
    state(server)
    with pytest.raises(Lost) as lost:
        async with connected(ReachyMiniSettings(url=server.url)):
            raise AssertionError("connected")

    assert told in lost.value.fault.reason
    assert lost.value.fault.advice


@pytest.mark.parametrize(
    "text", ["", "{}", "[]", '{"head_pose": {}}', json.dumps({**STATE, "antennas_position": [1.0]})]
)
def test_what_is_no_measurement_is_refused(text: str):
    with pytest.raises(Lost, match="no measurement"):
        messages.read(text)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"url": "reachy.local:8000"}, "expected such as http://"),
        ({"pace": 2.0}, r"<= 1.0 - at `\$.pace`"),
        ({"on_target": 0.0}, r">= 0.1 - at `\$.on_target`"),
    ],
)
def test_settings_out_of_range_are_refused_with_the_range(settings: dict[str, Any], told: str):
    with pytest.raises(ValueError, match=told):
        msgspec.convert(settings, ReachyMiniSettings)
