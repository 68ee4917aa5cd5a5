"""The page itself, in a real browser at a window without a robot: frames are made up, and given to it."""

import importlib.util
import json
import os
import signal
from collections.abc import AsyncIterator, Iterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any, NamedTuple

import aiohttp
import pytest

from tests.bus.places import free_endpoint
from tests.console import browser
from tests.console.browser import Page, waited
from tests.console.windows import URL, engage
from tests.random_cases import trials

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
    pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine"),
]
MOST_VIEWERS = 100
SCRIPT = [{"turn_status": "full", "parts": [{"say": "Good morning."}]}]
SENT = """
window.sent = [];
const send = WebSocket.prototype.send;
WebSocket.prototype.send = function (text) {
  const said = JSON.parse(text);
  window.sent.push(said.order?.do ?? said.do);
  if (said.order) window.ordered = said.order;
  return send.call(this, text);
};
"""


class Place(NamedTuple):
    """Address of a window, the port of a browser, and the process of the window."""

    url: str
    port: int
    process: int

    @property
    def frames(self) -> str:
        """Address of the WebSocket with frames."""
        return self.url.replace("http", "ws").replace("/?", "/frames?")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    folder = tmp_path_factory.mktemp("page")
    (folder / "script.json").write_text(json.dumps(SCRIPT))
    (folder / "browser").mkdir()
    here = ("--connect", free_endpoint(), "--port", "0", "--role", "wizard", "--script", str(folder / "script.json"))
    with engage(folder / "console", "console", *here) as window, browser.running(folder / "browser") as port:
        yield Place(waited(window, folder / "console", URL), port, window.pid)


@asynccontextmanager
async def opened(place: Place) -> AsyncIterator[Page]:
    async with browser.at_port(place.port) as running, running.page() as page:
        await page.go(place.url)
        await page.until("window.engage?.state.you && window.engage.state.nets", 60)
        yield page


async def take(page: Page, is_first: bool = False, **frame: Any) -> None:
    """Give the page a frame, as if the window had sent it."""
    told = json.dumps({"now": 1.0, **frame})
    await page.value(f"window.engage.take({told}, {str(is_first).lower()})")


def block(id: str, until: float | None = None) -> dict[str, Any]:
    return {"id": id, "since": 0.5, "until": until, "status": "", "own": False, "behaviors": [], "ties": []}


BLOCKS = "[...window.engage.state.blocks.keys()].join()"


async def test_a_net_that_is_gone_takes_no_block_with_it(place: Place) -> None:
    async with opened(place) as page:
        await take(page, sections={f"block/{id}": block(id) for id in ("a", "xxa", "b")})
        await take(page, gone=["net/xxa"])
        assert await page.value(BLOCKS) == "a,xxa,b"

        await take(page, gone=["block/xxa"])
        assert await page.value(BLOCKS) == "a,b"


async def test_blocks_of_another_window_are_not_drawn_any_more(place: Place) -> None:
    async with opened(place) as page:
        await take(page, sections={"block/old": block("old")})
        await take(page, is_first=True, sections={"block/new": block("new")})

        assert await page.value(BLOCKS) == "new"


async def test_a_panel_that_fails_stops_neither_the_others_nor_the_next_frames(place: Place) -> None:
    async with opened(place) as page:
        await page.value("void (window.engage.drawn[0].take = () => { throw new Error('broken panel'); })")
        await page.value("void (window.engage.drawn[1].tick = () => { throw new Error('broken clock'); })")
        word = {
            "actor": "robot",
            "since": 1.0,
            "words": "still here",
            "open": False,
            "settled": 10,
            "left": [],
            "state": "",
        }
        await take(page, sections={"words": [word]})
        await page.until("document.querySelector('.words').textContent.includes('still here')")
        frames = "Number(document.querySelector('.window').dataset.frames)"
        before = await page.value(frames)
        await page.until(f"{frames} > {before} + 2")

        assert [sum(what in error for error in page.errors) for what in ("broken panel", "broken clock")] == [1, 1]


async def test_who_speaks_to_whom_is_told_with_what_a_speech_into_the_turn_was_taken_for(place: Place) -> None:
    speeches = [
        {"actor": "robot", "to": ["ann"], "since": 0.1, "until": None, "taken": "", "words": ""},
        {"actor": "ann", "to": [], "since": 0.4, "until": None, "taken": "takes the floor", "words": "wait"},
        {"actor": "ben", "to": ["robot"], "since": 0.2, "until": 0.3, "taken": "", "words": ""},
    ]
    measured = {"actor": "ann", "level": "engaging", "reasons": [], "engagement": [], "mtbce": []}
    async with opened(place) as page:
        await take(page, sections={"floor": speeches, "measures/ann": measured})

        told = "document.querySelector('#floor canvas').getAttribute('aria-label')"
        await page.until(f"{told}?.includes('robot to ann, ann takes the floor: “wait”. ann is engaging.')")
        assert page.errors == []


async def test_several_are_spoken_to_and_nobody_may_interrupt(place: Place) -> None:
    async with opened(place) as page:
        await page.until("window.engage.state.scene?.above")
        people = [{"id": id, "at": [1.3, y, 1.2], "present": True, "looks": [], "points": [], "acts": [], "nods": "",
                   "speaks": False} for id, y in (("ann", 0.4), ("bob", 0.0), ("cy", -0.4))]  # fmt: skip
        scene = await page.value("window.engage.state.scene")
        await take(page, sections={"health": services(), "scene": {**scene, "people": people}})
        await page.value(SENT)
        for id in ("cy", "ann"):
            await page.value(f"document.querySelector('#wizard-to-{id}').click()")
        await page.value("document.querySelector('#wizard-who').value = 'false'")
        await page.value("document.querySelector('#wizard-tell').value = 'Mind the step.'")
        await page.value("document.querySelector('#wizard form').requestSubmit()")

        order = await page.value("window.ordered")
        assert (order["addressee"], order["interruptible"], order["interruptible_after"]) == (["ann", "cy"], False, 0)

        await take(page, sections={"scene": {**scene, "people": people[:2]}})
        assert await page.value("[...document.querySelectorAll('#wizard-to-ann:checked')].length") == 1


async def test_two_references_of_one_name_are_both_listed(place: Place) -> None:
    async with opened(place) as page:
        choice = {"fragment": "f", "reference": "r", "target": "blue", "gesture": "gaze", "phrase": "it",
                  "reliability": 0.9, "cost": 1.0, "pairs": []}  # fmt: skip
        await take(page, sections={"references": [{"number": number, **choice} for number in range(2)]})

        assert await page.value("document.querySelectorAll('.references details').length") == 2


async def test_a_key_that_is_held_sends_its_fragment_once(place: Place) -> None:
    async with opened(place) as page:
        await page.until("document.querySelectorAll('.script button').length")
        await page.value(SENT)
        await take(page, sections={"health": services()})
        await page.value("document.activeElement.blur()")
        for repeat in ("false", "true", "true", "true"):
            key = f"new KeyboardEvent('keydown', {{ key: '1', repeat: {repeat} }})"
            await page.value(f"document.dispatchEvent({key})")

        assert await page.value("window.sent.filter((each) => each === 'prepared').length") == 1


async def test_a_long_name_of_a_participant_makes_a_phone_no_wider(place: Place) -> None:
    async with opened(place) as page:
        await page.look(400, 1000)
        await page.until("document.documentElement.clientWidth === 400")
        name = "seat_" + 9 * "perception"
        there = {"name": name, "service": False, "here": True, "serves": True, "warnings": [], "facts": []}
        await take(page, sections={"health": [there]})
        await page.until("document.querySelector('.health').textContent.includes('perception')")

        await page.until("document.documentElement.scrollWidth <= 400")  # what is drawn takes its size a frame later


def services(*missing: str) -> list[dict[str, Any]]:
    names = ("generation", "realizer", "recognition", "control")
    return [{"name": name, "service": True, "here": name not in missing, "serves": True, "warnings": [], "facts": []}
            for name in names]  # fmt: skip


async def test_a_panel_whose_service_is_gone_says_in_its_heading_that_it_stands_still(place: Place) -> None:
    stale = "[...document.querySelectorAll('section.stale')].map((each) => each.id).join()"
    heading = "document.querySelector('#measures h2').textContent"
    async with opened(place) as page:
        await take(page, sections={"health": services("recognition", "control")})
        assert await page.value(stale) == "scene,above,floor,events,measures"
        assert await page.value(heading) == "Engagement as it was last: recognition is not on the bus"
        away = "document.querySelector('.away').textContent"
        assert await page.value(away) == (
            "Not on the bus: recognition (it notices no connection events), "
            "control (its body is shown as it was last)."
        )

        await take(page, sections={"health": services("control")})
        assert await page.value(f"{stale} + {heading}") == "scene,aboveEngagement"


async def test_who_finds_no_room_is_told_so_in_words_and_gets_in_when_there_is_room(place: Place) -> None:
    origin = {"Origin": place.url.rpartition("/")[0]}
    away = "document.querySelector('.away').textContent"
    async with aiohttp.ClientSession() as session, AsyncExitStack() as others:
        for _ in range(MOST_VIEWERS):
            await others.enter_async_context(session.ws_connect(place.frames, headers=origin))
        async with browser.at_port(place.port) as running, running.page() as page:
            await page.go(place.url)
            await page.until(
                f"{away}.startsWith('The window answers, but not here: 100 browsers look on already')", 60
            )
            await others.aclose()

            await page.until(
                "window.engage.state.nets && !document.querySelector('.away').textContent.includes('100')"
            )


async def test_each_order_is_taken_once_in_the_order_given_or_reported_whatever_becomes_of_links(
    place: Place,
) -> None:
    model = (Path(__file__).parent / "queue_model.js").read_text()
    async with opened(place) as page:
        found = await page.value(f"({model})({20 if trials() is None else 3})")

    assert found["bad"] == 0
    assert found["done"] > 1000
    assert found["reported"] > 20


async def test_what_cannot_work_is_disabled_and_says_why_and_does_nothing(place: Place) -> None:
    stop = "document.querySelector('#wizard .stop')"
    async with opened(place) as page:
        await take(page, sections={"health": services("realizer")})
        assert await page.value(f"{stop}.getAttribute('aria-disabled')") == "true"
        assert await page.value(f"{stop}.getAttribute('aria-description')") == "realizer is not on the bus"
        assert "realizer is not on the bus" in await page.value("document.querySelector('#wizard').innerText")
        await page.value(SENT)
        await page.value(f"{stop}.click()")
        assert "steer" not in await page.value("window.sent")
        assert "Stop cannot work now" in await page.value("document.querySelector('#wizard .told').textContent")

        await take(page, sections={"health": services()})
        await page.value(f"{stop}.click()")
        assert "steer" in await page.value("window.sent")


HASTY = """
window.links = [];
const Link = WebSocket;
WebSocket = class extends Link { constructor(...given) { super(...given); window.links.push(this); } };
const each = setInterval;
setInterval = (act, after) => each(() => { for (let left = window.hasty ? 20 : 1; left; left -= 1) act(); }, after);
"""
"""Counts links; in haste each timer goes twenty times as quickly as it says."""


async def test_a_link_that_has_died_without_a_word_is_given_up_for_another(place: Place) -> None:
    """As of a computer that has changed its network: nothing comes any more, and nobody closes anything."""
    frames = "window.links.filter((each) => each.url.includes('/frames'))"
    async with browser.at_port(place.port) as running, running.page() as page:
        await page.call("Page.addScriptToEvaluateOnNewDocument", source=HASTY)
        await page.go(place.url)
        await page.until("window.engage?.state.you && window.engage.state.nets", 60)
        os.kill(place.process, signal.SIGSTOP)
        try:
            await page.value("window.hasty = true")
            await page.until(f"{frames}.length > 1")
            assert "does not answer" in await page.value("document.querySelector('.away').textContent")
        finally:
            await page.value("window.hasty = false")
            os.kill(place.process, signal.SIGCONT)

        await page.until("!document.querySelector('.away').textContent.includes('does not answer')")
        await page.until(f"{frames}.filter((each) => each.readyState === WebSocket.OPEN).length === 1")
