"""The camera of a page: what of it comes to the bus, and what the page says when nothing does.

Chromium takes a film of a rendered person for its camera. Each pose is held for a while, and the film begins anew.
"""

import asyncio
import importlib.util
import os
import signal
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorLost, FaceLandmarks, HeadPose
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.perception.eyes.head_pose import head
from engage_hri.services.perception.eyes.looking import Floats, unpacked
from tests.console import browser
from tests.console.browser import Page, waited
from tests.console.tapped import press
from tests.console.windows import URL, HeardPlace, engage, place, sees
from tests.perception.eyes.fetched import MODELS, needs_eyes

needs_eyes()

from engage_hri.services.perception.eyes.sources.litert import FaceFinder  # noqa: E402
from tests.perception.eyes.films import posed, read, written  # noqa: E402
from tests.perception.eyes.people import JUDGED, Pose  # noqa: E402

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
    pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine"),
]
POSES = tuple(Pose((0.0, 0.0, 0.6), yaw, pitch) for yaw, pitch in ((0, 0), (22, -5), (-22, -5), (0, -22), (35, 5)))
HELD = 1.6
FACE = 2812 + 17
"""Bytes of a message with one face."""


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("film") / "seen.y4m", posed(JUDGED[6], POSES, HELD))


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("data")
    (folder / "eyes").symlink_to(MODELS)
    return str(folder)


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory, film: Path, data: str) -> Iterator[HeardPlace]:
    folder = tmp_path_factory.mktemp("camera")
    with (
        place(folder, sees(film), ENGAGE_DATA=data) as here,
        engage(folder / "eyes", "run", "eyes", "--from", "page", "--connect", here.endpoint) as eyes,
    ):
        waited(eyes, folder / "eyes", rb"(eyes is ready)")
        yield here


class Sitting:
    """Somebody who sits at a page. told: what came to the bus, with the local time of each."""

    def __init__(self, page: Page, bus: Bus) -> None:
        self.page, self.bus = page, bus
        self.told: list[tuple[float, object]] = []
        self.came = asyncio.Event()

    @property
    def seen(self) -> list[tuple[float, FaceLandmarks]]:
        """What the camera has told, with local times."""
        return [(at, each) for at, each in self.told if isinstance(each, FaceLandmarks) and not each.over]

    async def until(self, is_so: Callable[[], bool], seconds: float = 5.0) -> None:
        """Wait until this is so, of what came to the bus."""
        async with asyncio.timeout(seconds):
            while not is_so():
                self.came.clear()
                await self.came.wait()

    async def got(self, count: int, seconds: float = 60.0) -> None:
        """Wait until so many pictures have been told."""
        await self.until(lambda: len(self.seen) >= count, seconds)

    async def ended(self) -> None:
        """Wait until the bus knows that the camera is off."""
        await self.until(lambda: any(isinstance(each, FaceLandmarks) and each.over for _, each in self.told))

    def looks(self) -> list[type]:
        """Beginnings and ends of looks that were reported, in their order."""
        kinds = ActionBegan | ActionEnded
        return [type(each) for _, each in self.told if isinstance(each, kinds) and each.action == "look"]

    async def press(self) -> None:
        await press(self.page, "#camera")

    async def says(self, part: str, seconds: float = 2.0) -> None:
        """Wait until the page says this."""
        await self.page.until(f"document.querySelector('.camera .why').textContent.includes({part!r})", seconds)

    async def is_on(self) -> None:
        await self.page.until("document.querySelector('#camera.light')", 10.0)

    @property
    async def is_off(self) -> bool:
        return bool(await self.page.value("!document.querySelector('#camera.light')"))


@asynccontextmanager
async def sitting(here: HeardPlace, before: str = "", url: str = "") -> AsyncIterator[Sitting]:
    """Sit down at a page. before: a script that the page has before it loads. url: of another window."""
    async with (
        browser.at_port(here.port) as running,
        running.page() as page,
        await open_hub("robot", connect=(here.endpoint,)) as hub,
    ):
        await page.call("Page.addScriptToEvaluateOnNewDocument", source=before)
        await page.go(url or here.url)
        await page.until("window.engage?.state.you", 60)
        await page.value("window.engage.send({ do: 'sit', name: 'ann' })")
        await page.until("window.engage.state.you.person === 'ann'")
        one = Sitting(page, hub.join("watcher", "observer"))
        with one.bus.subscribe(keys.ANY_LANDMARKS, keys.ANY_HEAD_POSE, keys.PERCEIVED_ACTION) as inbox:

            async def listen() -> None:
                async for received in inbox:
                    one.told.append((one.bus.now(), received.message))
                    one.came.set()

            listens = asyncio.create_task(listen())
            try:
                yield one
            finally:  # a seat that nobody has left is kept for a while, and the next test finds it taken
                listens.cancel()
                await page.value("window.engage.send({ do: 'leave' })")
                await page.until("!window.engage.state.you.person")


def ahead(landmarks: FaceLandmarks) -> Floats:
    """Direction of the only head."""
    [points] = unpacked(landmarks.faces)
    found = head(points, landmarks.width, landmarks.height, 640.0)
    assert found is not None
    return found.ahead


def angles(one: Floats, other: Floats) -> Floats:
    return np.degrees(np.arccos(np.clip(np.sum(one * other, axis=-1), -1.0, 1.0)))


async def test_the_page_tells_the_heads_that_litert_sees_in_the_same_film(seen: HeardPlace, film: Path):
    async with sitting(seen) as one:
        assert await one.is_off
        await one.press()
        await one.is_on()
        await one.got(150)
        told = one.seen[:]
        poses = [each for _, each in one.told if isinstance(each, HeadPose)]

    with_face = [each for _, each in told if each.faces]
    assert len(with_face) >= 0.99 * len(told)
    finder, pictures = FaceFinder(MODELS, 4), [*read(film)]
    found = [finder.find(picture) for picture in pictures]
    by_litert = np.array([head(points, 640, 480, 640.0).ahead for [(points, _)] in found])  # type: ignore[union-attr]
    held = len(pictures) // len(POSES)
    usual = np.array([by_litert[at + held // 3 : at + held].mean(0) for at in range(0, len(pictures), held)])
    usual /= np.linalg.norm(usual, axis=1, keepdims=True)

    by_page = np.array([ahead(each) for each in with_face])
    apart = angles(by_page[:, None], usual[None])
    nearest = apart.argmin(1)
    assert {*nearest} == {*range(len(POSES))}
    assert np.median(apart.min(1)) < 0.7  # the noise of the pictures in both
    for number, pose in enumerate(POSES):
        own = by_page[nearest == number]
        mean = np.median(own, axis=0)
        assert angles(mean / np.linalg.norm(mean), usual[number]) < 1.0
        assert angles(mean / np.linalg.norm(mean), pose.rotation @ [0.0, 0.0, -1.0]) < 12.0

    instants = np.array([one.bus.local(each.at) for _, each in told])
    waits = np.array([at for at, _ in told]) - instants
    print("capture to message:", (1000 * np.quantile(waits, (0.5, 0.9, 1.0))).round(), "ms; load", os.getloadavg()[0])
    assert (np.diff(instants) > 0).all()
    assert np.median(waits) < 0.5
    assert {each.actor for each in poses} == {"ann"}


async def test_the_window_shows_where_who_is_seen_looks(seen: HeardPlace):
    """The seat says that they look at the robot, until they are seen: then they look away and back as in the film."""
    looks = "window.engage.state.scene.people.find((each) => each.id === 'ann').looks"
    async with sitting(seen) as one:
        await one.page.until(f"{looks}?.includes('robot')", 5.0)
        await one.press()
        await one.page.until(f"{looks} && !{looks}.includes('robot')", 40.0)
        await one.page.until(f"{looks}?.includes('robot')", 20.0)


async def test_nothing_as_large_as_a_picture_leaves_the_page(seen: HeardPlace):
    """All that the browser sends to anybody goes through here."""
    sent, upstream, writers = 0, urlsplit(seen.url), list[asyncio.StreamWriter]()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal sent
        from_window, to_window = await asyncio.open_connection("127.0.0.1", upstream.port)
        writers.extend((writer, to_window))

        async def pump(source: asyncio.StreamReader, sink: asyncio.StreamWriter, *, counts: bool) -> None:
            nonlocal sent
            while content := await source.read(65536):
                sent += len(content) if counts else 0
                sink.write(content)
            sink.close()

        await asyncio.gather(
            pump(reader, to_window, counts=True), pump(from_window, writer, counts=False), return_exceptions=True
        )

    async with await asyncio.start_server(serve, "127.0.0.1", 0) as proxy:
        port = proxy.sockets[0].getsockname()[1]
        url = upstream._replace(netloc=f"127.0.0.1:{port}").geturl()
        async with sitting(seen, url=url) as one:
            requests = len(one.page.requests)
            await one.press()
            await one.got(10)
            before, count = sent, len(one.seen)
            await one.got(count + 60)
            pictures = len(one.seen) - count
            after = sent
            assert all(f"127.0.0.1:{port}" in each for each in one.page.requests[requests:])
        for writer in writers:
            writer.transport.abort()
            await asyncio.gather(writer.wait_closed(), return_exceptions=True)

    assert 0.5 * pictures * FACE < after - before < 2 * pictures * FACE  # with questions for the time, and news drawn
    assert 2 * FACE < 640 * 480 * 3 / 100


async def test_without_a_way_past_the_page_its_pictures_go_by_the_page(seen: HeardPlace):
    """Not every browser hands the pictures of a camera to a worker by itself."""
    async with sitting(seen, "delete window.MediaStreamTrackProcessor;") as one:
        await one.press()
        await one.is_on()
        await one.got(20)
        waits = [at - one.bus.local(each.at) for at, each in one.seen]
        assert all(len(each.faces) == 1 for _, each in one.seen[5:])
        assert 0 <= np.median(waits) < 10  # on the clock of the bus: however long a loaded machine takes


KEEP = """
const asked = navigator.mediaDevices.getUserMedia.bind(navigator.mediaDevices);
navigator.mediaDevices.getUserMedia = async (...what) => (window.stream = await asked(...what));
"""


async def test_it_is_off_at_one_press_and_the_look_is_as_one_says(seen: HeardPlace):
    async with sitting(seen, KEEP) as one:
        await one.press()
        await one.got(10)
        await one.press()
        await one.page.until("!document.querySelector('#camera.light')", 1.0)
        await one.ended()
        assert await one.page.value("stream.getTracks().every((each) => each.readyState === 'ended')")
        await one.until(lambda: one.looks()[-2:] == [ActionEnded, ActionBegan])
        assert not any(isinstance(each, ActorLost) for _, each in one.told)


@pytest.mark.parametrize("how", ["dispatchEvent(new Event('ended'))", "stop()"])
async def test_a_camera_that_is_unplugged_is_told_and_off(seen: HeardPlace, how: str):
    async with sitting(seen, KEEP) as one:
        await one.press()
        await one.got(5)
        await one.page.value(f"stream.getVideoTracks()[0].{how}")
        await one.says("it was unplugged, or taken away")
        assert await one.is_off
        await one.ended()


PICTURES = """
navigator.mediaDevices.getUserMedia = async () => {
  const canvas = Object.assign(document.createElement('canvas'), { width: 640, height: 480 });
  const drawing = canvas.getContext('2d');
  const draw = () => { drawing.fillStyle = '%s'; drawing.fillRect(0, 0, 640, 480); };
  draw();
  if (%s) setInterval(draw, 60);
  return canvas.captureStream();
};
"""


@pytest.mark.parametrize(
    ("color", "is_drawn", "words"),
    [
        ("#000", "true", "The camera gives black pictures"),
        ("#789", "true", "The camera gives the same picture all the time"),
        ("#789", "false", "The camera gives"),
    ],
)
async def test_a_camera_that_shows_nothing_is_told_and_nobody_has_gone(
    seen: HeardPlace, color: str, is_drawn: str, words: str
):
    async with sitting(seen, PICTURES % (color, is_drawn)) as one:
        await one.press()
        await one.is_on()
        await one.says(words, 15.0)  # the models are loaded first
        assert len(one.seen) <= 1  # that it is the same all the time the first picture does not show
        assert not any(isinstance(each, ActorLost) for _, each in one.told)


async def test_who_is_not_in_the_picture_is_told_and_gone(seen: HeardPlace):
    noise = "drawing.fillStyle = `rgb(${[1, 2, 3].map(() => 100 + 60 * Math.random())})`"
    async with sitting(seen, (PICTURES % ("#789", "true")).replace("drawing.fillStyle = '#789'", noise)) as one:
        await one.press()
        await one.says("The camera sees nobody", 15.0)
        assert all(not each.faces for _, each in one.seen)
        assert len(one.seen) > 5


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("NotAllowedError", "did not let this page have it"),
        ("NotFoundError", "none is plugged in"),
        ("NotReadableError", "another program has it"),
    ],
)
async def test_a_refusal_is_told_and_can_be_asked_again(seen: HeardPlace, name: str, words: str):
    refuse = f"navigator.mediaDevices.getUserMedia = async () => {{ throw new DOMException('no', '{name}'); }};"
    async with sitting(seen, f"const plain = navigator.mediaDevices.getUserMedia; {refuse}") as one:
        await one.press()
        await one.says(words)
        assert await one.is_off
        await one.page.value("void (navigator.mediaDevices.getUserMedia = plain)")
        await one.press()
        await one.is_on()


async def test_a_page_that_is_hidden_sees_nobody_and_says_so(seen: HeardPlace):
    async with sitting(seen) as one:
        await one.press()
        await one.got(5)
        await one.page.value(
            "Object.defineProperty(document, 'hidden', { value: true, configurable: true });"
            "document.dispatchEvent(new Event('visibilitychange')); delete document.hidden"
        )
        await one.says("went off as this page was hidden")
        assert await one.is_off
        await one.ended()


async def test_a_page_that_is_loaded_anew_has_its_camera_off(seen: HeardPlace):
    async with sitting(seen) as one:
        await one.press()
        await one.got(5)
        await one.page.call("Page.reload")
        await one.ended()
        await one.page.until("window.engage?.state.you", 60)
        assert await one.is_off
        await one.page.value("window.engage.send({ do: 'sit', name: 'ann' })")
        await one.page.until("window.engage.state.you.person === 'ann'", 40)


async def test_a_window_that_stands_still_is_told(seen: HeardPlace):
    async with sitting(seen) as one:
        await one.press()
        await one.got(5)
        os.kill(seen.process, signal.SIGSTOP)
        try:
            await one.says("The window does not answer", 2.5)
        finally:
            os.kill(seen.process, signal.SIGCONT)
        count = len(one.seen)
        await one.page.until("document.querySelector('.camera .why').textContent === ''", 8.0)
        await one.got(count + 5)


async def test_what_is_not_installed_or_does_not_run_is_told_with_what_to_do(
    seen: HeardPlace, tmp_path: Path, data: str
):
    window = ("console", "--port", "0", "--role", "wizard", "--connect")
    with engage(tmp_path / "bare", *window, seen.endpoint, ENGAGE_DATA=str(tmp_path / "none")) as bare:
        url = waited(bare, tmp_path / "bare", URL)
        async with sitting(seen, url=url) as one:
            await one.press()
            await one.says("engage eyes install", 15.0)
            assert await one.is_off
