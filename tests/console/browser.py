"""A headless Chromium, driven over its debugging protocol: pages to look at, to click in, and to take pictures of."""

import asyncio
import base64
import json
import os
import re
import shutil
import subprocess
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import Any

import aiohttp

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
"""Path of the browser; None: this machine has none."""
FLAGS = (
    "--headless=new", "--no-sandbox", "--remote-debugging-port=0", "--no-first-run", "--disable-dev-shm-usage",
    "--hide-scrollbars", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--mute-audio",
)  # fmt: skip


class Page:
    """One page. requests: addresses that it has asked for. errors: what its console has complained of."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self._numbers = count(1)
        self._answers: dict[int, asyncio.Future[Any]] = {}
        self.requests: list[str] = []
        self.errors: list[str] = []

    async def listen(self) -> None:
        """Take what the browser says, until the tab is closed."""
        async for message in self._socket:
            told = json.loads(message.data)
            if (waiting := self._answers.pop(told.get("id", 0), None)) is not None and not waiting.done():
                waiting.set_result(told)
            match told.get("method"):
                case "Network.requestWillBeSent":
                    self.requests.append(told["params"]["request"]["url"])
                case "Network.webSocketCreated":
                    self.requests.append(told["params"]["url"])
                case "Runtime.exceptionThrown":
                    self.errors.append(str(told["params"]["exceptionDetails"].get("exception", told))[:600])
                case "Runtime.consoleAPICalled" if told["params"]["type"] == "error":
                    self.errors.append(str(told["params"]["args"])[:600])

    async def call(self, method: str, patience: float = 30.0, **params: Any) -> dict[str, Any]:
        """Call a method of the protocol; returns its result. Raises RuntimeError where the browser refuses."""
        number = next(self._numbers)
        self._answers[number] = answer = asyncio.get_running_loop().create_future()
        await self._socket.send_json({"id": number, "method": method, "params": params})
        async with asyncio.timeout(patience):
            told = await answer
        if "error" in told:
            raise RuntimeError(f"{method}: {told['error']}")
        result: dict[str, Any] = told["result"]
        return result

    async def go(self, url: str) -> None:
        """Load a page, and wait for nothing."""
        await self.call("Page.navigate", url=url)

    async def value(self, script: str, patience: float = 30.0) -> Any:
        """The value of a JavaScript expression; a promise is awaited."""
        asked = {"expression": script, "returnByValue": True, "awaitPromise": True}
        result = await self.call("Runtime.evaluate", patience, **asked)
        if "exceptionDetails" in result:
            raise RuntimeError(f"{script}: {result['exceptionDetails']}")
        return result["result"].get("value")

    async def until(self, script: str, seconds: float = 20.0) -> Any:
        """Wait until a JavaScript expression is true; returns its value. Raises TimeoutError, with the expression."""
        looking = (
            "new Promise((done) => { const look = () => { let is; try { is = (%s); } catch { is = null; } "
            "if (is) done(is); else setTimeout(look, 40); }; look(); })"
        )
        try:
            async with asyncio.timeout(seconds):
                while True:
                    with suppress(RuntimeError):  # the page went away beneath it
                        return await self.value(looking % script, seconds)
        except TimeoutError as error:
            raise TimeoutError(f"not within {seconds} s: {script}; errors: {self.errors}") from error

    async def look(self, width: int, height: int, *, dark: bool = False, calm: bool = False) -> None:
        """Take the size of a screen, and its colours. calm: nothing moves by itself; the stage is drawn finely."""
        await self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        motion = {"name": "prefers-reduced-motion", "value": "reduce" if calm else ""}
        await self.call("Emulation.setEmulatedMedia", features=[scheme, motion])

    async def picture(self, *, whole: bool = True, scale: float = 1.0) -> bytes:
        """A PNG of the page as it is. whole: also what one has to scroll to. scale: below 1: smaller."""
        more: dict[str, Any] = {}
        if scale != 1.0:
            width, height = await self.value("[innerWidth, innerHeight]")
            more = {"clip": {"x": 0, "y": 0, "width": width, "height": height, "scale": scale}}
        shot = await self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole, **more)
        return base64.b64decode(shot["data"])


class Browser:
    """A running browser, whose debugging protocol is at a port."""

    def __init__(self, session: aiohttp.ClientSession, port: int) -> None:
        self._session = session
        self._port = port

    @asynccontextmanager
    async def page(self, *, tab: bool = False) -> AsyncIterator[Page]:
        """An empty page in a window of its own, while the body of `async with` runs: hidden tabs draw nothing.

        tab: in the window of the page that was made last, which is hidden from then on, as by a hand.
        """
        async with self._session.get(f"http://127.0.0.1:{self._port}/json/version") as answer:
            whole = (await answer.json())["webSocketDebuggerUrl"]
        async with self._session.ws_connect(whole) as socket:
            asked = {"url": "about:blank", "newWindow": not tab}
            await socket.send_json({"id": 1, "method": "Target.createTarget", "params": asked})
            target = (await socket.receive_json(timeout=30))["result"]["targetId"]
        place = f"http://127.0.0.1:{self._port}/devtools/page/{target}"
        async with self._session.ws_connect(place, max_msg_size=2**28) as socket:
            page = Page(socket)
            listening = asyncio.create_task(page.listen())
            for domain in ("Page", "Runtime", "Network"):
                await page.call(f"{domain}.enable")
            try:
                yield page
            finally:
                with suppress(Exception):
                    await page.call("Page.close", 5)
                listening.cancel()
                await asyncio.wait([listening])


def sound_process(profile: Path) -> int:
    """Id of the process that has the sound devices of the browser with this profile. Raises LookupError: none has."""
    for told in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            line = told.read_bytes()
            if b"--utility-sub-type=audio.mojom.AudioService" in line and os.fsencode(profile) in line:
                return int(told.parent.name)
    raise LookupError("the browser has no process for sound")


@asynccontextmanager
async def at_port(port: int) -> AsyncIterator[Browser]:
    """The browser that runs already, with its protocol at this port."""
    async with aiohttp.ClientSession() as session:
        yield Browser(session, port)


@contextmanager
def running(folder: Path, *flags: str) -> Iterator[int]:
    """A browser with a profile in `folder`, while the body of `with` runs. Gives the port of its protocol.

    flags: more than it has in all tests.
    """
    assert CHROMIUM is not None
    told = folder / "told"
    with told.open("wb") as log:
        process = subprocess.Popen(
            (CHROMIUM, *FLAGS, *flags, f"--user-data-dir={folder / 'profile'}", "about:blank"),
            stdout=subprocess.DEVNULL, stderr=log,
        )  # fmt: skip
    try:
        yield int(waited(process, told, rb"DevTools listening on ws://[^:]+:(\d+)/"))
    finally:
        process.terminate()
        process.wait()


def waited(process: "subprocess.Popen[bytes]", told: Path, pattern: bytes, patience: float = 60.0) -> str:
    """The group of a pattern in a file that a process writes, as soon as it is there."""
    until = time.monotonic() + patience
    while (found := re.search(pattern, told.read_bytes())) is None:
        ended = process.poll()
        assert ended is None, f"ended with {ended}: {told.read_text()}"
        assert time.monotonic() < until, f"without {pattern!r} after {patience} s: {told.read_text()}"
        with suppress(subprocess.TimeoutExpired):
            process.wait(0.05)
    return found[1].decode()
