"""A headless Chromium, driven over its debugging protocol: pages to look at, to click in, and to take pictures of."""

import asyncio
import base64
import json
import re
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
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
    """One tab. requests: addresses that it has asked for. errors: what its console has complained of."""

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

    async def look(self, width: int, height: int, *, dark: bool = False) -> None:
        """Take the size of a screen, and its colours."""
        await self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        await self.call("Emulation.setEmulatedMedia", features=[scheme])

    async def picture(self, *, whole: bool = True) -> bytes:
        """A PNG of the page as it is. whole: also what one has to scroll to."""
        shot = await self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        return base64.b64decode(shot["data"])


class Browser:
    """A running browser."""

    def __init__(self, session: aiohttp.ClientSession, port: int) -> None:
        self._session = session
        self._port = port

    @asynccontextmanager
    async def page(self) -> AsyncIterator[Page]:
        """An empty tab, while the body of `async with` runs."""
        async with self._session.put(f"http://127.0.0.1:{self._port}/json/new?about:blank") as answer:
            target = await answer.json()
        async with self._session.ws_connect(target["webSocketDebuggerUrl"], max_msg_size=2**28) as socket:
            page = Page(socket)
            listening = asyncio.create_task(page.listen())
            for domain in ("Page", "Runtime", "Network"):
                await page.call(f"{domain}.enable")
            try:
                yield page
            finally:
                with suppress(Exception):
                    await page.call("Page.close")
                listening.cancel()


@asynccontextmanager
async def chromium(folder: Path) -> AsyncIterator[Browser]:
    """Run a browser with a profile in `folder`, while the body of `async with` runs."""
    assert CHROMIUM is not None
    process = await asyncio.create_subprocess_exec(
        CHROMIUM, *FLAGS, f"--user-data-dir={folder}", "about:blank",
        stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    assert process.stderr is not None
    listening: asyncio.Task[None] | None = None
    try:
        async with asyncio.timeout(30):
            while not (
                found := re.search(rb"DevTools listening on ws://[^:]+:(\d+)/", await process.stderr.readline())
            ):
                pass
        listening = asyncio.create_task(_read_on(process.stderr))
        async with aiohttp.ClientSession() as session:
            yield Browser(session, int(found[1]))
    finally:
        if listening is not None:
            listening.cancel()
        process.terminate()
        await process.wait()


async def _read_on(stream: asyncio.StreamReader) -> None:
    """Read what the browser says, so that it is not kept waiting by a full pipe."""
    while await stream.read(2**16):
        pass
