"""A window by https: its page works as by http, and alone has microphone and voice if not called as this machine."""

import importlib.util
from collections.abc import Iterator
from contextlib import ExitStack
from typing import NamedTuple

import pytest

from tests.bus.places import free_endpoint
from tests.console import browser
from tests.console.browser import waited
from tests.console.tapped import press
from tests.console.windows import engage

pytest.importorskip("cryptography", reason="needs the extra `keys`")
pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
    pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine"),
]
ELSEWHERE = "robot.example"
"""A name under which the browser finds this machine, and does not know it for itself."""
URL = rb"(https?://[^\s]+)"


class Place(NamedTuple):
    """Windows of one robot by their schemes, and a browser."""

    urls: dict[str, str]
    port: int


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    folder, endpoint = tmp_path_factory.mktemp("https"), free_endpoint()
    (folder / "browser").mkdir()
    flags = (
        "--use-fake-ui-for-media-stream", "--use-fake-device-for-media-stream", "--ignore-certificate-errors",
        f"--host-resolver-rules=MAP {ELSEWHERE} 127.0.0.1",
    )  # fmt: skip
    window = ("console", "--connect", endpoint, "--port", "0", "--role", "wizard", "--called", ELSEWHERE)
    with ExitStack() as stack:
        robot = ("up", "--in-one", "--listen", endpoint, "--set", "simulation.human=none")
        up = stack.enter_context(engage(folder / "up", *robot))
        urls = {}
        for scheme, more in (("http", ()), ("https", ("--https", str(folder / "window.pem")))):
            console = stack.enter_context(engage(folder / scheme, *window, *more))
            urls[scheme] = waited(console, folder / scheme, URL).replace("127.0.0.1", ELSEWHERE)
        waited(up, folder / "up", rb"(all services are up)")
        yield Place(urls, stack.enter_context(browser.running(folder / "browser", *flags)))


@pytest.mark.parametrize("device", ["microphone", "camera"])
@pytest.mark.parametrize("scheme", ["http", "https"])
async def test_by_https_alone_a_page_from_elsewhere_has_devices(place: Place, scheme: str, device: str) -> None:
    async with browser.at_port(place.port) as running, running.page() as page:
        await page.go(place.urls[scheme])
        await page.until("window.engage?.state.you", 60)
        await page.value("window.engage.send({ do: 'sit', name: 'ann' })")
        await page.until("window.engage.state.you.person === 'ann'")
        await press(page, f"#{device}")
        if scheme == "https":
            await page.until(f"document.querySelector('#{device}.light')", 10)
        else:
            await page.until(f"document.querySelector('.{device} .why').textContent", 2)
        said = await page.value(f"document.querySelector('.{device} .why').textContent")
        address = await page.value("location.href")
        await page.value("window.engage.send({ do: 'leave' })")
        await page.until("!window.engage.state.you.person")
        errors = page.errors

    assert address.startswith(f"{scheme}://{ELSEWHERE}:")
    assert "token" not in address
    assert not errors
    assert ("browsers allow it only to https" in said) == (scheme == "http")
    assert ("--https FILE" in said) == (scheme == "http")


async def test_by_http_from_elsewhere_a_page_says_that_the_voice_needs_https(place: Place) -> None:
    async with browser.at_port(place.port) as running, running.page() as page:
        await page.go(place.urls["http"])
        await page.until("window.engage?.state.you", 60)
        await press(page, "#voice")
        await page.until("document.querySelector('.sound .why').textContent", 2)
        workshop = await page.value("document.querySelector('.sound .why').textContent")
        await page.go(place.urls["http"].partition("?")[0] + "stage")
        await page.until("window.stage?.state.talk?.state === 'ready'", 60)
        await press(page, ".loud")
        await page.until("document.querySelector('.hint').textContent.includes('https')", 5)
        stage = await page.value("document.querySelector('.hint').textContent")
        errors = page.errors

    assert workshop.startswith("The voice is not heard: browsers allow it only to https")
    assert "--https FILE" in workshop
    assert stage.endswith("Ask who looks after the robot.")
    assert not errors
