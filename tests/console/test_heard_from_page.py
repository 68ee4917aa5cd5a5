"""From a browser's microphone to the answer: spoken phrases that Chromium hears, and what the robot makes of them.

    python -m pytest -s tests/console/test_heard_from_page.py

prints how far off the instants were. Their truth is where there is voice in the frames that the page has sent.
"""

import asyncio
import importlib.util
import json
import os
import signal
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.perception import ActionBegan, ActionEnded, SoundFrame, Utterance
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.client.robot import Robot
from tests.console import browser
from tests.console.browser import Page
from tests.console.tapped import press
from tests.console.windows import HeardPlace, heard_place
from tests.perception.echoes import loud
from tests.perception.spoken import PHRASES, placed, voice, write_wav

pytest.importorskip("pocketsphinx", reason="pip install pocketsphinx")
pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
    pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine"),
]
RATE = 16_000
EVERY = 3.0
"""Seconds from one phrase to the next in what the microphone hears."""
ASKED = {"turn_status": "full", "parts": [{"say": "Which one?"}]}
FILE = placed([(number * EVERY + 0.5, voice(text)) for number, text in enumerate(PHRASES)], len(PHRASES) * EVERY)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[HeardPlace]:
    folder = tmp_path_factory.mktemp("heard")
    robot = (
        "--voice", "espeak", "--set", "control.drivers.espeak.device=none", "--set", "hearing.recognizer=sphinx",
        "--set", f"hearing.phrases={json.dumps(PHRASES)}",
    )  # fmt: skip
    with heard_place(folder, write_wav(folder / "heard.wav", FILE), *robot) as place:
        yield place


class Talk:
    """Somebody at a page with the microphone on. told: all that came to the bus, with local times."""

    def __init__(self, page: Page, robot: Robot, bus: Any) -> None:
        self.page, self.robot, self.bus = page, robot, bus
        self.told: list[tuple[float, Any]] = []
        self.news = asyncio.Event()

    def of(self, kind: type, since: int = 0) -> list[tuple[float, Any]]:
        return [(came, each) for came, each in self.told[since:] if isinstance(each, kind)]

    async def comes(self, kind: type, patience: float, since: int) -> Any:
        """Wait for a message of a kind, later than the first `since`."""
        async with asyncio.timeout(patience):
            while not (found := self.of(kind, since)):
                self.news.clear()
                await self.news.wait()
        return found[0][1]

    async def speaks(self) -> int:
        """Wait until a long phrase has begun: the one after "I do not know". Returns how much was told before."""
        while True:
            since = len(self.told)
            if (await self.comes(Utterance, 20.0, since)).text == "i do not know":
                await self.comes(ActionBegan, 20.0, since := len(self.told))
                return since

    def heard(self, since: float, until: float) -> tuple[float, float] | None:
        """Local times from when to when there is voice in the sound between two times.

        None: the processors stood still meanwhile, and the sound with them.
        """
        frames = [each for each in self.of(SoundFrame) if since <= self.bus.local(each[1].at) < until]
        times = [self.bus.local(frame.at) for _, frame in frames]
        waits = [came - at - 512 / RATE for (came, _), at in zip(frames, times, strict=True)]
        if max(waits) > 0.2 or max(np.diff(times)) > 0.06:
            return None
        sound = np.concatenate([np.frombuffer(frame.samples, "<i2") for _, frame in frames]).astype(np.float64)
        where = np.flatnonzero(loud(sound)) / RATE
        return float(times[0] + where[0]), float(times[0] + where[-1])


@asynccontextmanager
async def talking(place: HeardPlace) -> AsyncIterator[Talk]:
    async with (
        browser.at_port(place.port) as running,
        running.page() as page,
        await open_hub("robot", connect=(place.endpoint,)) as hub,
        Robot.on(hub.join("program")) as robot,
    ):
        await page.go(place.url)
        await page.until("window.engage?.state.you", 60)
        await page.value("window.engage.send({ do: 'sit', name: 'ann' })")
        await page.until("window.engage.state.you.person === 'ann'")
        talk = Talk(page, robot, hub.join("judge", "perception"))
        patterns = (keys.ANY_SOUND, keys.PERCEIVED_ACTION, keys.UTTERANCE, keys.fault("hearing"))
        with talk.bus.subscribe(*patterns) as inbox:

            async def listen() -> None:
                async for received in inbox:
                    message = received.message
                    if (
                        isinstance(message, SoundFrame | Utterance | Fault)
                        or getattr(message, "action", "") == "speak"
                    ):
                        talk.told.append((talk.bus.now(), message))
                        talk.news.set()

            listens = asyncio.create_task(listen())
            await press(page, "#microphone")
            await page.until("document.querySelector('#microphone.light')", 10)
            await talk.comes(SoundFrame, 10.0, 0)
            yield talk
            listens.cancel()
        await page.value("window.engage.send({ do: 'leave' })")
        await page.until("!window.engage.state.you.person")


async def test_voices_have_their_instants_and_words(place: HeardPlace) -> None:
    async with talking(place) as talk:
        async with asyncio.timeout(3 * len(PHRASES) * EVERY):
            while sum(each.final for _, each in talk.of(Utterance)) <= len(PHRASES):
                talk.news.clear()
                await talk.news.wait()
        onsets, known, ends = [], [], []
        for (came, began), (_, ended) in zip(talk.of(ActionBegan), talk.of(ActionEnded), strict=False):
            since, until = talk.bus.local(began.at), talk.bus.local(ended.at)
            if (truth := talk.heard(since - 0.4, until + 0.4)) is None:
                continue
            onsets.append(since - truth[0])
            known.append(came - truth[0])
            ends.append(until - truth[1])
        words = [PHRASES.index(each.text) for _, each in talk.of(Utterance) if each.final and each.text in PHRASES]
        right = [(one + 1) % len(PHRASES) == other for one, other in pairwise(words)]

        waits = [came - talk.bus.local(each.at) - 512 / RATE for came, each in talk.of(SoundFrame) if each.samples]

    told = {"onset": onsets, "known": known, "end": ends, "way": waits}
    print(
        {
            name: [round(float(value), 3) for value in np.quantile(np.abs(each), (0.5, 1))]
            for name, each in told.items()
        }
    )
    print(f"{sum(right) + 1} of {len(words)} phrases right, {len(onsets)} measured")
    assert len(words) >= len(PHRASES) - 1
    assert onsets
    assert np.median(np.abs(onsets)) < 0.04
    assert np.median(known) < (0.15 if np.median(waits) < 0.05 else 0.5)  # processors with much to do keep it back
    assert np.median(np.abs(ends)) < 0.08
    assert sum(right) >= 0.7 * len(right)  # a piece of sound is missing where the processors stand still


async def test_the_pair_is_answered_by_who_sits_there_with_the_words(place: HeardPlace) -> None:
    async with talking(place) as talk:
        words = []
        for _ in range(3):
            outcome = await talk.robot.perform(ASKED, await_answer=True)
            [answered] = [event for event in outcome.events if event.kind == "adjacency_pair"]
            words.append(answered.words)
            assert answered.responder == "ann"
        print(words)
        assert {*words} <= {*PHRASES, ""}  # none fits where sound is missing, as the processors stand still
        assert any(words)


async def test_a_window_that_stands_still_ends_the_speech_and_is_told(place: HeardPlace) -> None:
    async with talking(place) as talk:
        since = await talk.speaks()
        os.kill(place.process, signal.SIGSTOP)
        try:
            fault = await talk.comes(Fault, 2.0, since)
            assert fault.reason == "no sound comes any more from the microphone of ann"
            assert talk.of(ActionEnded, since)
        finally:
            os.kill(place.process, signal.SIGCONT)


@pytest.mark.parametrize(
    "how",
    [
        "document.querySelector('#microphone').click()",
        "Object.defineProperty(document, 'hidden', { value: true, configurable: true });"
        "document.dispatchEvent(new Event('visibilitychange')); delete document.hidden",
    ],
)
async def test_a_microphone_that_goes_off_ends_the_speech_at_once(place: HeardPlace, how: str) -> None:
    async with talking(place) as talk:
        since = await talk.speaks()
        await talk.page.value(how)
        await talk.comes(ActionEnded, 1.0, since)
        assert talk.of(Fault, since) == []


async def test_a_microphone_that_is_unplugged_ends_the_speech_is_told_in_words_and_can_be_on_again(
    place: HeardPlace,
) -> None:
    """The browser's process for sound is killed: that is what a page sees of a device that is pulled out."""
    async with talking(place) as talk:
        since = await talk.speaks()
        os.kill(browser.sound_process(place.profile), signal.SIGKILL)
        await talk.page.until("document.querySelector('.microphone .why').textContent.includes('unplugged')", 2.0)
        await talk.comes(ActionEnded, 2.0, since)
        assert talk.of(Fault, since) == []
        assert await talk.page.value("document.querySelector('#microphone').getAttribute('aria-pressed')") == "false"

        since = len(talk.told)
        await press(talk.page, "#microphone")
        await talk.page.until("document.querySelector('#microphone.light')", 10)
        await talk.comes(ActionBegan, 20.0, since)
