"""The microphone of a page: what of it comes to the bus, and what the page says when nothing does."""

import asyncio
import importlib.util
import os
import random
import signal
import time
import wave
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from numpy.typing import NDArray

from engage_hri.schemas import keys
from engage_hri.schemas.perception import SoundFrame
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.zenoh.hub import open_hub
from tests.console import browser
from tests.console.browser import Page
from tests.console.cutting import Cutter
from tests.console.tapped import press
from tests.console.windows import HeardPlace, heard_place

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
    pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine"),
]
RATE = 16_000
TONES = (0.5, 1.1, 1.5, 2.4)
"""Seconds at which tones of 0.2 s begin in what the microphone hears, which is 3 s long and comes again and again."""
LENGTH = 3.0


def heard_file(path: Path) -> None:
    times = np.arange(round(LENGTH * RATE)) / RATE
    tone = 0.5 * np.sin(2 * np.pi * 440 * times)
    is_on = np.any([(begin <= times) & (times < begin + 0.2) for begin in TONES], axis=0)
    with wave.open(str(path), "wb") as file:
        file.setparams((1, 2, RATE, 0, "NONE", ""))
        file.writeframes((32767 * tone * is_on).astype("<i2").tobytes())


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[HeardPlace]:
    folder = tmp_path_factory.mktemp("microphone")
    heard_file(folder / "heard.wav")
    with heard_place(folder, folder / "heard.wav") as place:
        yield place


class Sitting:
    """Somebody who sits at a page. frames: of sound that came to the bus, with the local time of each."""

    def __init__(self, page: Page, bus: Bus) -> None:
        self.page, self.bus = page, bus
        self.frames: list[tuple[float, SoundFrame]] = []
        self.came = asyncio.Event()

    async def got(self, count: int) -> None:
        """Wait until so many frames have come."""
        async with asyncio.timeout(30):
            while len(self.frames) < count:
                self.came.clear()
                await self.came.wait()

    async def ended(self) -> None:
        """Wait for the frame that says that the microphone is off."""
        async with asyncio.timeout(5):
            while self.frames[-1][1].samples:
                self.came.clear()
                await self.came.wait()

    async def press(self) -> None:
        await press(self.page, "#microphone")

    async def says(self, part: str, seconds: float = 2.0) -> None:
        """Wait until the page says this."""
        await self.page.until(f"document.querySelector('.microphone .why').textContent.includes({part!r})", seconds)

    async def is_on(self, seconds: float = 10.0) -> None:
        await self.page.until("document.querySelector('#microphone.light')", seconds)

    @property
    async def is_off(self) -> bool:
        return bool(await self.page.value("!document.querySelector('#microphone.light')"))


@asynccontextmanager
async def sitting(place: HeardPlace, before: str = "") -> AsyncIterator[Sitting]:
    """Sit down at a page. before: a script that the page has before it loads."""
    async with (
        browser.at_port(place.port) as running,
        running.page() as page,
        await open_hub("robot", connect=(place.endpoint,)) as hub,
    ):
        await page.call("Page.addScriptToEvaluateOnNewDocument", source=before)
        await page.go(place.url)
        await page.until("window.engage?.state.you", 60)
        await page.value("window.engage.send({ do: 'sit', name: 'ann' })")
        await page.until("window.engage.state.you.person === 'ann'")
        one = Sitting(page, hub.join("hearing", "perception"))
        with one.bus.subscribe(keys.ANY_SOUND) as inbox:

            async def listen() -> None:
                async for received in inbox:
                    assert received.key == keys.sound("ann")
                    assert isinstance(received.message, SoundFrame)
                    one.frames.append((one.bus.now(), received.message))
                    one.came.set()

            listens = asyncio.create_task(listen())
            try:
                yield one
            finally:  # a seat that nobody has left is kept for a while, and the next test finds it taken
                listens.cancel()
                await page.value("window.engage.send({ do: 'leave' })")
                await page.until("!window.engage.state.you.person")


def onsets(frames: list[tuple[float, SoundFrame]], bus: Bus) -> NDArray[np.float64]:
    """Local times at which tones begin in the sound."""
    samples = np.concatenate([np.frombuffer(frame.samples, "<i2") for _, frame in frames]).astype(float)
    times = np.concatenate([bus.local(f.at) + np.arange(len(f.samples) // 2) / RATE for _, f in frames])
    levels = np.abs(samples[: len(samples) // 80 * 80].reshape(-1, 80)).max(axis=1) > 1500
    begins = np.flatnonzero(levels[1:] & ~levels[:-1]) + 1
    found = times[begins * 80]
    return found[np.insert(np.diff(found) > 0.15, 0, True)]


async def test_what_the_microphone_hears_comes_to_the_bus_with_its_instants(place: HeardPlace) -> None:
    async with sitting(place) as one:
        assert await one.is_off
        await one.press()
        await one.is_on()
        await one.got(250)
        frames = one.frames[:]
        found = onsets(frames[20:], one.bus)

    expected = np.array([turn * LENGTH + begin for turn in range(9) for begin in TONES])
    fits = [found - expected[at : at + len(found)] for at in range(len(expected) - len(found) + 1)]
    apart = min((each - np.median(each) for each in fits), key=lambda each: float(np.abs(each).max()))
    waits = [came - one.bus.local(frame.at) - 512 / RATE for came, frame in frames]
    assert len(found) >= 6
    assert np.median(np.abs(apart)) < 0.03
    assert np.abs(apart).max() < 0.2  # where the processors have much else to do sound stands still for a moment
    assert [frame.number for _, frame in frames] == list(
        range(frames[0][1].number, frames[0][1].number + len(frames))
    )
    assert min(waits) >= 0.0
    assert np.median(waits) < 0.15


BUSY = """void (window.busy = setInterval(() => {
  const until = performance.now() + 400;
  while (performance.now() < until);
}, 450))"""


async def test_a_page_that_is_busy_keeps_no_sound_back(place: HeardPlace) -> None:
    async with sitting(place) as one:
        await one.press()
        await one.is_on()
        await one.page.value(BUSY)
        await one.got(len(one.frames) + 30)
        since = len(one.frames)
        await one.got(since + 150)
        waits = [came - one.bus.local(frame.at) - 512 / RATE for came, frame in one.frames[since:]]
        await one.page.value("clearInterval(window.busy)")

    print(np.quantile(waits, (0.5, 0.75, 0.9, 1.0)).round(3))
    assert np.quantile(waits, 0.75) < 0.15


KEEP = """
const asked = navigator.mediaDevices.getUserMedia.bind(navigator.mediaDevices);
navigator.mediaDevices.getUserMedia = async (...what) => (window.stream = await asked(...what));
"""


async def test_it_is_off_at_one_press_and_the_bus_knows(place: HeardPlace) -> None:
    async with sitting(place, KEEP) as one:
        await one.press()
        await one.is_on()
        await one.got(30)
        await one.press()
        began = time.monotonic()
        await one.page.until("!document.querySelector('#microphone.light')", 1.0)
        await one.ended()

        assert one.frames[-1][0] < began + 1.0
        assert await one.page.value("stream.getTracks().every((each) => each.readyState === 'ended')")


@pytest.mark.parametrize("how", ["dispatchEvent(new Event('ended'))", "stop()"])
async def test_a_microphone_that_is_unplugged_is_told_and_off(place: HeardPlace, how: str) -> None:
    async with sitting(place, KEEP) as one:
        await one.press()
        await one.is_on()
        await one.page.value(f"stream.getAudioTracks()[0].{how}")
        await one.says("it was unplugged, or taken away")

        assert await one.is_off


async def test_a_microphone_that_gives_nothing_is_told(place: HeardPlace) -> None:
    mute = "async () => new AudioContext().createMediaStreamDestination().stream"
    async with sitting(place, f"navigator.mediaDevices.getUserMedia = {mute};") as one:
        await one.press()
        await one.says("The microphone gives no sound", 4.0)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("NotAllowedError", "did not let this page have it"),
        ("NotFoundError", "none is plugged in"),
        ("NotReadableError", "another program has it"),
    ],
)
async def test_a_refusal_is_told_and_can_be_asked_again(place: HeardPlace, name: str, words: str) -> None:
    refuse = f"navigator.mediaDevices.getUserMedia = async () => {{ throw new DOMException('no', '{name}'); }};"
    async with sitting(place, f"const plain = navigator.mediaDevices.getUserMedia; {refuse}") as one:
        await one.press()
        await one.says(words)
        assert await one.is_off
        await one.page.value("void (navigator.mediaDevices.getUserMedia = plain)")
        await one.press()
        await one.is_on()


async def test_a_question_that_nobody_answers_can_be_taken_back(place: HeardPlace) -> None:
    async with sitting(place, "navigator.mediaDevices.getUserMedia = () => new Promise(() => {});") as one:
        await one.press()
        await one.says("asks you whether")
        await one.press()

        assert await one.page.value("document.querySelector('#microphone').getAttribute('aria-pressed')") == "false"


async def test_a_page_that_is_hidden_hears_nobody_and_says_so(place: HeardPlace) -> None:
    async with sitting(place) as one:
        await one.press()
        await one.is_on()
        await one.page.value(
            "Object.defineProperty(document, 'hidden', { value: true, configurable: true });"
            "document.dispatchEvent(new Event('visibilitychange')); delete document.hidden"
        )
        await one.says("went off as this page was hidden")

        assert await one.is_off


@asynccontextmanager
async def cuttable(place: HeardPlace) -> AsyncIterator[tuple[HeardPlace, Cutter]]:
    """The same place, behind a proxy whose links are cut."""
    cutter = Cutter(urlsplit(place.url).port or 0, random.Random(1))
    async with await asyncio.start_server(cutter.serve, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        try:
            yield place._replace(url=place.url.replace(f":{urlsplit(place.url).port}", f":{port}")), cutter
        finally:
            await cutter.end()


async def test_a_link_that_breaks_for_a_moment_is_made_again_and_the_microphone_stays_on(place: HeardPlace) -> None:
    async with cuttable(place) as (behind, cutter), sitting(behind) as one:
        await one.press()
        await one.is_on()
        await one.got(30)
        cutter.is_down = True
        cutter.cut()
        await one.ended()
        await one.says("does not answer", 4.0)
        cutter.is_down = False
        count = len(one.frames)
        await one.got(count + 30)

        assert not await one.is_off
        await one.says("of your voice were lost")
        assert all(frame.samples for _, frame in one.frames[count:])


async def test_a_window_that_stands_still_is_told_and_what_was_lost(place: HeardPlace) -> None:
    async with sitting(place) as one:
        await one.press()
        await one.is_on()
        await one.got(30)
        os.kill(place.process, signal.SIGSTOP)
        try:
            await one.says("The window does not answer", 2.5)
        finally:
            os.kill(place.process, signal.SIGCONT)
        count = len(one.frames)
        await one.page.until("document.querySelector('.microphone .why').textContent === ''", 5.0)
        await one.got(count + 30)


async def test_who_leaves_the_seat_is_heard_no_more(place: HeardPlace) -> None:
    async with sitting(place) as one:
        await one.press()
        await one.is_on()
        await one.got(30)
        await one.page.value("window.engage.send({ do: 'leave' })")
        await one.page.until("!window.engage.state.you.person")
        await one.ended()

        assert await one.is_off
        await one.page.value("window.engage.send({ do: 'sit', name: 'ann' })")
        await one.page.until("window.engage.state.you.person === 'ann'")
