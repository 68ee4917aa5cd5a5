"""Talks with `engage talk` from sound alone: a browser has a spoken file for its microphone, and what its page plays
is recorded, and heard by a recognizer that knows nothing but all answers.

    python -m tests.console.talked [EXCHANGES [FOLDER]]        # FOLDER: for pictures of the page, a series
"""

import asyncio
import re
import sys
import time
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import aiohttp
import numpy as np

from engage_hri.services.commandline.look.small_talk import EXAMPLES, SmallTalk
from engage_hri.services.perception.hearing.recognizers.sphinx import Sphinx
from engage_hri.services.perception.hearing.recognizing import RecognizerSettings
from engage_hri.services.perception.hearing.sound import resampled
from engage_hri.services.perception.hearing.voice import RATE, Samples
from engage_hri.services.tangram.table import tangram_table
from tests.console import browser
from tests.console.browser import Page, waited
from tests.console.tapped import press, tap, tapped
from tests.console.windows import engage, hears
from tests.perception.spoken import placed, voice, write_wav

STAGE = rb"the stage[^:]*: (http://[^\s]+)"
PERSON = "window.stage.state.person"
READY = "window.stage?.state.scene?.body && !document.querySelector('.sit').getAttribute('aria-disabled')"
SAID = (
    "i am fine", *(each for each in EXAMPLES if "white" not in each), "do you hear me", "how are you",
    "where is the blue square", "make me laugh", "the red one", "i like you", "no thank you", "the blue one",
    "tell me a joke", "i am tired", "what are these", "thank you very much", "i have to go now",
)  # fmt: skip
"""What the visitor says, one after the other: they answer the greeting, and say what the robot says that one may.

Without the white piece: the listener below knows no trapezoid."""
THINGS = tangram_table().figure()
SHAPES = Counter(each.shape for each in THINGS)
CALLED = {
    each.id: f"the {each.color} {each.shape}" if SHAPES[each.shape] > 1 else f"the {each.shape}" for each in THINGS
}
"""Words for each thing that the robot shows: as few as mean it alone."""
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
    return plain(re.sub(r"\[(.*?)\]", lambda told: CALLED.get(told[1], ""), SmallTalk().answer(phrase, THINGS)))


def places(phrases: tuple[str, ...]) -> list[float]:
    """Seconds at which each phrase begins, and at which all is over."""
    found = [FIRST]
    for phrase in phrases:
        spoken = len(voice(phrase, "f3")) + len(voice(spoken_answer(phrase)))
        found.append(found[-1] + spoken / RATE + PAUSE)
    return found


def spoken_file(path: Path, phrases: tuple[str, ...]) -> Path:
    """Write what a microphone hears: the phrases, with pauses, in a quiet room."""
    *starts, end = places(phrases)
    said = [(at, voice(phrase, "f3")) for at, phrase in zip(starts, phrases, strict=True)]
    samples = placed(said, end + 5.0).astype(np.float64)
    samples += np.random.default_rng(4).normal(0.0, 12.0, len(samples))
    return write_wav(path, samples.astype(np.int16))


@asynccontextmanager
async def at_the_stage(folder: Path, microphone: Path, *more: str) -> AsyncIterator[tuple[Page, str]]:
    """A page of `engage talk` on a phone, whose microphone is a file that is heard once. Gives its server as well."""
    (folder / "browser").mkdir()
    with (
        engage(folder / "talk", "talk", *more, BROWSER="true %s") as talk,
        browser.running(folder / "browser", *hears(microphone, once=True)) as port,
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
            until = asyncio.get_running_loop().time() + places(phrases)[-1] + 4.0
            with suppress(TimeoutError):
                while True:
                    left = until - asyncio.get_running_loop().time()
                    told.append(await socket.receive_json(timeout=max(0.1, left)))
                    if pictures is not None and _is_final(told[-1]):
                        (pictures / f"{len(told):04}.png").write_bytes(await page.picture(whole=False))
                    if left < 0:
                        break
        begin, sound, rate = await tapped(page, time.monotonic())
        assert page.errors == []
    return _exchanges(phrases, told, begin, resampled((32767 * sound).astype(np.int16), rate))


def _is_final(message: dict[str, Any]) -> bool:
    return message["type"] == "utterance" and message.get("final", True)


def _said_by_the_robot(told: list[dict[str, Any]]) -> str:
    outcomes = {message["fragment"]: message for message in told if message["type"] == "fragment_outcome"}
    return plain(" ".join(each["text"] for told in outcomes.values() for each in told.get("spoken", ())))


def _exchanges(phrases: tuple[str, ...], told: list[dict[str, Any]], begin: float, sound: Samples) -> list[Exchange]:
    finals = [index for index, message in enumerate(told) if _is_final(message)]
    pairs = {
        message["words"]: message["initiator"]
        for message in told
        if message["type"] == "connection_event" and message["kind"] == "adjacency_pair"
        and message["state"] in ("succeeded", "completed") and message.get("words")
    }  # fmt: skip
    listener = Sphinx(RecognizerSettings(phrases=tuple({spoken_answer(each) for each in SAID})))
    *starts, end = [told[finals[0]]["began"][1] + place - FIRST for place in places(phrases)]
    found = []
    for phrase, start, following in zip(phrases, starts, [*starts[1:], end + 4.0], strict=True):
        own = [index for index in finals if start - 1.5 < told[index]["began"][1] < following - 1.5]
        if not own:
            found.append(Exchange(phrase, "", "", "", "", 0.0))
            continue
        later = [index for index in finals if index > own[-1]]
        heard = " ".join(told[index]["text"] for index in own).strip()
        ended = told[own[-1]]["ended"][1]
        part = sound[max(0, round((ended - begin) * RATE)) : max(0, round((following - begin) * RATE))]
        loud = np.flatnonzero(np.abs(part) > LOUD * 32767)
        first, last = (int(loud[0]), int(loud[-1])) if len(loud) else (0, 0)
        listening = listener.listen()
        listening.hear(part[max(0, first - RATE // 4) : last + RATE // 4])
        said = _said_by_the_robot(told[own[0] : later[0] if later else None])
        found.append(Exchange(phrase, heard, pairs.get(heard, ""), said, listening.end().text, first / RATE))
    return found


def _main(count: int, pictures: Path | None) -> None:
    with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
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
