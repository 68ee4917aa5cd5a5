"""The stage in a real browser: what a visitor is told of what works, and of what has gone."""

import asyncio
import importlib.util
import json
import signal
from pathlib import Path

import pytest

from engage_hri import connect
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.console.web.seats import TASK
from engage_hri.services.console.web.sessions import RELOADED
from engage_hri.services.perception.hearing.config import HearingConfig
from engage_hri.services.runtime.service import tell_settings
from tests.console import browser
from tests.console.browser import waited
from tests.console.test_stage import LATER, OUTSIDE, PERSON, STAGE, Place, needs_browser, opened, press, sit
from tests.console.test_stage import place as place
from tests.console.windows import engage

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
]
PASSES = "new Promise((done) => setTimeout(done, %d))"
"""Let time pass in the page, in milliseconds."""


@needs_browser
async def test_a_page_that_takes_long_to_load_anew_has_its_seat_again_or_says_that_it_is_lost(place: Place) -> None:
    """The 3D library alone, a megabyte, takes longer than a page that goes has to come back."""
    slow = {"offline": False, "latency": 20, "downloadThroughput": 60_000, "uploadThroughput": 60_000}
    async with opened(place) as page:
        await sit(page)
        person = await page.value(PERSON)
        await page.call("Network.setCacheDisabled", cacheDisabled=True)
        await page.call("Network.emulateNetworkConditions", **slow)
        began = asyncio.get_running_loop().time()
        await page.call("Page.reload")
        await page.until("window.stage && window.stage.state.talk", 90)
        assert asyncio.get_running_loop().time() - began > RELOADED + 1.0
        assert await page.value(PERSON) == person

        await page.call("Network.emulateNetworkConditions", **slow | {"downloadThroughput": -1})
        await page.go("about:blank")
        await page.value(PASSES % (1000 * (RELOADED + 1.0)))
        await page.go(place.stage)
        await page.until("document.querySelector('.hint').textContent.startsWith('You were away for a moment')")
        assert not await page.value(PERSON)


@needs_browser
async def test_a_window_that_is_shut_is_told_as_that_and_one_that_is_killed_as_a_link_that_is_lost(
    place: Place, tmp_path: Path
) -> None:
    hint = "document.querySelector('.hint').textContent"
    for how, told in ((signal.SIGINT, "The robot was switched off."), (signal.SIGKILL, "No link to the robot.")):
        folder = tmp_path / how.name
        with engage(folder, "console", "--connect", place.endpoint, "--port", "0", "--role", "wizard") as window:
            stage = waited(window, folder, STAGE)
            async with browser.at_port(place.port) as running, running.page() as page:
                await page.go(stage)
                await page.until("window.stage.state.talk")
                window.send_signal(how)
                await page.until(f"{hint}.startsWith('{told}')")
                await page.value(PASSES % 5000)  # it tries again meanwhile
                assert (await page.value(hint)).startswith(told)


@needs_browser
async def test_who_looks_at_the_pieces_is_at_the_table_and_not_elsewhere(place: Place) -> None:
    part = "import('./stage/visit.js').then(({ part }) => part(%s, %s, 'ann').level)"
    things = [{"id": "cup", "kind": "object"}, {"id": "left", "kind": "hand"}]

    def shown(level: str, *looks: str) -> str:
        scene = {"things": things, "people": [{"id": "ann", "looks": looks}]}
        return part % (json.dumps({"levels": [{"actor": "ann", "level": level, "value": 0.1}]}), json.dumps(scene))

    async with opened(place) as page:
        for level in ("disengaging", "disengaged"):
            for looks, told in ((("cup",), "occupied"), (("left",), level), ((), level), (("robot",), level)):
                assert await page.value(shown(level, *looks)) == told
        assert await page.value(shown("engaged", "cup")) == "engaged"
        assert await page.value(part % ("null", "null")) == "unknown"

        await sit(page)
        await page.value("window.stage.send({ do: 'look', target: 'table' });0")
        words = "document.querySelector('.who .level').textContent"
        await page.until(f"{words} === 'are at the table'", 60)


@needs_browser
async def test_nobody_is_told_to_press_a_microphone_that_was_just_not_to_be_had(place: Place) -> None:
    hint = "document.querySelector('.hint').textContent"
    none = "navigator.mediaDevices.getUserMedia = async () => { throw new DOMException('no', 'NotFoundError'); };"
    async with await open_hub("robot", connect=(place.endpoint,)) as hub, opened(place) as page:
        ears = hub.join("hearing", "perception")
        tell_settings(ears, "hearing", HearingConfig(recognizer="sphinx"))
        ears.declare_alive()
        await page.until("window.stage.state.talk.hears === 'words'")
        await sit(page)
        await page.value(f"{none};0")
        await press(page, ".hold")
        await page.until(f"{hint}.includes('none is plugged in')")
        await page.value(LATER % 13_000)
        await page.until(f"!{hint}.includes('none is plugged in')")
        assert await page.value(hint) == "Type what you want to say."

        await page.value("void (navigator.mediaDevices.getUserMedia = () => new Promise(() => {}))")
        await press(page, ".hold")
        await page.until(f"{hint}.includes('asks you')")
        await press(page, ".hold")
        await page.value(LATER % 13_000)
        await page.until(f"{hint} === 'Press the microphone, and talk.'")


@needs_browser
async def test_nobody_is_told_to_press_what_no_page_at_this_address_can_have(place: Place) -> None:
    hint = "document.querySelector('.hint').textContent"
    bare = "Object.defineProperty(navigator, 'mediaDevices', { value: undefined })"  # as by http from elsewhere
    async with await open_hub("robot", connect=(place.endpoint,)) as hub, browser.at_port(place.port) as running:
        ears, eyes = hub.join("hearing", "perception"), hub.join("eyes", "perception")
        tell_settings(ears, "hearing", HearingConfig(recognizer="sphinx"))
        ears.declare_alive()
        eyes.declare_alive()
        async with running.page() as page:
            await page.call("Page.addScriptToEvaluateOnNewDocument", source=bare)
            await page.go(place.stage)
            await page.until("window.stage.state.talk.hears === 'words' && window.stage.state.talk.sees")
            await sit(page)
            await page.until(f"{hint} === 'Type what you want to say.'")
            await page.value(LATER % 25_000)
            await page.until(f"{hint} === 'Touch a piece to look at it.'")
            await press(page, ".hold")
            await page.until(f"{hint}.startsWith('There is no microphone: ')")


@needs_browser
async def test_where_no_words_are_understood_a_visitor_is_told_to_type_in_both_languages(place: Place) -> None:
    hint = "document.querySelector('.hint').textContent"
    async with await open_hub("robot", connect=(place.endpoint,)) as hub, opened(place) as page:
        ears = hub.join("hearing", "perception")
        tell_settings(ears, "hearing", HearingConfig())
        ears.declare_alive()
        await sit(page)
        await page.until("window.stage.state.talk.hears === 'voices'")
        await page.value(LATER % 13_000)
        await page.until(f"{hint}.startsWith('Type your words: ')")
        assert await page.value(OUTSIDE) == []
        await press(page, ".other")
        await page.until(f"{hint}.startsWith('Schreib deine Worte auf Englisch: ')")
        assert await page.value(OUTSIDE) == []


@needs_browser
async def test_who_reads_another_language_is_told_in_which_one_the_robot_understands(place: Place) -> None:
    said = "import('./stage/words.js').then(({ texts }) => texts('%s', '%s').tips('%s', 'none')[0])"
    async with opened(place) as page:
        assert await page.value(said % ("en", "en-GB", "on")) == "Just talk: the robot hears you."
        assert "auf Englisch" in await page.value(said % ("de", "en", "on"))
        assert "auf Englisch" in await page.value(said % ("de", "en", "off"))
        assert "in German" in await page.value(said % ("en", "de-AT", "off"))


@needs_browser
async def test_the_camera_is_offered_where_the_robot_sees_and_says_why_there_is_none(place: Place) -> None:
    hint, button = "document.querySelector('.hint').textContent", "document.querySelector('.see')"
    none = "navigator.mediaDevices.getUserMedia = async () => { throw new DOMException('no', 'NotFoundError'); };"
    async with await open_hub("robot", connect=(place.endpoint,)) as hub, opened(place) as page:
        await sit(page)
        assert await page.value(f"{button}.hidden")
        hub.join("eyes", "perception").declare_alive()
        await page.until(f"!{button}.hidden")
        await page.value(f"{none};0")
        await press(page, ".see")
        await page.until(f"{hint}.startsWith('The camera is off:') && {hint}.includes('none is plugged in')")
        await press(page, ".other")
        await page.until(f"{hint}.startsWith('Die Kamera ist aus:')")
        assert await page.value(f"{button}.getAttribute('aria-pressed')") == "false"


BLIND = """void (navigator.mediaDevices.getUserMedia = async () => {
  window.asked = (window.asked ?? 0) + 1;
  const made = document.createElement('canvas');
  made.getContext('2d');
  return made.captureStream(5);
}, window.Worker = class {
  postMessage({ place }) {
    const { ends } = window;
    if (place && ends !== null) setTimeout(() => this.onmessage({ data: { ended: ends } }));
  }
  addEventListener() {}
  terminate() {}
})"""
"""Let the camera of a page show nothing, and its link end with the words in `ends`, if these are not null."""


@needs_browser
async def test_nobody_is_told_to_press_a_camera_that_ended_by_itself(place: Place) -> None:
    hint = "document.querySelector('.hint').textContent"
    async with await open_hub("robot", connect=(place.endpoint,)) as hub, opened(place) as page:
        hub.join("eyes", "perception").declare_alive()
        await page.until("window.stage.state.talk.sees")
        await sit(page)
        await page.until(f"{hint} === 'Press the camera, and the robot sees where you look.'")
        await page.value(f"void (window.ends = 'models'); {BLIND}")
        await press(page, ".see")
        await page.until(f"{hint}.includes('not installed')")
        await page.value(LATER % 13_000)
        await page.until(f"!{hint}.includes('not installed')")
        assert await page.value(hint) == "Touch a piece to look at it."

        await page.value("window.stage.send({ do: 'leave' });0")  # who sits down next may have another
        await page.until(f"!{PERSON}")
        await sit(page)
        await page.until(f"{hint} === 'Press the camera, and the robot sees where you look.'")


@needs_browser
async def test_a_device_whose_link_was_away_for_long_is_on_again_by_itself_once_the_window_answers(
    place: Place,
) -> None:
    light = "document.querySelector('.see.light')"
    async with await open_hub("robot", connect=(place.endpoint,)) as hub, opened(place) as page:
        hub.join("eyes", "perception").declare_alive()
        await page.until("window.stage.state.talk.sees")
        await sit(page)
        await page.value(f"void (window.ends = ''); {BLIND}")
        await press(page, ".see")
        await page.until("window.asked === 1")
        await page.value("void (window.ends = null)")
        await press(page, ".quick:nth-of-type(2)")  # a frame comes
        await page.until(f"window.asked === 2 && {light}")


@needs_browser
async def test_a_kiosk_asks_at_once_whether_somebody_is_still_there_when_the_task_of_the_robot_is_over(
    place: Place,
) -> None:
    asks, does = "document.querySelector('.ask').open", "window.stage.state.talk.task"
    async with opened(place, "&kiosk") as page:
        async with await open_hub("robot", connect=(place.endpoint,)) as hub, connect(hub=hub, name=TASK):
            await page.until(does)
            await sit(page)
            assert not await page.value(asks)
        await page.until(f"!{does}")
        await page.until(asks, 3)
        await press(page, ".ask button")
        await page.until(f"!{asks}")
        assert await page.value(PERSON)
