"""The daemon of a Reachy Mini over HTTP and WebSockets: a thin shell, with `aiohttp`."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import msgspec

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.bases.linked import Link, Lost
from engage_hri.services.control.reachy_mini.messages import VERSION
from engage_hri.services.control.reachy_mini.settings import ReachyMiniSettings
from engage_hri.services.runtime.installation import extra_command

try:
    import aiohttp
except ImportError as error:  # pragma: no cover - where the extra is not installed
    raise InputRefused(
        Fault(reason="the driver reachy_mini needs aiohttp", advice=extra_command("reachy-mini"))
    ) from error

RATE = 50
"""Measurements per second that are asked for: as often as the daemon reads the motors."""
STATE = f"api/state/ws/full?frequency={RATE}"
TARGET = "api/move/ws/set_target"
PATIENCE: Seconds = 2.0
"""Seconds for one answer."""
GREETING: Seconds = 15.0
"""Seconds in which a move of the daemon's own is over: it greets as it starts."""


@asynccontextmanager
async def connected(settings: ReachyMiniSettings) -> AsyncIterator[Link]:
    """Connect to the daemon, wait until it does not move the robot by itself, and see to it that the motors are on.

    Raises Lost: it cannot be had now.
    """
    timeout = aiohttp.ClientTimeout(total=PATIENCE)
    try:
        async with aiohttp.ClientSession(settings.url.rstrip("/") + "/", timeout=timeout) as session:
            await _be_ready(session, settings)
            closing = aiohttp.ClientWSTimeout(ws_close=0.2)
            async with (
                session.ws_connect(STATE, timeout=closing) as state,
                session.ws_connect(TARGET, timeout=closing, max_msg_size=1 << 20) as targets,
            ):
                connection = _Connection(settings.url, state, targets)
                listening = asyncio.create_task(connection.listen(), name="answers of reachy mini")
                try:
                    yield connection
                finally:
                    listening.cancel()
                    await asyncio.gather(listening, return_exceptions=True)
    except (aiohttp.ClientError, OSError, TimeoutError) as error:
        raise Lost(_unreachable(settings.url, error)) from error


class _Connection:
    def __init__(
        self, url: str, state: aiohttp.ClientWebSocketResponse, targets: aiohttp.ClientWebSocketResponse
    ) -> None:
        self._url, self._state, self._targets = url, state, targets
        self._refusal = ""

    async def listen(self) -> None:
        """Read what comes back for targets: refusals, and the pings that the daemon wants answered every 20 s."""
        async for message in self._targets:
            if message.type is aiohttp.WSMsgType.TEXT:
                self._refusal = " ".join(str(message.data).split())[:200]

    async def measurement(self) -> str:
        message = await self._state.receive()
        if message.type is not aiohttp.WSMsgType.TEXT:
            raise Lost(self._closed())
        return str(message.data)

    async def command(self, text: str) -> None:
        if self._refusal:
            raise Lost(Fault(reason=f"the daemon refuses a target: {self._refusal}", advice=VERSION))
        try:
            await self._targets.send_str(text)
        except (aiohttp.ClientError, OSError) as error:  # noticed before the end of the measurements
            raise Lost(self._closed()) from error

    def _closed(self) -> Fault:
        return Fault(reason=f"the daemon at {self._url} has closed the connection", advice=_ADVICE)


_ADVICE = (
    "is it running? `reachy-mini-daemon` on the robot or with `--mockup-sim` on a desk; where it is: "
    "--set control.drivers.reachy_mini.url=http://HOST:8000"
)


def _unreachable(url: str, error: BaseException) -> Fault:
    words = "no answer" if isinstance(error, TimeoutError) else " ".join(str(error).split()) or type(error).__name__
    return Fault(reason=f"the daemon at {url} cannot be reached: {words}", advice=_ADVICE)


async def _be_ready(session: aiohttp.ClientSession, settings: ReachyMiniSettings) -> None:
    status = await _asked(session, "GET", "api/daemon/status")
    state, backend = status.get("state"), status.get("backend_status") or {}
    if state != "running" or backend.get("error"):
        why = backend.get("error") or status.get("error") or ""
        reason = f"the daemon at {settings.url} is {state}" + (f": {why}" if why else "")
        raise Lost(Fault(reason=reason, advice="is the robot switched on, and its cable in? restart the daemon"))
    async with asyncio.timeout(GREETING):
        while (await _asked(session, "POST", "api/move/set_target", {})).get("status") == "ignored":  # noqa: ASYNC110
            await asyncio.sleep(0.1)
    if settings.enable_motors and (await _asked(session, "GET", "api/motors/status")).get("mode") != "enabled":
        await _asked(session, "POST", "api/motors/set_mode/enabled")


async def _asked(session: aiohttp.ClientSession, method: str, path: str, body: object = None) -> dict[str, Any]:
    """Ask the daemon. Raises Lost: it answers with an error, or not as this driver knows it."""
    async with session.request(method, path, json=body) as answer:
        text = await answer.text()
    if answer.status >= 400:
        raise Lost(Fault(reason=f"the daemon refuses {path}: {answer.status} {text[:100]}", advice=VERSION))
    try:
        return msgspec.json.decode(text, type=dict)
    except msgspec.MsgspecError as error:
        raise Lost(Fault(reason=f"the daemon answers {path} with {text[:60]!r}", advice=VERSION)) from error
