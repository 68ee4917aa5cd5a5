"""The window below a path of nginx, by the very lines that docs/console.md shows."""

import importlib.util
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from tests.bus.places import free_endpoint
from tests.console import browser
from tests.console.browser import waited
from tests.console.windows import URL, engage

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
    pytest.mark.skipif(shutil.which("nginx") is None, reason="there is no nginx on this machine"),
    pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine"),
]
PAGE = Path(__file__).parents[2] / "docs" / "console.md"


@contextmanager
def nginx(tmp_path: Path, lines: str) -> Iterator[int]:
    """A server of nginx with these lines. Gives its port."""
    own = int(free_endpoint().rpartition(":")[2])
    temporary = " ".join(
        f"{name}_temp_path {tmp_path / name};" for name in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    (tmp_path / "conf").write_text(
        f"daemon off; pid {tmp_path / 'pid'}; error_log {tmp_path / 'errors'}; events {{}} "
        f"http {{ access_log off; {temporary} server {{ listen 127.0.0.1:{own}; {lines} }} }}"
    )
    with subprocess.Popen(("nginx", "-e", str(tmp_path / "errors"), "-c", str(tmp_path / "conf"))) as server:
        try:
            yield own
        finally:
            server.terminate()


def documented(port: int) -> str:
    """The lines of the page, for a window at a port."""
    found = re.search(r"```nginx\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert found is not None
    return found[1].replace("8137", str(port))


@pytest.mark.parametrize("more", ["", "proxy_set_header X-Forwarded-Prefix /robot;"])
async def test_all_that_the_page_asks_for_lies_below_the_path(tmp_path: Path, more: str) -> None:
    (tmp_path / "browser").mkdir()
    with engage(tmp_path / "console", "console", "--connect", free_endpoint(), "--port", "0") as window:
        port = urlsplit(waited(window, tmp_path / "console", URL)).port
        assert port is not None
        lines = documented(port).replace("}", f"{more} }}")
        with nginx(tmp_path, lines) as own, browser.running(tmp_path / "browser") as at:
            async with browser.at_port(at) as running, running.page() as page:
                await page.go(f"http://127.0.0.1:{own}/robot/")
                await page.until("window.engage?.state.you && window.engage.state.nets", 60)
                outside = [each for each in page.requests if f":{own}/robot/" not in each and "data:" not in each]
                assert outside == []
                assert page.errors == []


async def test_an_order_for_one_robot_does_not_go_to_that_of_another_path(tmp_path: Path) -> None:
    (tmp_path / "browser").mkdir()
    log = tmp_path / "log"
    console = ("console", "--connect", free_endpoint(), "--port", "0", "--role", "wizard", "--log", str(log))
    with engage(tmp_path / "console", *console) as window:
        url = urlsplit(waited(window, tmp_path / "console", URL))
        assert url.port is not None
        lines = documented(url.port)
        cut = f"{lines} location = /robot/frames {{ return 404; }} {lines.replace('/robot/', '/other/')}"
        with nginx(tmp_path, cut) as own, browser.running(tmp_path / "browser") as at:
            async with browser.at_port(at) as running, running.page() as page:
                await page.go(f"http://127.0.0.1:{own}/robot/?{url.query}")
                await page.until("window.engage?.send", 60)
                await page.value("window.engage.send({ do: 'steer', to: 'stop', by: 'kim' })")
                await page.go(f"http://127.0.0.1:{own}/other/?{url.query}")
                await page.until("window.engage?.state.you && !window.engage.state.you.denied?.speak", 60)
                await page.value("window.engage.send({ do: 'steer', to: 'stop', by: 'lou' })")
                await page.until("document.querySelector('.waits').hidden", 20)

    assert re.findall("(kim|lou): stop", log.read_text()) == ["lou"]
