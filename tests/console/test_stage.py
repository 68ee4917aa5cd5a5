"""The stage in a real browser, on a running robot with nobody before it."""

import asyncio
import importlib.util
import json
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import aiohttp
import pytest

from tests.bus.places import free_endpoint
from tests.console import browser
from tests.console.browser import Page, waited
from tests.console.windows import URL, engage

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
]
needs_browser = pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine")
STAGE = rb"the stage[^:]*: (http://[^\s]+)"
PHONE = (390, 844)
TOO_SMALL = """[...document.querySelectorAll('button, input')].filter((each) => each.checkVisibility())
  .filter((each) => !each.closest('.pieces')).map((each) => [each, each.getBoundingClientRect()])
  .filter(([, box]) => box.width < 44 || box.height < 44).map(([each]) => each.className)"""
"""What is too small for a finger. Pieces lie as they lie; a touch near one means it."""
OUTSIDE = """[...document.querySelectorAll('button, input, .hint, .bubble.on, .welcome')]
  .filter((each) => each.checkVisibility() && !each.closest('.pieces'))
  .map((each) => [each, each.getBoundingClientRect()])
  .filter(([, box]) => box.left < 0 || box.top < 0 || box.right > innerWidth || box.bottom > innerHeight)
  .map(([each]) => each.className)"""
"""What one would have to scroll to."""
CUT = """(({ scene, person }, { onPage }, box) => [
  ...scene.things.filter(({ kind }) => kind === "surface")
    .flatMap(({ at, outline }) => outline.map(([x, y]) => [x, y, at[2]])),
  [scene.body.eyes[0], scene.body.eyes[1], scene.body.eyes[2] + 0.12],
  ...(person ? [] : [[-0.2, 0, 0], [0, 0.2, 0], [1.43, 0, 0], [1.25, 0.18, 0], [1.25, -0.18, 0.5]]),
].map(onPage).filter(({ x, y }) => x < 0 || x > box.width || y < 0 || y > box.bottom)
)(window.stage.state, window.stage.shown, window.stage.box)"""
"""Places of the table's edge, the robot and the free seat that the page does not show."""
HIDDEN = """(({ scene, person }, { onPage }) => {
  const things = scene.things.filter(({ kind }) => kind === "object").map(({ id, at }) => [id, at]);
  return scene.people.filter(({ id, at }) => at && id !== person).flatMap(({ at: [x, y, z] }) => {
    const [head, crown] = [[x, y, z], [x, y, z + 0.15]].map((at) => onPage(at));
    const hides = ({ x, y }) => Math.abs(x - head.x) < head.y - crown.y && y > crown.y;
    return [[scene.robot, scene.body.eyes], ...things].filter(([, at]) => hides(onPage(at))).map(([id]) => id);
  });
})(window.stage.state, window.stage.shown)"""
"""What lies on the page behind the head or the back of somebody else."""
SCROLLS = """(({ scrollHeight, scrollWidth }) => scrollY + scrollHeight - innerHeight + scrollWidth - innerWidth
)(document.documentElement)"""
LATER = """void ((by) => {
  performance.real ??= performance.now.bind(performance);
  const then = performance.now() + by;
  const since = performance.real();
  performance.now = () => then + performance.real() - since;
})(%d)"""
"""Let the page's clock jump by some milliseconds."""
SEAT = "document.querySelector('.sit')"
IS_FREE = f"!{SEAT}.getAttribute('aria-disabled')"
PERSON = "window.stage.state.person"


class Place(NamedTuple):
    """Addresses of the stage and of the workshop, the port of a browser, and where the robot's bus is."""

    stage: str
    workshop: str
    port: int
    endpoint: str

    @property
    def home(self) -> str:
        """Address of the server."""
        return self.workshop.partition("?")[0]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    folder, endpoint = tmp_path_factory.mktemp("stage"), free_endpoint()
    (folder / "browser").mkdir()
    up = ("up", "--in-one", "--listen", endpoint, "--set", "simulation.human=none")
    console = ("console", "--connect", endpoint, "--port", "0", "--role", "wizard")
    with engage(folder / "up", *up) as robot, engage(folder / "console", *console) as window:
        waited(robot, folder / "up", b"(all services are up)")
        stage, workshop = (waited(window, folder / "console", each) for each in (STAGE, URL))
        if browser.CHROMIUM is None:
            yield Place(stage, workshop, 0, endpoint)
        else:
            with browser.running(folder / "browser") as port:
                yield Place(stage, workshop, port, endpoint)


@asynccontextmanager
async def opened(place: Place, more: str = "", language: str = "en-US") -> AsyncIterator[Page]:
    """The stage on a phone, once it shows the robot. It complains of nothing, and asks nobody else for anything."""
    async with browser.at_port(place.port) as running, running.page() as page:
        await page.look(*PHONE)
        agent = await page.value("navigator.userAgent")
        await page.call("Emulation.setUserAgentOverride", userAgent=agent, acceptLanguage=language)
        await page.go(place.stage + more)
        await shows(page)
        yield page
        await page.value(
            f"{PERSON} && window.stage.send({{ do: 'leave' }});0"
        )  # the seat of a page that goes stays for a while
        await page.until(f"!{PERSON}")
        await page.value("localStorage.clear();0")  # the language that was chosen
        strangers = [each for each in page.requests if not each.startswith("data:") and "127.0.0.1" not in each]
        assert page.errors == []
        assert strangers == []


async def shows(page: Page) -> None:
    await page.until(f"window.stage?.state.scene?.body && ({IS_FREE} || {SEAT}.hidden || {PERSON})", 60)


async def mouse(page: Page, kind: str, x: float, y: float) -> None:
    """Press, move or release. No finger: of a slow page it seems to stay long, which means something else."""
    held = {"button": "left", "buttons": int(kind != "mouseReleased"), "clickCount": 1}
    await page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **held)


async def touch(page: Page, x: float, y: float, *, until: tuple[float, float] | None = None) -> None:
    """Touch a place of the page, or drag from there to another."""
    await mouse(page, "mousePressed", x, y)
    to = until or (x, y)
    for part in (0.2, 0.4, 0.6, 0.8, 1.0) if until else ():
        await mouse(page, "mouseMoved", x + (to[0] - x) * part, y + (to[1] - y) * part)
    await mouse(page, "mouseReleased", *to)


async def middle(page: Page, what: str) -> tuple[float, float]:
    """The middle of what a selector finds."""
    x, y = await page.value(
        f"(({{left, top, width, height}}) => [left + width / 2, top + height / 2])"
        f"(document.querySelector('{what}').getBoundingClientRect())"
    )
    return x, y


async def press(page: Page, what: str) -> None:
    """Touch the middle of what a selector finds."""
    await touch(page, *await middle(page, what))


async def where(page: Page, id: str) -> tuple[float, float]:
    """Where a thing is on the page, once the camera stands still."""
    await page.until("window.stage.shown.isStill")
    x, y = await page.value(
        f"(({{x, y}}) => [x, y])(window.stage.shown.onPage("
        f"window.stage.state.scene.things.find((each) => each.id === '{id}').at))"
    )
    return x, y


@asynccontextmanager
async def happens(place: Place, action: str, target: str = "") -> AsyncIterator[None]:
    """In the body somebody does something: a slow page may miss that it was done."""
    only = f"{place.home}messages?only=action_began"
    async with aiohttp.ClientSession() as session, session.ws_connect(only) as socket:
        yield
        async with asyncio.timeout(20):
            while True:
                began = await socket.receive_json()
                if (
                    began["action"] == action
                    and began["actor"] != "robot"
                    and target in began.get("targets", [target])
                ):
                    return


async def sit(page: Page) -> str:
    await page.until("window.stage.shown.isStill", 60)
    await press(page, ".sit")
    await page.until(PERSON)
    return str(await page.value(PERSON))


@needs_browser
async def test_a_visitor_sits_down_at_one_touch_looks_points_moves_talks_and_leaves(place: Place) -> None:
    own = "window.stage.state.scene.people.find((each) => each.id === window.stage.state.person)"
    said = "[...document.querySelectorAll('.bubble.you span')].map((each) => each.textContent).join('')"
    async with opened(place) as page:
        await sit(page)
        await touch(page, *await where(page, "blue-square"))
        await page.until(f"{own}.looks?.[0] === 'blue-square'")

        await press(page, ".do:nth-of-type(5)")
        await page.until("document.querySelector('.hint').textContent === 'Touch what you point at.'")
        async with happens(place, "point", "green-square"):
            await touch(page, *await where(page, "green-square"))

        before = await page.value("window.stage.state.scene.things.find((each) => each.id === 'red-square').at")
        x, y = await where(page, "red-square")
        await touch(page, x, y, until=(x + 60, y + 70))
        moved = "window.stage.state.scene.things.find((each) => each.id === 'red-square').at"
        await page.until(f"Math.hypot({moved}[0] - {before[0]}, {moved}[1] - {before[1]}) > 0.05")

        hold = await middle(page, ".hold")
        await mouse(page, "mousePressed", *hold)
        await page.until(f"{own}.speaks")
        await mouse(page, "mouseReleased", *hold)
        await page.until(f"!{own}.speaks")
        await press(page, ".quick:nth-of-type(2)")
        await page.until(f"{said}.includes('Yes.')")

        await press(page, ".do:nth-of-type(6)")
        await page.until(f"!{PERSON} && {IS_FREE}")


@needs_browser
async def test_all_that_touch_does_the_keyboard_does_and_it_leads_out_of_everything(place: Place) -> None:
    own = "window.stage.state.scene.people.find((each) => each.id === window.stage.state.person)"
    focus = "document.activeElement"

    async def key(name: str, code: int, text: str = "") -> None:
        for kind in ("keyDown", "keyUp"):
            told = {"text": text} if text and kind == "keyDown" else {}
            await page.call(
                "Input.dispatchKeyEvent", type=kind, key=name, code=name, windowsVirtualKeyCode=code, **told
            )

    async with opened(place) as page:
        await page.value(f"{SEAT}.focus()")
        await key("Enter", 13, "\r")
        await page.until(PERSON)
        await page.until(f"{focus}.tagName === 'INPUT'")  # who has just sat down may write at once
        await page.until("document.querySelector('.pieces [data-id=blue-square]')")
        await page.value("document.querySelector('.pieces [data-id=blue-square]').focus()")
        await key("Enter", 13, "\r")
        await page.until(f"{own}.looks?.[0] === 'blue-square'")
        async with happens(place, "point", "blue-square"):
            await key("p", 80, "p")
        at = "window.stage.state.scene.things.find((each) => each.id === 'blue-square').at"
        before = await page.value(at)
        for _ in range(3):  # presses that come quickly are one way of the hand
            await key("ArrowDown", 40)
        await page.until(f"Math.abs({at}[0] - {before[0]} - 0.09) < 0.02")

        seen = []
        for _ in range(30):
            await key("Tab", 9)
            seen.append(await page.value(f"{focus}.dataset.id ?? {focus}.className"))
        assert {"hold", "send", "other", "robot", "green-square", "do"} <= set(seen)
        assert seen.count("other") >= 1


@needs_browser
async def test_a_visitor_sees_words_in_their_language_and_changes_it_at_one_touch(place: Place) -> None:
    async with opened(place, language="de-AT") as page:
        words = "['.hello', '.what'].map((each) => document.querySelector(each).textContent)"
        language, hello, what = await page.value(f"[document.documentElement.lang, ...{words}]")
        assert (language, hello) == ("de", "Hallo!")
        assert what.endswith("Der Roboter schaut zurück. Er spricht Englisch.")
        await press(page, ".other")
        await page.until(
            "document.documentElement.lang === 'en' && document.querySelector('.hello').textContent === 'Hello!'"
        )
        await press(page, ".other")
        await page.until("document.documentElement.lang === 'de'")
    async with opened(place, language="fr-FR") as page:
        assert await page.value("new URL(location.href).searchParams.has('token')") is False
        same = """import('./stage/words.js').then(({ texts }) => {
          const form = (all) => Object.entries(all).map(([key, text]) => `${key} ${typeof text} ${text.length}`);
          const kinds = (all) => form(all).map((each) => (each.includes("object") ? each : each.split(" ")[0]));
          const [one, other] = [kinds(texts("en", "en")), kinds(texts("de", "en"))];
          return one.filter((each) => !other.includes(each)).concat(other.filter((each) => !one.includes(each)));
        })"""
        assert await page.value(same) == []
        german = """import('./stage/words.js').then(({ texts }) => ["en", "de"].map((name) => texts(name, "de-AT"))
          .map((all) => [all.type, all.quick[1].slice(0, 2), all.welcome.split(". ").at(-1)]))"""
        assert await page.value(german) == [
            ["Say something in German", ["Yes", "Ja."], "It speaks German."],
            ["Sag etwas", ["Ja", "Ja."], "Der Roboter schaut zurück."],
        ]
        named = """import('./stage/words.js').then(({ texts }) => ["en", "de"].map((name) => texts(name, "en"))
          .map(({ thing }) => thing("%s")))"""
        assert await page.value(named % "blue square") == ["blue square", "blaues Quadrat"]
        assert await page.value(named % "cup") == ["cup", "cup"]


@needs_browser
async def test_a_kiosk_asks_who_does_nothing_and_begins_anew_for_the_next(place: Place) -> None:
    ask = "document.querySelector('.ask')"
    async with opened(place, "&kiosk") as page:
        await sit(page)
        await page.value(LATER % 47_000)
        await page.until(f"{ask}.open")
        await press(page, ".ask button")
        await page.until(f"!{ask}.open")
        assert await page.value(PERSON)

        await page.value("void (window.isOld = true)")
        await page.value(LATER % 47_000)
        await page.until(f"{ask}.open")
        await page.value(LATER % 20_000)
        await page.until("!window.isOld && window.stage")
        await shows(page)
        assert await page.value(f"[{PERSON}, new URL(location.href).searchParams.has('kiosk')]") == ["", True]
        await page.until("!window.stage.state.scene.people.some((each) => each.at && each.present)")


@needs_browser
async def test_who_loads_the_page_anew_has_seat_and_name_again_and_a_second_tab_has_not(place: Place) -> None:
    async with opened(place) as page:
        own = await sit(page)
        await page.value("void (window.isOld = true)")

        await page.call("Page.reload")
        await page.until(f"!window.isOld && {PERSON}", 30)
        async with opened(place) as other:
            assert await other.value(PERSON) == ""
            assert await other.value("window.stage.state.scene.people.filter((each) => each.present).length") == 1
            assert await sit(other) != own
            assert await page.value(PERSON) == own

        assert await page.value("sessionStorage.length") == 0


@needs_browser
async def test_what_a_visitor_has_said_is_read_out_to_them_and_not_to_the_next(place: Place) -> None:
    read = "document.querySelector('.read').textContent"
    async with opened(place) as page:
        await sit(page)
        await press(page, ".say input")
        await page.call("Input.insertText", text="My name is Xaver.")
        await press(page, ".send")
        await page.until(f"{read}.includes(window.stage.state.text.you + ': My name is Xaver.')")
        await press(page, ".do:last-child")
        await page.until(f"!{PERSON}")
        assert await page.value(read) == ""
        async with opened(place) as other:
            await other.until("window.stage.state.talk.bubbles.some(({ words }) => words.includes('Xaver'))")
            assert await other.value(read) == ""


CLOCKS = """import('./page/timed.js').then(({ timed }) => {
  const [real, clock, rounded] = [window.WebSocket, performance.now, (seconds) => Math.round(10 * seconds) / 10];
  let [socket, here] = [null, 0];
  let stands = 0;
  window.WebSocket = class { constructor() { socket = this; } };
  performance.now = () => 1000 * here;
  const link = timed("http://nowhere/", { patience: 0, ready: () => (stands += 1), ended() {} });
  const told = %s.map(([asked, answered, now]) => {
    here = answered;
    socket.onmessage({ data: JSON.stringify({ asked, now }) });
    return rounded(link.there(1000 * here));
  });
  window.WebSocket = real;
  performance.now = clock;
  return [told, stands];
})"""
"""What a link takes the window's clock for after each answer. Its times: asked and come by the page's, and told."""


@needs_browser
async def test_a_clock_that_jumps_is_followed_at_once_and_a_slow_answer_is_no_jump(place: Place) -> None:
    quick, slow, slept, back = (1.0, 1.001, 101.0), (2.0, 2.4, 102.4), (3.0, 3.1, 163.0), (4.0, 4.1, 104.0)
    async with opened(place) as page:
        told, stands = await page.value(CLOCKS % json.dumps([quick, slow, slept, back]))
        assert told == pytest.approx([101.0, 102.4, 163.0, 104.0], abs=0.11)
        assert stands == 1


@needs_browser
async def test_what_becomes_of_who_does_nothing_and_what_a_visitor_is_told_first(place: Place) -> None:
    idle = "import('./stage/visit.js').then(({ visit }) => [5, 13, 25, 46, 61].map((idle) => visit(idle, %s).do))"
    seen = "import('./stage/visit.js').then(({ moment }) => moment(%s, 'robot', 'ann')?.text ?? '')"

    def talk(voices: Any = (), *bonds: dict[str, Any], speaker: str = "") -> str:
        bubbles = [{"actor": each, "open": each == speaker} for each in ("robot", "ann")]
        return json.dumps({"voices": voices, "bonds": bonds, "bubbles": bubbles})

    def bond(kind: str, met: bool = False, by: str = "robot", to: str = "ann") -> dict[str, Any]:
        return {"kind": kind, "met": met, "by": by, "to": to, "about": ["cup"]}

    pair, look, eyes = bond("adjacency_pair"), bond("directed_gaze"), bond("mutual_facial_gaze")
    says = [{"actor": "robot", "to": ["ann"]}]
    async with opened(place) as page:
        home, kiosk = "{seated: true, kiosk: false}", "{seated: true, kiosk: true}"
        assert await page.value(idle % home) == ["nothing", "tip", "tip", "tip", "tip"]
        assert await page.value(idle % kiosk) == ["nothing", "tip", "tip", "ask", "anew"]
        looks_on = "{seated: false, kiosk: true, touched: %s}"
        assert await page.value(idle % (looks_on % "true")) == ["nothing"] * 4 + ["anew"]
        assert await page.value(idle % (looks_on % "false")) == ["nothing"] * 5
        cases = {
            talk(): "", talk((), pair): "looking", talk(says, pair): "listen", talk(says, look): "about",
            talk((), look, pair): "looking", talk((), eyes): "meet", talk((), {**eyes, "met": True}): "mutual",
            talk([{"actor": "robot", "to": ["ben"]}], eyes): "elsewhere", talk([{"actor": "ben", "to": []}]): "",
            talk((), {**pair, "to": "ben"}): "", talk((), {**pair, "met": True}): "",
            talk((), pair, speaker="robot"): "listen", talk((), pair, speaker="ann"): "looking",
        }  # fmt: skip
        assert {case: await page.value(seen % case) for case in cases} == cases


@needs_browser
async def test_a_word_longer_than_a_phone_is_wide_stays_in_its_bubble(place: Place) -> None:
    async with opened(place) as page:
        await page.look(*PHONE)
        await sit(page)
        await page.value("document.querySelector('.say input').focus()")
        await page.call("Input.insertText", text="understand" * 8)
        await press(page, ".send")
        await page.until("document.querySelector('.bubble.you.on span')")
        wide = "(({ scrollWidth, clientWidth }) => scrollWidth - clientWidth)(document.querySelector('.bubble.you'))"
        assert await page.value(wide) == 0


@needs_browser
async def test_axe_finds_nothing_to_complain_of(place: Place) -> None:
    axe = resources.files("axe_core_python").joinpath("axe.min.js").read_text(encoding="utf-8")
    checks = """axe.run().then(({ violations, passes }) =>
      [passes.length, violations.map(({ id, nodes }) => [id, nodes[0].html])])"""
    async with opened(place) as page:
        await page.value(f"{axe};0")
        for dark in (False, True):
            await page.look(*PHONE, dark=dark)
            assert (await page.value(checks))[1] == []
        await sit(page)
        for dark in (False, True):
            await page.look(*PHONE, dark=dark)
            await page.until("window.stage.shown.isStill")
            await press(page, ".quick:nth-of-type(1)")
            await page.until("document.querySelector('.bubble.on')")
            passed, broken = await page.value(checks)
            assert broken == []
            assert passed > 15
    async with opened(place, "&kiosk") as page:
        await page.value(f"{axe};0")
        await sit(page)
        await page.value(LATER % 47_000)
        await page.until("document.querySelector('.ask').open")
        await page.value("void (performance.now = ((now) => () => now)(performance.now()))")
        assert (await page.value(checks))[1] == []


@needs_browser
async def test_it_fits_every_screen_without_scrolling(place: Place) -> None:
    sizes = (PHONE, (360, 640), (844, 390), (820, 1180), (1366, 768), (2560, 1440))
    async with opened(place) as page:
        for seated in (False, True):
            if seated:
                await sit(page)
            for width, height in sizes:
                await page.look(width, height)
                await page.until(f"innerWidth === {width} && window.stage.box.width === {width}")
                await page.value("new Promise((done) => setTimeout(done, 700))")

                assert await page.value(SCROLLS) == 0
                assert await page.value(TOO_SMALL) == []
                assert await page.value(OUTSIDE) == [], (width, height)
                await page.look(width, height, calm=True)  # the camera is at once where it goes
                await page.until("window.stage.shown.isStill")
                assert await page.value(CUT) == [], (width, height)
            await page.look(*PHONE)


# -- who may do what -----------------------------------------------------------------------------------------------


async def told(url: str, *given: dict[str, Any], origin: str) -> list[dict[str, Any]]:
    """News of these orders."""
    news: list[dict[str, Any]] = []
    async with aiohttp.ClientSession() as session, session.ws_connect(url, headers={"Origin": origin}) as socket:
        for number, order in enumerate(given, 1):
            await socket.send_json({"do": "order", "number": number, "order": order})
        async with asyncio.timeout(20):
            while len(news) < len(given):
                news += (await socket.receive_json()).get("told", [])
                await socket.send_str('{"do": "drawn"}')
    return news


async def test_who_has_the_address_of_the_stage_sits_down_and_neither_stops_nor_drives_the_robot(
    place: Place,
) -> None:
    stop, say = {"do": "steer", "to": "stop"}, {"do": "tell", "text": "Hello"}
    origin, own = place.home.rstrip("/"), place.stage.partition("?")[2]
    frames = place.home.replace("http", "ws")

    refused = await told(f"{frames}stage/frames?{own}", stop, say, origin=origin)
    assert ["the workshop has this" in each["text"] for each in refused] == [True, True]
    elsewhere = await told(f"{frames}frames?{own}", stop, origin=origin)  # the token of the stage is not the window's
    assert "lacks the token" in elsewhere[0]["text"]
    nobody = await told(f"{frames}stage/frames", {"do": "sit"}, origin=origin)
    assert "lacks the token" in nobody[0]["text"]


# -- a minute ------------------------------------------------------------------------------------------------------


@needs_browser
async def test_a_visitor_of_a_minute_on_a_phone_never_scrolls(tmp_path: Path, place: Place) -> None:
    """At a kiosk: greeted, asked, lays what is asked, talks, leaves; and the next one finds it new."""
    with engage(tmp_path / "demo", "demo", "--kiosk", BROWSER="true %s") as demo:
        url = waited(demo, tmp_path / "demo", STAGE)
        async with opened(place._replace(stage=url, workshop=url.partition("stage")[0])) as page:
            loop = asyncio.get_running_loop()
            began = loop.time()
            scrolled: list[Any] = []

            async def fine() -> None:
                scrolled.append([await page.value(SCROLLS), await page.value(OUTSIDE), await page.value(TOO_SMALL)])

            await fine()
            things = "window.stage.state.scene.things.filter((each) => each.kind === 'object')"
            laid = f"JSON.stringify({things}.map((each) => each.at))"
            new = await page.value(laid)
            await sit(page)
            robot = "[...document.querySelectorAll('.bubble.robot.on span')].map((each) => each.textContent).join('')"
            await page.until(f"{robot}.includes('Hello')", 30)
            await fine()
            looks = "each.kind === 'directed_gaze' && each.about.length"
            asked = f"window.stage.state.talk.bonds.find((each) => {looks})?.about[0]"
            piece = await page.until(asked, 60)
            await fine()
            await touch(page, *await where(page, piece))
            await fine()
            while loop.time() - began < 60:
                await press(page, ".quick:nth-of-type(2)")
                await page.value("new Promise((done) => setTimeout(done, 1500))")
                await fine()
                x, y = await where(page, piece)
                goal = await where(page, "rectangle")
                await touch(page, x, y, until=(goal[0], goal[1] - 30))
                await page.value("new Promise((done) => setTimeout(done, 1500))")
                await fine()
            await press(page, ".do:nth-of-type(6)")
            await page.until(f"!{PERSON}")
            await fine()
            assert scrolled == [[0, [], []]] * len(scrolled)
            assert await page.value("Number(document.body.dataset.frames)") > 20
            assert await page.value(laid) != new
            await page.until(f"{laid} === {json.dumps(new)} && {IS_FREE}", 40)  # it has begun anew
        demo.terminate()
        assert demo.wait(30) == 143
    assert "Traceback" not in (tmp_path / "demo").read_text()
