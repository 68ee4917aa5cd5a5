"""The window in a real browser, on a running robot. One robot, one window and one browser serve all tests here."""

import asyncio
import importlib.util
import json
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, NamedTuple

import aiohttp
import msgspec
import pytest

from engage_hri.schemas.body import RobotState
from tests.bus.places import free_endpoint
from tests.console import browser
from tests.console.browser import Page, waited
from tests.console.windows import URL, engage

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
]
needs_browser = pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine")
SCRIPT = [{"turn_status": "full", "turn_index": 3, "parts": [{"say": "Good morning to you."}]}]
NAMELESS = """
[...document.querySelectorAll(".window button, .window input, .window select, .window canvas, .window [role=img]")]
  .filter((each) => each.offsetParent || each.tagName === "svg")
  .filter((each) => !(each.textContent.trim() || each.getAttribute("aria-label") || each.labels?.length
    || each.closest("[role=img][aria-label]")))
  .map((each) => each.outerHTML.slice(0, 90))
"""
"""What a screen reader could not name."""
EXAMPLE = Path(__file__).parents[2] / "examples" / "browser"


class Place(NamedTuple):
    """Address of a window, the port of a browser (0: there is none), and the log of the window."""

    url: str
    port: int
    log: Path


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    """A robot with a table and nobody before it, a window in the role of the wizard, and a browser."""
    folder, endpoint = tmp_path_factory.mktemp("window"), free_endpoint()
    (folder / "script.json").write_text(json.dumps(SCRIPT))
    (folder / "browser").mkdir()
    up = ("up", "--in-one", "--listen", endpoint, "--set", "simulation.human=none")
    shown = (
        "console", "--connect", endpoint, "--port", "0", "--role", "wizard", "--script", str(folder / "script.json"),
        "--log", str(folder / "log"), "--pages", str(EXAMPLE),
    )  # fmt: skip
    with engage(folder / "up", *up) as robot, engage(folder / "console", *shown) as window:
        waited(robot, folder / "up", b"(all services are up)")
        url = waited(window, folder / "console", URL)
        if browser.CHROMIUM is None:
            yield Place(url, 0, folder / "log")
        else:
            with browser.running(folder / "browser") as port:
                yield Place(url, port, folder / "log")


@asynccontextmanager
async def opened(place: Place, url: str = "") -> AsyncIterator[Page]:
    """The window's page, once it shows the robot. It complains of nothing, and asks nobody else for anything."""
    url = url or place.url
    async with browser.at_port(place.port) as running, running.page() as page:
        await page.look(1280, 1400)
        await page.go(url)
        await page.until("window.engage?.state.scene?.body && window.engage.state.you", 60)
        yield page
        # A seat of which the page goes is kept for a while, and the next test would find two people.
        if not await page.value("document.querySelector('.away').textContent.includes('does not answer')"):
            await page.value("window.engage.state.you?.person && window.engage.send({ do: 'leave' });0")
            await page.until("!window.engage.state.you?.person")
        home = url.split("/")[2]
        strangers = [each for each in page.requests if not each.startswith("data:") and each.split("/")[2] != home]
        assert page.errors == []
        assert strangers == []


async def press(page: Page, text: str, within: str = "body") -> None:
    """Click the button with this text, once it can work: what it says then is what its service needs."""
    found = f"[...document.querySelectorAll('{within} button')].find((each) => each.textContent.includes('{text}'))"
    await page.until(f"{found} && {found}.getAttribute('aria-disabled') !== 'true'")
    await page.value(f"{found}.click()")


async def sit(page: Page, name: str) -> None:
    seat = "document.querySelector('#part button[type=submit]')"
    await page.value(f"document.querySelector('#your-name').value = '{name}'")
    await page.until(f"{seat}.getAttribute('aria-disabled') !== 'true'")
    await page.value(f"{seat}.click()")
    await page.until(f"window.engage.state.you.person === '{name}'")


@needs_browser
async def test_a_fragment_from_the_form_is_said_to_the_visitor_and_the_transitions_of_its_net_fire(
    place: Place,
) -> None:
    """All that is asked for here stays: a page that stands still gets the newest frame, and never those before it."""
    async with opened(place) as page:
        await sit(page, "ann")
        await page.until("window.engage.state.scene.people.some((each) => each.id === 'ann' && each.at)")
        await page.value("window.engage.send({ do: 'look', target: 'blue-square' })")
        await page.until("window.engage.state.scene.people.some((each) => each.looks?.includes('blue-square'))")
        for field, value in (("tell", "Please take"), ("target", "blue-square"), ("keep", "blue-square")):
            chosen = f"document.querySelector('#wizard-{field}')"
            await page.until(f"({chosen}.value = '{value}') && {chosen}.value === '{value}'")
        await press(page, "Ask it", "#wizard")

        await page.until("document.querySelector('.words').textContent.includes('Please take')")
        await page.until("document.querySelectorAll('.net .fired').length > 3")
        await page.until("document.querySelector('.net .over')")
        gaze = "block.behaviors.some((each) => each.type === 'gaze' && each.points.every((point) => point.measured))"
        await page.until(f"[...window.engage.state.blocks.values()].some((block) => {gaze})")
        await page.until(
            "window.engage.state.events.some((each) => each.kind === 'directed_gaze' && each.state === 'succeeded')"
        )
        await page.until("document.querySelector('.references summary')?.textContent.includes('blue-square')")
        await page.value("document.querySelector('.references summary').click()")
        await page.until("document.querySelectorAll('.references tr').length > 3")

        down = "window.engage.state.scene.body.gaze[2] < -0.3"
        await page.until(f"!({down})")  # it looks at her again
        await press(page, "Keep", "#wizard")
        await page.until(f"{down} && window.engage.state.scene.body.looks_at === 'blue-square'")
        await press(page, "Let go", "#wizard")
        await page.until(f"!({down})")


@needs_browser
async def test_a_fault_is_switched_on_and_off_and_everybody_sees_it(place: Place) -> None:
    async with opened(place) as page:
        await page.until("document.querySelector('[data-kind=slow]')")
        await press(page, "slow", ".faults")
        await page.until("document.querySelector('.switched').textContent.includes('slow 2')")
        await page.until("document.querySelector('[data-kind=slow]').getAttribute('aria-pressed') === 'true'")

        await press(page, "slow", ".faults")
        await page.until("document.querySelector('.switched').hidden")
        assert "wizard: somebody: fault on: slow" in place.log.read_text()
        assert "fault off: slow" in await page.value("document.querySelector('.notes').textContent")


@needs_browser
async def test_a_condition_of_a_study_is_begun_and_everybody_sees_it(place: Place) -> None:
    told = "document.querySelector('.switched').textContent"
    async with opened(place) as page, opened(place) as other:
        await page.until("document.querySelector('#wizard-condition').checkVisibility()")
        await page.value("document.querySelector('#wizard-by').value = 'Anna'")
        await page.value("document.querySelector('#wizard-condition').value = 'words alone'")
        await page.value("document.querySelector('#wizard-alone').click()")
        await press(page, "Begin it", ".study")
        for each in (page, other):
            await each.until(f"{told} === 'Condition of the study: words alone, speech only, set by Anna.'")
        await page.until("document.querySelector('.head .owner').textContent.includes('leaves it words alone')")

        await page.value("document.querySelector('#wizard-condition').value = ''")
        await page.value("document.querySelector('#wizard-alone').click()")
        await press(page, "Begin it", ".study")
        await other.until(f"{told} === 'Condition of the study: none, set by Anna.'")
        assert "wizard: Anna: condition: words alone, speech only" in place.log.read_text()


@needs_browser
async def test_two_visitors_in_two_windows_are_two_people(place: Place) -> None:
    async with opened(place) as one, opened(place) as other:
        await sit(one, "bob")
        await sit(other, "eve")
        both = "window.engage.state.scene.people.filter((each) => each.at && each.present).map((each) => each.id)"
        await one.until(f"{both}.includes('bob') && {both}.includes('eve')")
        await other.until(f"{both}.includes('bob') && {both}.includes('eve')")

        await other.value("document.querySelector('#your-words').value = 'Hello there'")
        await press(other, "Send", "#part")
        await one.until("document.querySelector('.words').textContent.includes('Hello there')")

        x, y = await one.value(
            "window.engage.state.scene.things.find((each) => each.id === 'green-square').at.slice(0, 2)"
        )
        await other.value(f"window.engage.send({{ do: 'move', thing: 'green-square', x: {x + 0.25}, y: {y + 0.1} }})")
        green = "window.engage.state.scene.things.find((each) => each.id === 'green-square').at[0]"
        await one.until(f"{green} > {x + 0.2}")

        await press(other, "Leave", "#part")
        await one.until(f"!{both}.includes('eve')")


@needs_browser
async def test_a_page_of_ones_own_tells_connection_events(place: Place) -> None:
    home = place.url.partition("?")[0]
    async with opened(place) as window, browser.at_port(place.port) as running, running.page() as page:
        await page.go(f"{home}pages/")
        await page.until("document.querySelector('#state').textContent === 'listening'")
        await sit(window, "joe")
        await window.value("window.engage.send({ do: 'look', target: 'robot' })")
        told = "document.querySelector('#events').textContent"
        await page.until(f"{told}.includes('joe → robot') && {told}.includes('mutual facial gaze')")


async def test_a_program_gets_the_messages_of_the_types_that_it_asks_for_as_json(place: Place) -> None:
    home = place.url.partition("?")[0]
    async with aiohttp.ClientSession() as session:
        async with session.ws_connect(f"{home}messages?only=robot_state") as socket:
            message = msgspec.json.decode(await socket.receive_str(timeout=60), type=RobotState)
            assert message.at.clock
        async with session.ws_connect(f"{home}messages?only=no_such") as socket:
            await socket.receive(timeout=60)
            assert socket.close_code == 4400


@needs_browser
async def test_a_prepared_fragment_is_said_at_a_key(place: Place) -> None:
    async with opened(place) as page:
        await sit(page, "kim")
        await page.value("document.activeElement.blur()")
        await page.value("document.dispatchEvent(new KeyboardEvent('keydown', { key: '1' }))")

        await page.until("document.querySelector('.words').textContent.includes('Good morning to you.')")


@needs_browser
async def test_without_the_token_one_only_looks_and_is_told_why(place: Place) -> None:
    elsewhere = place.url.partition("?")[0].replace("127.0.0.1", "localhost")  # which has no cookie of the window
    async with opened(place, elsewhere) as page:
        await page.until("document.querySelector('#part').textContent.includes('token')")
        await page.value("window.engage.send({ do: 'steer', to: 'stop' })")

        await page.until("document.querySelector('#wizard .told').textContent.includes('token')")
        assert await page.value("document.querySelector('#part form').hidden")


@needs_browser
async def test_the_token_is_in_the_address_at_the_first_visit_only_and_no_script_reads_it(place: Place) -> None:
    async with opened(place) as page:
        await page.until("window.engage.state.you && !window.engage.state.you.denied?.seat")
        shown, history, cookies = await page.value("[location.href, document.referrer, document.cookie]")
        assert (shown, history, cookies) == (place.url.partition("?")[0], "", "")
        assert not any("token" in each for each in page.requests[1:])
        await page.go(shown)

        await page.until("window.engage?.state.you && !window.engage.state.you.denied?.seat")


@needs_browser
async def test_no_page_from_elsewhere_shows_the_window_in_a_frame(place: Place) -> None:
    home = place.url.partition("?")[0]
    shows = f"""(() => {{ const frame = document.body.appendChild(document.createElement('iframe'));
      frame.src = '{home}'; return new Promise((done) => frame.onload = () => setTimeout(() => {{
        let is; try {{ is = !!frame.contentDocument?.querySelector('.window'); }} catch {{ is = false; }}
        done(is); }}, 1500)); }})()"""
    async with browser.at_port(place.port) as running, running.page() as page:
        await page.go(f"{home}pages/")  # of the window's own: it may
        await page.until("document.body")
        assert await page.value(shows) is True
        await page.go(f"{home.replace('127.0.0.1', 'localhost')}pages/")  # to a browser this is elsewhere
        await page.until("document.body")

        assert await page.value(shows) is False


@needs_browser
async def test_the_page_fits_every_width_in_both_colours_and_names_all_it_has(place: Place) -> None:
    async with opened(place) as page:
        for width, dark in ((400, False), (400, True), (1280, False), (1280, True), (1920, False), (1920, True)):
            await page.look(width, 1000, dark=dark)
            await page.until(f"document.body.classList.contains('body--dark') === {str(dark).lower()}")
            await page.until(f"document.documentElement.clientWidth === {width}")
            await page.until(
                f"document.documentElement.scrollWidth <= {width}"
            )  # drawings follow in their next frame

            assert len(await page.picture()) > 20_000
        assert await page.value(NAMELESS) == []


# -- without a browser ---------------------------------------------------------------------------------------------


async def test_who_does_not_draw_gets_one_frame_and_nobody_else_waits(place: Place) -> None:
    frames = place.url.replace("http", "ws").replace("/?", "/frames?")
    origin = {"Origin": place.url.rpartition("/")[0]}
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(frames, headers=origin) as slow,
        session.ws_connect(frames, headers=origin) as quick,
    ):
        for _ in range(4):
            await quick.receive_json(timeout=20)
            await quick.send_str('{"do": "drawn"}')
        first = await slow.receive_json(timeout=20)
        with pytest.raises(TimeoutError):
            await slow.receive(timeout=0.3)
        await slow.send_str('{"do": "drawn"}')
        second = await slow.receive_json(timeout=20)

    # Only what has changed; of this nothing does.
    assert {"notes", "words", "references"} <= set(first["sections"]) - set(second.get("sections", {}))
    assert second["now"] > first["now"] + 0.3


async def test_what_is_no_order_is_told_and_ends_nothing(place: Place) -> None:
    frames = place.url.replace("http", "ws").replace("/?", "/frames?")
    origin = {"Origin": place.url.rpartition("/")[0]}
    async with aiohttp.ClientSession() as session, session.ws_connect(frames, headers=origin) as socket:
        await socket.send_str("nonsense")
        for number, order in enumerate(('{"do": "look"}', '{"do": "steer", "to": "continue"}'), 1):
            await socket.send_str(f'{{"do": "order", "number": {number}, "order": {order}}}')
        told: list[dict[str, Any]] = []
        async with asyncio.timeout(20):
            while len(told) < 3:
                frame = await socket.receive_json()
                told += frame.get("told", [])
                await socket.send_str('{"do": "drawn"}')

    assert "reload the page" in told[0]["text"]
    assert "take a seat first" in told[1]["text"]
    assert "goes on: nothing is being performed" in told[2]["text"]
    assert [each["panel"] for each in told] == ["part", "part", "wizard"]


@needs_browser
async def test_a_window_whose_robot_has_gone_says_so_and_then_that_it_is_gone_itself(
    tmp_path: Path, place: Place
) -> None:
    endpoint = free_endpoint()
    up = ("up", "--in-one", "--listen", endpoint, "--set", "simulation.human=none")
    console = ("console", "--connect", endpoint, "--port", "0")
    with engage(tmp_path / "console", *console) as window, engage(tmp_path / "up", *up) as robot:
        waited(robot, tmp_path / "up", b"(all services are up)")
        url = waited(window, tmp_path / "console", URL)
        async with browser.at_port(place.port) as running, running.page() as page:
            away = "document.querySelector('.away')"
            await page.go(url)
            await page.until(f"{away}?.hidden && window.engage.state.scene?.body", 40)
            robot.terminate()
            robot.wait(30)
            await page.until(f"{away}.textContent.includes('No robot is on the bus')", 40)
            window.terminate()
            window.wait(30)
            await page.until(f"{away}.textContent.includes('does not answer')", 40)


@needs_browser
@pytest.mark.parametrize("you", [(), ("--you",)])
async def test_the_demo_shows_itself_and_takes_its_window_with_it(
    tmp_path: Path, place: Place, you: tuple[str, ...]
) -> None:
    """With a simulated person, and with the visitor in its place."""
    with engage(tmp_path / "demo", "demo", "--window", *you, BROWSER="true %s") as demo:
        url = waited(demo, tmp_path / "demo", rb"the workshop: (http://[^\s]+)")
        async with opened(place, url) as page:
            gaze = "JSON.stringify(window.engage.state.scene.body.gaze)"
            first = await page.value(gaze)
            if you:
                await sit(page, "zoe")
                await page.until("window.engage.state.nets.includes('hello')", 40)  # the task, not the transcript
            await page.until(f"{gaze} !== '{first}'", 40)
            await page.until("document.querySelector('.words').textContent.includes('tangram')", 40)
            await page.until("document.querySelectorAll('.net .fired').length", 40)
            demo.terminate()
            assert demo.wait(30) == 143
            await page.until("document.querySelector('.away').textContent.includes('does not answer')", 40)
    assert "Traceback" not in (tmp_path / "demo").read_text()
