"""Orders of a page whose link is cut at random instants: each is done once, in the order given, or reported.

What was done is read from a recording of the bus and from the log of the window; the page only says what was not.
"""

import asyncio
import importlib.util
import json
import random
import re
import socket
from pathlib import Path
from urllib.parse import urlsplit

import mcap.reader
import pytest

from tests.bus.places import free_endpoint
from tests.console import browser
from tests.console.browser import waited
from tests.console.cutting import cutting
from tests.console.windows import URL, engage
from tests.random_cases import trials

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
    pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine"),
]
REPORTS = """window.reports = []; window.engage.drawn.push({ take(state, changed) {
  if (changed.has("told")) window.reports.push(...state.told.map((each) => each.text)); } });"""


GIVE = """(async (orders) => { for (const [pause, order] of orders) {
  await new Promise((done) => setTimeout(done, pause)); window.engage.send(order); } })(%s)"""
"""Gives orders, each after a pause in milliseconds."""


def order(number: int, kind: str) -> dict[str, str]:
    word = f"word-{number}"
    match kind:
        case "stop":
            return {"do": "steer", "to": "stop", "by": word}
        case "tell":
            return {"do": "tell", "text": word, "by": word}
    return {"do": "type", "text": word}


def heard(file: Path) -> list[str]:
    """Words of the visitor on the bus, in order, from the bytes of the recording alone."""
    found = []
    with file.open("rb") as stream:
        for _, _, message in mcap.reader.make_reader(stream).iter_messages():
            try:
                told = json.loads(message.data)
            except ValueError:
                continue
            if told.get("type") == "utterance" and told.get("final", True) and told.get("actor") == "ann":
                found.append(told["text"])
    return found


async def test_each_order_is_done_once_in_the_order_given_or_reported(tmp_path: Path) -> None:
    count, rng, endpoint = 100 if trials() else 1000, random.Random(7), free_endpoint()
    up = ("up", "--in-one", "--listen", endpoint, "--set", "simulation.human=none")
    console = ("console", "--connect", endpoint, "--port", "0", "--role", "wizard", "--log", str(tmp_path / "log"))
    (tmp_path / "browser").mkdir()
    file = tmp_path / "session.mcap"
    with (
        engage(tmp_path / "up", *up) as robot, engage(tmp_path / "console", *console) as window,
        browser.running(tmp_path / "browser") as port,
    ):  # fmt: skip
        waited(robot, tmp_path / "up", b"(all services are up)")
        url = waited(window, tmp_path / "console", URL)
        own = urlsplit(url).port
        assert own is not None
        with engage(tmp_path / "record", "record", str(file), "--connect", endpoint) as recorder:
            waited(recorder, tmp_path / "record", b"(recording)")
            async with (
                cutting(own, 7) as (cutter, at), browser.at_port(port) as running, running.page() as page
            ):  # fmt: skip
                await page.go(url.replace(f":{own}/", f":{at}/"))
                await page.until("window.engage?.state.you", 60)
                await page.value("window.engage.send({ do: 'sit', name: 'ann' })")
                await page.until("window.engage.state.you.person === 'ann'")
                await page.value(REPORTS)
                kinds = rng.choices(("type", "tell", "stop"), (8, 1, 1), k=count)
                cuts = asyncio.create_task(cutter.cut_at_random(2.0, 8.0))
                orders = [(1000 * rng.expovariate(12), order(number, kind)) for number, kind in enumerate(kinds)]
                await page.value(GIVE % json.dumps(orders), count)
                cuts.cancel()
                await asyncio.wait([cuts])
                cutter.is_down = cutter.is_stuck = False
                await page.until("document.querySelector('.waits').hidden && !window.engage.state.away", 60)
                await page.value("window.engage.send({ do: 'type', text: 'the end' })")
                await page.until("document.querySelector('.words').textContent.includes('the end')")
                await page.until("document.querySelector('.waits').hidden", 20)
                reports: list[str] = await page.value("window.reports")
                assert cutter.cuts

    log = re.findall(r"(word-\d+): (stop|says)", (tmp_path / "log").read_text())
    given = {f"word-{number}": kind for number, kind in enumerate(kinds)}
    done = [*(text for text in heard(file) if text != "the end"), *(word for word, _ in log)]
    kept = [text for text in reports if text.startswith(("Not done: ", "Nobody knows "))]
    not_done = [word for text in kept for word in re.findall(r"word-\d+", text)]

    assert len(done) == len(set(done)), "an order was done twice"
    missing = {word for word in given if word not in done and word not in not_done}
    assert not missing, (missing, reports)
    assert not {word for word in not_done if word in done and given[word] != "stop"}
    assert {word for word, kind in given.items() if kind == "stop"} <= set(done), "a Stop was lost"
    for kind in ("type", "tell"):
        numbers = [int(word.partition("-")[2]) for word in done if given[word] == kind]
        assert numbers == sorted(numbers)
    print(f"{count} orders, {cutter.cuts} cuts: {len(done)} done, {len(set(not_done))} reported")


async def test_a_window_that_is_started_again_with_its_token_has_its_wizard_back(tmp_path: Path) -> None:
    """Orders that it may have lost are told; those that wait are done; its page is not loaded anew."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    (tmp_path / "browser").mkdir()
    here = ("console", "--connect", free_endpoint(), "--port", str(port), "--role", "wizard")
    kept = ("--token-file", str(tmp_path / "token"), "--log", str(tmp_path / "log"))
    with browser.running(tmp_path / "browser") as at:
        async with browser.at_port(at) as running, running.page() as page:
            with engage(tmp_path / "first", *here, *kept) as window:
                url = waited(window, tmp_path / "first", URL)
                await page.go(url)
                await page.until("window.engage?.state.you && window.engage.state.nets", 60)
                await page.value("window.same = true")
            await page.value("window.engage.send({ do: 'steer', to: 'stop', by: 'kim' })")
            await page.until("document.querySelector('.waits').textContent.includes('Stop')")
            await page.until(
                "document.querySelector('#wizard .stop').ariaDescription === 'the window does not answer'"
            )
            with engage(tmp_path / "second", *here, *kept) as window:
                assert waited(window, tmp_path / "second", URL) == url
                await page.until("document.querySelector('#part .told').textContent.includes('your seat too')", 60)
                await page.until("document.querySelector('.waits').hidden")
                await page.until("!window.engage.state.you.denied?.speak && !window.engage.state.you.person")
                assert await page.value("window.same")
    assert (tmp_path / "log").read_text().count("kim: stop") == 1
    assert (tmp_path / "token").stat().st_mode & 0o077 == 0
