"""Appendix B through a page, in real time: Chromium's camera and microphone have the person, and nothing else tells
what they look at and say.

    UNTIL=step-25 SHOT=page.png python -m pytest -s tests/perception/test_room_through_a_page.py

plays the whole task, prints what was told, and when, and what the person really looked at, and keeps a picture of the
page at the end.
"""

import asyncio
import importlib.util
import json
import os
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import ExitStack, asynccontextmanager
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, FaceLandmarks, Utterance
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.zenoh.hub import open_hub
from tests.bus.places import free_endpoint
from tests.console import browser
from tests.console.browser import Page, waited
from tests.console.tapped import press
from tests.console.windows import URL, engage, hears, sees
from tests.perception.eyes.fetched import MODELS, needs_eyes

needs_eyes()
pytest.importorskip("pocketsphinx", reason="pip install pocketsphinx")

from tests.perception.filmed_room import WORDS  # noqa: E402
from tests.perception.pieces.tables import TABLE  # noqa: E402
from tests.perception.room_at_page import Film, RoomAtPage  # noqa: E402

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
    pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine"),
]
PERSON = TABLE.person.id
UNTIL = os.environ.get("UNTIL", "step-8-ours")
"""The fragment to which the task is played."""
PATIENCE = 330.0
"""Seconds for the whole task, which takes 170 on two processors that have much other work."""
Told = TypeVar("Told", bound=Message)


class Watched:
    """All that was told, with the time since the page's camera was on."""

    def __init__(self) -> None:
        self.told: list[tuple[float, Message | str]] = []
        self._begin = time.monotonic()
        self._came = asyncio.Event()

    async def listen(self, bus: Bus) -> None:
        patterns = (
            keys.PERCEIVED_ACTION, keys.RECOGNIZED_ACTION, keys.ANY_CONNECTION_EVENT, keys.UTTERANCE,
            keys.request_state("generation"), keys.ANY_LANDMARKS, keys.fault("eyes"), keys.fault("hearing"),
        )  # fmt: skip
        with bus.subscribe(*patterns, capacity=10**5) as inbox:
            async for received in inbox:
                self.note(received.message)

    def note(self, told: Message | str) -> None:
        self.told.append((time.monotonic() - self._begin, told))
        self._came.set()

    def of(self, kind: type[Told]) -> list[Told]:
        """What of a kind was told, in order."""
        return [message for _, message in self.told if isinstance(message, kind)]

    async def until(self, is_so: Callable[[], bool], patience: float) -> None:
        """Wait until this is so, of what was told. Raises TimeoutError."""
        async with asyncio.timeout(patience):
            while not is_so():
                self._came.clear()
                await self._came.wait()

    def show(self) -> None:
        """Print what was told of the person, and when."""
        for at, told in self.told:
            match told:
                case ActionBegan(action=action, targets=targets):
                    print(f"{at:6.1f} {action} {' or '.join(targets) or 'elsewhere'}")
                case Utterance(final=True, text=text):
                    print(f"{at:6.1f} says: {text or '(not understood)'}")
                case FragmentOutcome(fragment=fragment, status=status):
                    print(f"{at:6.1f} {fragment}: {status}")
                case ConnectionEvent(kind=kind, initiator=initiator, state=state):
                    print(f"{at:6.1f}     {kind} of {initiator}: {state}")
                case Fault() | str():
                    print(f"{at:6.1f} {told}")


class Place(NamedTuple):
    """Address of a window, port of a browser, endpoint of the robot, and what the browser sees and hears."""

    url: str
    port: int
    endpoint: str
    film: Film


@asynccontextmanager
async def sitting(place: Place) -> AsyncIterator[tuple[Page, Watched]]:
    """Sit down at a page as the person, switch its camera on, and live there."""
    async with (
        browser.at_port(place.port) as running,
        running.page() as page,
        await open_hub("robot", connect=(place.endpoint,)) as hub,
    ):
        await page.look(900, 700, calm=True)
        await page.go(place.url)
        await page.until("window.engage?.state.you", 60)
        await page.value(f"window.engage.send({{ do: 'sit', name: {PERSON!r} }})")
        await page.until(f"window.engage.state.you.person === {PERSON!r}", 30)
        await press(page, "#camera")
        await page.until("document.querySelector('#camera.light')", 60)
        room = RoomAtPage(page, place.film, (watched := Watched()).note)
        lives = [
            asyncio.create_task(watched.listen(hub.join("watcher", "observer"))),
            asyncio.create_task(room.live(hub.join("simulation", "simulation"), lambda: None)),
        ]
        try:
            yield page, watched
        finally:
            for each in lives:
                each.cancel()
            await asyncio.wait(lives)


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Place]:
    endpoint, data, film = free_endpoint(), tmp_path / "data", Film(tmp_path / "seen.y4m", tmp_path / "heard.wav")
    data.mkdir()
    (data / "eyes").symlink_to(MODELS)
    (tmp_path / "browser").mkdir()
    film.begin()
    robot = (
        "run", "generation,realizer,recognition,control", "--listen", endpoint, "--voice", "espeak",
        "--set", "control.drivers.espeak.device=none", "--set", 'generation.policies_off=["aversion"]',
    )  # fmt: skip
    heard = ("--set", "hearing.recognizer=sphinx", "--set", f"hearing.phrases={json.dumps([*WORDS.values(), 'no'])}")
    others = {
        "window": ("console", "--port", "0", "--role", "wizard"), "eyes": ("run", "eyes", "--from", "page"),
        "hearing": ("run", "hearing", "--from", "page", *heard), "task": ("run", "collaboration"),
    }  # fmt: skip
    flags = (*sees(film.seen), *hears(film.heard, once=True))
    with ExitStack() as stays:
        waited(stays.enter_context(engage(tmp_path / "robot", *robot)), tmp_path / "robot", rb"(control is ready)")
        running = {
            name: stays.enter_context(engage(tmp_path / name, *words, "--connect", endpoint, ENGAGE_DATA=str(data)))
            for name, words in others.items()
        }
        told = {
            name: waited(process, tmp_path / name, URL if name == "window" else rb"( is ready)")
            for name, process in running.items()
        }
        port = stays.enter_context(browser.running(tmp_path / "browser", *flags))
        yield Place(told["window"], port, endpoint, film)


def keep(path: str, picture: bytes) -> None:
    Path(path).write_bytes(picture)


async def test_the_task_goes_on_by_what_a_page_sees_and_hears(place: Place):
    """The first pieces are laid as the robot asks; who answers is understood; looks go to and fro."""
    async with sitting(place) as (page, watched):
        try:
            await watched.until(lambda: UNTIL in {each.fragment for each in watched.of(FragmentOutcome)}, PATIENCE)
        finally:
            watched.show()
            print("load", os.getloadavg()[0])
            if shot := os.environ.get("SHOT"):  # of the page, to be looked at
                keep(shot, await page.picture(whole=False))

    faces = [len(each.faces) for each in watched.of(FaceLandmarks)]
    looks = [each.targets for each in watched.of(ActionBegan) if each.action == "look" and each.actor == PERSON]
    status = {each.fragment: each.status for each in watched.of(FragmentOutcome)}
    events = {(each.kind, each.initiator, each.state) for each in watched.of(ConnectionEvent)}
    assert np.mean(faces[faces.index(1) :]) > 0.97
    assert {*status.values()} == {"done"}
    assert {each.text for each in watched.of(Utterance) if each.final} & {*WORDS.values()}
    assert any(each.action == "act" for each in watched.of(ActionBegan))
    assert ("robot",) in looks
    assert any("robot" not in each for each in looks)
    assert ("mutual_facial_gaze", "robot", "succeeded") in events
    assert ("adjacency_pair", "robot", "succeeded") in events
