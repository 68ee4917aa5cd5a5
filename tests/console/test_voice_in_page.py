"""The robot's voice as a page plays it: by its samples, beside the file of the voice and the words that are told."""

import asyncio
import importlib.util
import re
import time
import wave
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from engage_hri.schemas import keys
from engage_hri.schemas.body import WordSpoken
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.client.robot import Robot
from tests.bus.places import free_endpoint
from tests.console import browser
from tests.console.browser import Page, waited
from tests.console.tapped import press, tap, tapped
from tests.console.windows import URL, engage

pytest.importorskip("espeakng_loader", reason="needs the extra `voice`")
pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
    pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine"),
]
TEXT = "Good morning. Could you hand me the blue square, please? Thank you, that is exactly the one."
Samples = NDArray[np.float64]


class Place(NamedTuple):
    """A robot that speaks, its window, and a browser. file: of the voice."""

    endpoint: str
    url: str
    port: int
    file: Path


class Word(NamedTuple):
    """A word as it was told. at: when it ends, by the clock of this machine."""

    text: str
    at: float


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    folder, endpoint = tmp_path_factory.mktemp("voice"), free_endpoint()
    (folder / "browser").mkdir()
    settings = (f"control.drivers.espeak.file={folder / 'said.wav'}", "control.drivers.espeak.device=none")
    robot = (
        "up",
        "--voice",
        "espeak",
        "--listen",
        endpoint,
        *(part for each in settings for part in ("--set", each)),
    )
    window = ("console", "--connect", endpoint, "--port", "0", "--role", "wizard")
    with engage(folder / "up", *robot) as up, engage(folder / "console", *window) as console:
        waited(up, folder / "up", rb"(all services are up)")
        with browser.running(folder / "browser") as port:
            yield Place(endpoint, waited(console, folder / "console", URL), port, folder / "said.wav")


class Listener:
    """A page that plays the voice, one who directs the robot, and the words that are told."""

    def __init__(self, page: Page, robot: Robot) -> None:
        self.page, self.robot = page, robot
        self.words: list[Word] = []
        self.told = asyncio.Event()

    async def say(self, text: str) -> None:
        await self.robot.perform({"turn_status": "full", "parts": [{"say": text}]}, timeout=10)

    async def word(self, text: str) -> None:
        """Wait until a word was told."""
        async with asyncio.timeout(20):
            while not any(word.text == text for word in self.words):
                self.told.clear()
                await self.told.wait()

    async def heard(self) -> "Recorded":
        """What the page has played, and plays for three seconds more."""
        await self.page.until(f"tapped.blocks.at(-1)[0] > {await self.page.value('tapped.blocks.at(-1)[0]')} + 66150")
        begin, samples, rate = await tapped(self.page, time.monotonic())
        return Recorded(begin, samples.astype(float), rate)


class Recorded(NamedTuple):
    """Sound with an instant. begin: of the first sample, by the clock of this machine."""

    begin: float
    samples: Samples
    rate: int

    def piece(self, since: float, until: float) -> Samples:
        """The sound between two instants; silence where there is none."""
        first, last = (round((each - self.begin) * self.rate) for each in (since, until))
        before, after = max(0, -first), max(0, last - len(self.samples))
        inner = self.samples[max(0, first) : max(0, min(last, len(self.samples)))]
        return np.concatenate([np.zeros(min(before, last - first)), inner, np.zeros(after)])[: last - first]


@asynccontextmanager
async def listening(place: Place) -> AsyncIterator[Listener]:
    async with (
        browser.at_port(place.port) as running,
        running.page() as page,
        await open_hub("robot", connect=(place.endpoint,)) as hub,
        Robot.on(hub.join("director")) as robot,
    ):
        await tap(page)
        await page.look(400, 300)  # without a graphics card a large scene holds the page up
        await page.go(place.url)
        await page.until("window.engage?.state.you && window.engage.state.health", 60)
        await press(page, "#voice")
        await page.until("document.querySelector('#voice').getAttribute('aria-pressed') === 'true'")
        await page.until("tapped.marks.length > 25")  # a second, in which it asks for the window's time
        bus, listener = hub.join("listener", "observer"), Listener(page, robot)
        with bus.subscribe(keys.SYNC_POINT) as inbox:

            async def listen() -> None:
                async for received in inbox:
                    if isinstance(received.message, WordSpoken):
                        listener.words.append(Word(received.message.word, bus.local(received.message.at)))
                        listener.told.set()

            listens = asyncio.create_task(listen())
            yield listener
            listens.cancel()
        assert not page.errors


def in_file(file: Path) -> Recorded:
    with wave.open(str(file)) as sound:
        samples = np.frombuffer(sound.readframes(sound.getnframes()), "<i2").astype(float) / 32768
        rate = sound.getframerate()
    origin = re.search(rb"second 0 is loop time ([\d.]+) s", file.read_bytes())
    assert origin is not None
    return Recorded(float(origin[1]), samples, rate)


WORD = 0.25
"""Seconds before the end of a word that are looked for."""
AROUND = 0.4
"""Seconds around it in which they are."""


def beside(truth: Recorded, heard: Recorded, end: float) -> tuple[float, float]:
    """Seconds by which the sound before an instant is heard later than it should be, and how alike it is, up to 1."""
    wanted = truth.piece(end - WORD, end)
    found = heard.piece(end - WORD - AROUND, end + AROUND)
    energy = np.sqrt(np.convolve(found**2, np.ones(len(wanted)), "valid") * np.sum(wanted**2)) + 1e-3
    likeness = np.correlate(found, wanted, "valid") / energy
    best = int(np.argmax(likeness))
    return best / heard.rate - AROUND, float(likeness[best])


async def test_each_word_sounds_in_the_page_when_it_is_told(place: Place) -> None:
    async with listening(place) as listener:
        await listener.say(TEXT)
        await listener.say(TEXT)
        heard = await listener.heard()
    truth = in_file(place.file)
    found = [beside(truth, heard, word.at) for word in listener.words]

    print(
        [
            (word.text, round(1000 * late), round(alike, 2))
            for word, (late, alike) in zip(listener.words, found, strict=True)
        ]
    )
    assert [word.text for word in listener.words] == 2 * TEXT.split()
    assert truth.rate == heard.rate
    assert max(abs(late) for late, _ in found) < 0.1
    assert min(alike for _, alike in found) > 0.9


@pytest.mark.parametrize("after", ["hand", "Thank"])
async def test_after_an_interruption_the_page_is_silent_at_the_end_of_the_same_word(place: Place, after: str) -> None:
    async with listening(place) as listener:
        saying = asyncio.create_task(listener.say(TEXT))
        await listener.word(after)
        asked = time.monotonic()
        await listener.robot.stop()
        await asyncio.wait([saying])
        heard = await listener.heard()
    truth, last = in_file(place.file), listener.words[-1]
    late, alike = beside(truth, heard, last.at)
    said = heard.piece(last.at + 0.15, last.at + 3.0)

    assert 1 <= TEXT.split().index(last.text) <= TEXT.split().index(after) + 4
    assert last.at < asked + 1.0
    assert abs(late) < 0.1
    assert alike > 0.9
    assert np.abs(said).max() < 0.001


async def test_a_page_that_mutes_the_robot_plays_nothing(place: Place) -> None:
    async with listening(place) as listener:
        await press(listener.page, "#voice")
        await listener.say("Nobody hears this here.")
        is_open = await listener.page.value("document.querySelector('#voice').getAttribute('aria-pressed')")
        is_silent = await listener.page.value("tapped.blocks.every(([, heard]) => heard.every((each) => each === 0))")

    assert is_open == "false"
    assert is_silent
