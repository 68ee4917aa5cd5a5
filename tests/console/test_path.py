"""The window below a path of nginx, by the very lines that docs/console.md shows."""

import importlib.util
import re
import shutil
import subprocess
from pathlib import Path

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


@pytest.mark.parametrize("more", ["", "proxy_set_header X-Forwarded-Prefix /robot;"])
async def test_all_that_the_page_asks_for_lies_below_the_path(tmp_path: Path, more: str) -> None:
    found = re.search(r"```nginx\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert found is not None
    own = int(free_endpoint().rpartition(":")[2])
    (tmp_path / "browser").mkdir()
    with engage(tmp_path / "console", "console", "--connect", free_endpoint(), "--port", "0") as window:
        port = waited(window, tmp_path / "console", URL).rstrip("/").rpartition(":")[2]
        lines = found[1].replace("8137", port).replace("}", f"{more} }}")
        temporary = " ".join(
            f"{name}_temp_path {tmp_path / name};" for name in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
        )
        (tmp_path / "conf").write_text(
            f"daemon off; pid {tmp_path / 'pid'}; error_log {tmp_path / 'errors'}; events {{}} "
            f"http {{ access_log off; {temporary} server {{ listen 127.0.0.1:{own}; {lines} }} }}"
        )
        nginx = subprocess.Popen(("nginx", "-e", str(tmp_path / "errors"), "-c", str(tmp_path / "conf")))  # noqa: ASYNC220 # it returns at once
        try:
            with browser.running(tmp_path / "browser") as at:
                async with browser.at_port(at) as running, running.page() as page:
                    await page.go(f"http://127.0.0.1:{own}/robot/")
                    await page.until("window.engage?.state.you && window.engage.state.nets", 60)
                    assert [
                        each for each in page.requests if f":{own}/robot/" not in each and "data:" not in each
                    ] == []
                    assert page.errors == []
        finally:
            nginx.terminate()
            nginx.wait(10)
