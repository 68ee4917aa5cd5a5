"""A recording in the window: at each place the picture that was there, whatever way one came."""

import random
from itertools import pairwise
from pathlib import Path

import msgspec
import pytest

from engage_hri.services.console.web import played
from engage_hri.services.console.web.frames import HEARTBEAT, Viewer
from engage_hri.services.console.web.picture import MEASURES, Picture
from engage_hri.services.console.web.played import PlayedPicture
from engage_hri.services.recording.reading import Recording
from tests.console import browser
from tests.console.browser import waited
from tests.console.test_window import URL, engage, needs_browser
from tests.recording.conftest import Anchor

WHOLE = ("scene", "head", "references", "events", "words", "delays")
"""Sections that tell the same, once all before is known."""


@pytest.fixture
def all_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(played, "BEFORE", 1e9)


def sections(picture: Picture) -> dict[str, object]:
    names = [*WHOLE, *(name for name in picture.versions if name.startswith(MEASURES))]
    return {name: msgspec.json.decode(picture.section(name)) for name in names}


@pytest.mark.usefixtures("all_before")
def test_a_jump_shows_what_playing_to_there_shows(task: Recording) -> None:
    chance = random.Random(1)
    jumping = PlayedPicture(task, 0.0)
    now = 0.0
    for _ in range(8):
        at = chance.uniform(1.0, task.duration - 1.0)
        now += chance.uniform(0.0, 2.0)
        jumping.seek(at, now)
        jumping.pause(now)
        played_there = PlayedPicture(task, 0.0)
        played_there.advance(at - 1e-9)
        assert sections(jumping.picture) == sections(played_there.picture)
        assert jumping.place(now).at == pytest.approx(at, abs=2e-3)


def test_it_goes_on_from_where_it_was_sent_and_from_its_end_it_begins_anew(task: Recording) -> None:
    shown = PlayedPicture(task, 100.0)
    shown.seek(20.0, 100.0)
    shown.play(100.0, 2.0)
    shown.advance(105.0)
    assert (shown.place(105.0).at, shown.place(105.0).speed, shown.visit) == (30.0, 2.0, 1)
    shown.pause(105.0)
    shown.advance(200.0)
    assert shown.place(200.0).at == 30.0
    shown.seek(task.duration + 5.0, 200.0)
    assert shown.place(200.0).at == pytest.approx(task.duration, abs=2e-3)
    shown.play(200.0)
    assert shown.place(200.0).at == 0.0


def test_what_the_lanes_show_is_there_after_a_jump(task: Recording) -> None:
    shown = PlayedPicture(task, 0.0)
    shown.seek(60.0, 0.0)
    events = msgspec.json.decode(shown.picture.section("events"))
    assert len(events) > 5


def test_after_a_jump_a_browser_gets_all_and_while_it_stands_still_a_sign_of_life(task: Recording) -> None:
    shown, viewer = PlayedPicture(task, 0.0), Viewer()
    shown.seek(30.0, 0.0)
    shown.pause(0.0)

    def frame(now: float) -> dict[str, object] | None:
        shown.advance(now)
        place = shown.place(now)
        made = viewer.frame(shown.picture, place.at, place=place, clock=now)
        return None if made is None else msgspec.json.decode(made)

    first = frame(0.0)
    assert first is not None
    assert first["now"] == 30.0
    times = [step / 10 for step in range(1, 51)]
    told = [now for now in times if frame(now)]
    assert all(after - before >= HEARTBEAT - 1e-9 for before, after in pairwise(told))
    assert len(told) >= 4
    shown.seek(10.0, 6.0)
    again = frame(6.0)
    assert again is not None
    assert set(again["sections"]) == set(shown.picture.versions)  # type: ignore[arg-type]


@needs_browser
@pytest.mark.real_time
async def test_a_recording_is_scrubbed_in_a_browser(anchor: Anchor, tmp_path: Path) -> None:
    (tmp_path / "browser").mkdir()
    command = ("console", "--recording", str(anchor.path), "--port", "0")
    with engage(tmp_path / "console", *command) as window, browser.running(tmp_path / "browser") as port:
        url = waited(window, tmp_path / "console", URL)
        async with browser.at_port(port) as running, running.page() as page:
            await page.look(1280, 1400)
            await page.go(url)
            await page.until("window.engage?.state.place?.at > 0.5")
            await page.value("document.querySelector('.player button').click()")
            await page.until("window.engage.state.place.paused")
            await page.value(
                "(() => { const bar = document.querySelector('.player input'); bar.value = '60';"
                " bar.dispatchEvent(new Event('change')); })()"
            )
            await page.until("window.engage.state.place.at === 60 && window.engage.state.events.length > 5")
            await page.until("document.querySelector('.player').textContent.includes('1:00.0 of 2:')")
            later = await page.value("JSON.stringify(window.engage.state.scene.things)")
            await page.value("window.engage.send({ do: 'play', on: false, at: 5 })")
            await page.until("window.engage.state.place.at === 5")
            assert await page.value("JSON.stringify(window.engage.state.scene.things)") != later
            await page.value("window.engage.send({ do: 'look', target: 'robot' })")
            told = "document.querySelector('.player .told')"
            await page.until(f"{told}.checkVisibility() && {told}.textContent.includes('this is a recording')")
            assert await page.value(
                "document.querySelector('#part').hidden && document.querySelector('.away').hidden"
            )
            assert page.errors == []
