"""Talks with `engage talk` from sound alone: a browser has a spoken file for its microphone, and what its page plays
is recorded, and heard by a recognizer that knows nothing but all answers.

    python -m tests.console.talked [EXCHANGES [FOLDER]]        # FOLDER: for pictures of the page, a series
"""

import asyncio
import re
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import aiohttp
import numpy as np

from engage_hri.services.commandline.look.small_talk import answer
from engage_hri.services.perception.hearing.recognizers.sphinx import Sphinx
from engage_hri.services.perception.hearing.recognizing import RecognizerSettings
from engage_hri.services.perception.hearing.sound import resampled
from engage_hri.services.perception.hearing.voice import RATE, Samples
from tests.console import browser
from tests.console.browser import Page, waited
from tests.console.tapped import press, tap, tapped
from tests.console.windows import engage
from tests.perception.spoken import placed, voice, write_wav

STAGE = rb"the stage[^:]*: (http://[^\s]+)"
PERSON = "window.stage.state.person"
READY = "window.stage?.state.scene?.body && !document.querySelector('.sit').getAttribute('aria-disabled')"
SAID = (
    "hello robot", "i am fine", "what is your name", "how old are you", "can you hear me", "what can you do",
    "where is the blue square", "what is on the table", "the blue one", "make me laugh", "i like you",
    "do you hear me", "no thank you", "please help me", "show me the red square", "yes please", "what are these",
    "the red one", "thank you very much", "i have to go now",
)  # fmt: skip
"""What the visitor says, one after the other."""
FIRST = 7.5
"""Seconds of the file before the first of them: so long the robot greets."""
PAUSE = 4.0
"""Seconds of silence after an answer, with the time until it begins, before the visitor goes on."""
LOUD = 0.02
"""What of the recording is sound."""


class Exchange(NamedTuple):
    """What became of one thing that was said.

    heard: its words, as they were understood. pair: who opened the adjacency pair that has these words; empty: none.
    said: the robot's words, as it tells them; played: as the recording has them. delay: seconds from the end of the
    visitor's voice, as it was heard, to the first sound that the page played.
    """

    phrase: str
    heard: str
    pair: str
    said: str
    played: str
    delay: float

    @property
    def is_right(self) -> bool:
        """True if it was understood, and the answer that was said and heard is the one to it."""
        return self.heard == self.phrase and self.said == self.played == spoken_answer(self.phrase)


def plain(text: str) -> str:
    return " ".join(re.findall(r"[\w']+", text.lower()))


def spoken_answer(phrase: str) -> str:
    """The answer to a phrase, as plain words."""
    return plain(re.sub(r"\[(\w+)-(\w+)\]", r"the \1 \2", answer(phrase)))


def spoken_file(path: Path, phrases: tuple[str, ...]) -> Path:
    """Write what a microphone hears: the phrases, with pauses, in a quiet room."""
    at, said = FIRST, []
    for phrase in phrases:
        said.append((at, voice(phrase, "f3")))
        at += (len(voice(phrase, "f3")) + len(voice(spoken_answer(phrase)))) / RATE + PAUSE
    samples = placed(said, at + 5.0).astype(np.float64) + np.random.default_rng(4).normal(
        0.0, 12.0, round((at + 5.0) * RATE)
    )
    return write_wav(path, samples.astype(np.int16))


@asynccontextmanager
async def at_the_stage(folder: Path, microphone: Path, *more: str) -> AsyncIterator[tuple[Page, str]]:
    """A page of `engage talk` on a phone, whose microphone is a file that is heard once. Gives its server as well."""
    flags = (
        "--use-fake-ui-for-media-stream", "--use-fake-device-for-media-stream",
        f"--use-file-for-fake-audio-capture={microphone}%noloop",
    )  # fmt: skip
    (folder / "browser").mkdir()
    with (
        engage(folder / "talk", "talk", *more, BROWSER="true %s") as talk,
        browser.running(folder / "browser", *flags) as port,
    ):
        url = waited(talk, folder / "talk", STAGE)
        async with browser.at_port(port) as running, running.page() as page:
            await page.look(390, 844)
            await tap(page)
            await page.go(url)
            await page.until(READY, 60)
            yield page, url.partition("stage")[0]


async def talked(folder: Path, phrases: tuple[str, ...], pictures: Path | None = None) -> list[Exchange]:
    """Talk by these phrases. pictures: a folder for what the page shows each time when the robot answers."""
    async with at_the_stage(folder, spoken_file(folder / "said.wav", phrases)) as (page, server):
        told: list[dict[str, Any]] = []
        only = "messages?only=utterance,fragment_outcome,connection_event"
        async with aiohttp.ClientSession() as session, session.ws_connect(server + only) as socket:
            await page.until("window.stage.shown.isStill", 60)
            await press(page, ".sit")
            await page.until(PERSON)
            await page.until("window.stage.state.talk.hears", 30)
            await press(page, ".hold")
            await page.until("document.querySelector('.hold.light')", 20)
            async with asyncio.timeout(FIRST + len(phrases) * 15.0 + 20.0):
                while sum(len(each) > 0 for each in _answers(told)) < len(phrases):
                    told.append(await socket.receive_json())
                    if pictures is not None and _is_final(told[-1]):
                        (pictures / f"{len(told):04}.png").write_bytes(await page.picture(whole=False))
            await asyncio.sleep(3.0)
        begin, sound, rate = await tapped(page, time.monotonic())
        assert page.errors == []
    return _exchanges(phrases, told, begin, resampled((32767 * sound).astype(np.int16), rate))


def _is_final(message: dict[str, Any]) -> bool:
    return message["type"] == "utterance" and message.get("final", True)


def _answers(told: list[dict[str, Any]]) -> list[list[str]]:
    """For each thing that was said: what the robot has said until the next one."""
    found: list[list[str]] = []
    for message in told:
        if _is_final(message):
            found.append([])
        elif message["type"] == "fragment_outcome" and found:
            found[-1].append(" ".join(each["text"] for each in message.get("spoken", ())))
    return found


def _exchanges(phrases: tuple[str, ...], told: list[dict[str, Any]], begin: float, sound: Samples) -> list[Exchange]:
    heard = [message for message in told if _is_final(message)]
    pairs = {
        message["words"]: message["initiator"]
        for message in told
        if message["type"] == "connection_event" and message["kind"] == "adjacency_pair"
        and message["state"] in ("succeeded", "completed") and message.get("words")
    }  # fmt: skip
    listener = Sphinx(RecognizerSettings(phrases=tuple({spoken_answer(each) for each in SAID})))
    ends = [message["ended"][1] for message in heard]
    starts = [message["began"][1] for message in heard[1:]] + [begin + len(sound) / RATE]
    found = []
    for phrase, message, answers, since, until in zip(phrases, heard, _answers(told), ends, starts, strict=True):
        part = sound[max(0, round((since - begin) * RATE)) : round((until - begin) * RATE)]
        loud = np.flatnonzero(np.abs(part) > LOUD * 32767)
        listening = listener.listen()
        first, last = (loud[0], loud[-1]) if len(loud) else (0, 0)
        listening.hear(part[max(0, first - RATE // 4) : last + RATE // 4])
        found.append(
            Exchange(
                phrase, message["text"], pairs.get(message["text"], ""), plain(" ".join(answers)),
                listening.end().text, first / RATE,
            )
        )  # fmt: skip
    return found


def _main(count: int, pictures: Path | None) -> None:
    with TemporaryDirectory() as folder:
        try:
            found = asyncio.run(talked(Path(folder), SAID[:count], pictures))
        finally:
            print((Path(folder) / "talk").read_text())
    for each in found:
        mark = "right" if each.is_right else "WRONG"
        print(f"{mark}  {each.delay:5.2f} s  {each.pair or '-':8} {each.phrase:26} {each.heard:26} {each.said}")
        if each.played != each.said:
            print(f"{'':71} played: {each.played}")
    right, pairs = sum(each.is_right for each in found), sum(bool(each.pair) for each in found)
    delays = sorted(each.delay for each in found)
    print(f"{right} of {len(found)} right, {pairs} in a pair with these words")
    print(f"the answer begins after {delays[len(delays) // 2]:.2f} s in the median, at most {delays[-1]:.2f} s")


if __name__ == "__main__":
    _main(int(sys.argv[1]) if len(sys.argv) > 1 else len(SAID), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
