"""The links of pages for sound: who may have one, what goes over it, and what does not."""

import asyncio
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

pytest.importorskip("starlette", reason="needs the extra `console`")

from engage_hri.schemas import keys
from engage_hri.schemas.perception import SoundFrame
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.console.web import links, sounds
from engage_hri.services.console.web.sounds import Sounds
from tests.console.fake_page import FRAME, FakePage, Seated


class Place:
    """The links of a window. seated: who sits at which session."""

    def __init__(self, bus: Bus, robot: Bus) -> None:
        self.bus, self.robot = bus, robot
        self.seated: dict[str, Seated] = {}
        self.sounds = Sounds(bus, self.seated.get)  # type: ignore[arg-type]
        self.links: list[asyncio.Task[None]] = []

    async def voice(self) -> FakePage:
        page = FakePage()
        self.links.append(asyncio.create_task(self.sounds.voice(page.link)))
        await asyncio.sleep(0.1)
        return page

    async def microphone(self, session: str) -> FakePage:
        page = FakePage(f"session={session}")
        self.links.append(asyncio.create_task(self.sounds.microphone(page.link)))
        await asyncio.sleep(0.1)
        return page


@asynccontextmanager
async def window(hub: MemoryHub) -> AsyncIterator[Place]:
    place = Place(hub.join("console", "wizard"), hub.join("control"))
    yield place
    for link in place.links:
        link.cancel()
    await asyncio.gather(*place.links, return_exceptions=True)


async def test_a_page_plays_what_the_voice_tells_at_instants_of_the_windows_clock(hub: MemoryHub) -> None:
    async with window(hub) as place:
        assert not place.robot.is_heard(keys.ROBOT_SOUND)
        page = await place.voice()
        assert place.robot.is_heard(keys.ROBOT_SOUND)
        at = place.robot.now() + 0.15
        place.robot.publish(
            keys.ROBOT_SOUND, SoundFrame(at=place.robot.stamp(at), rate=22050, samples=FRAME, number=7)
        )
        place.robot.publish(keys.ROBOT_SOUND, SoundFrame(at=place.robot.stamp(at + 1), rate=22050, number=8))
        await asyncio.sleep(0.1)
        page.text('{"asked": 3.5}')
        await asyncio.sleep(0.1)
        page.go()
        await asyncio.sleep(0.1)

        assert page.got == [
            struct.pack("<dII", at, 7, 22050) + FRAME,
            struct.pack("<dII", at + 1, 8, 22050),
            {"asked": 3.5, "now": pytest.approx(place.bus.now() - 0.2)},
        ]
        assert not place.robot.is_heard(keys.ROBOT_SOUND)


async def test_a_page_whose_microphone_nobody_hears_is_told_what_to_start_and_to_install(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with window(hub) as place:
        place.seated["s"] = Seated("ann")
        page = await place.microphone("s")
        page.text('{"asked": 1}')
        await asyncio.sleep(0.1)
        monkeypatch.setattr(sounds, "has_hearing", lambda: False)
        page.text('{"asked": 2}')
        await asyncio.sleep(0.1)
        hub.join("hearing", "perception").subscribe(keys.ANY_SOUND)
        page.text('{"asked": 3}')
        await asyncio.sleep(0.1)

    told = [each.get("unheard", "") for each in page.got]
    assert "start `engage run hearing --from page`" in told[0]
    assert "[hearing]" in told[1]
    assert told[2] == ""


async def test_sound_of_a_microphone_is_that_of_the_person_at_the_page(hub: MemoryHub) -> None:
    async with window(hub) as place:
        place.seated["s"] = Seated("ann")
        ear = hub.join("hearing", "perception").subscribe(keys.ANY_SOUND)
        page = await place.microphone("s")
        now = place.bus.now()
        page.sound(now - 0.03, number=4)
        page.sound(now + 5.0, number=5)  # nobody can have heard what is to come
        page.sound(now - 60.0, number=6)
        await asyncio.sleep(0.1)
        page.go()
        await asyncio.sleep(0.1)
        heard = [received for _ in range(len(ear)) if (received := await ear.next()) is not None]

    assert [received.key for received in heard] == [keys.sound("ann")] * 3
    first, second, end = (received.message for received in heard)
    assert isinstance(first, SoundFrame)
    assert isinstance(second, SoundFrame)
    assert isinstance(end, SoundFrame)
    assert (first.at.seconds, first.rate, first.samples, first.number) == (now - 0.03, 16000, FRAME, 4)
    assert second.at.seconds == pytest.approx(now - len(FRAME) / 2 / 16000)
    assert (end.samples, end.number) == (b"", 7)


async def test_without_a_seat_there_is_no_microphone_and_it_ends_with_the_seat(hub: MemoryHub) -> None:
    async with window(hub) as place:
        place.seated["looks-on"], place.seated["s"] = Seated(""), Seated("ann")
        stranger, looks_on = await place.microphone("unknown"), await place.microphone("looks-on")
        page = await place.microphone("s")
        page.sound(place.bus.now())
        place.seated["s"].person = ""
        await asyncio.sleep(0.1)
        still = page.closed
        page.sound(place.bus.now())
        await asyncio.sleep(0.1)

    assert stranger.closed == looks_on.closed == (4403, "take a seat first: a microphone is that of a person")
    assert still is None or still[0] == 4403
    assert page.closed == (4403, "you have left your seat")


async def test_a_link_that_was_cut_tells_no_end_of_the_one_that_the_page_has_made_since(hub: MemoryHub) -> None:
    async with window(hub) as place:
        place.seated["s"] = Seated("ann")
        ear = hub.join("hearing", "perception").subscribe(keys.ANY_SOUND)
        cut, cut_too, page = [await place.microphone("s") for _ in range(3)]
        page.sound(place.bus.now(), number=1)
        cut.go()  # seen long after, as nothing comes any more
        cut_too.sound(place.bus.now(), number=99)
        await asyncio.sleep(0.1)
        page.sound(place.bus.now(), number=2)
        page.go()
        await asyncio.sleep(0.1)
        heard = [received for _ in range(len(ear)) if (received := await ear.next()) is not None]

    frames = [each.message for each in heard if isinstance(each.message, SoundFrame)]
    assert [(frame.number, bool(frame.samples)) for frame in frames] == [(1, True), (2, True), (3, False)]
    assert cut_too.closed == (4403, "you have it on elsewhere")


@pytest.mark.parametrize(
    ("samples", "at"),
    [(b"", 0.0), (b"abc", 0.0), (bytes(2 * 16000), 0.0), (FRAME, float("nan")), (FRAME, float("inf"))],
)
async def test_what_is_no_sound_ends_the_link(hub: MemoryHub, samples: bytes, at: float) -> None:
    async with window(hub) as place:
        place.seated["s"] = Seated("ann")
        page = await place.microphone("s")
        page.sound(at, samples)
        await asyncio.sleep(0.1)

    assert page.closed == (1003, "this is no sound")


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"asked": "x"}', "[" * 5000])
async def test_what_is_no_question_ends_the_link(hub: MemoryHub, text: str) -> None:
    async with window(hub) as place:
        page = await place.voice()
        page.text(text)
        await asyncio.sleep(0.1)

    assert page.closed == (1003, "this is no question for the time")


async def test_who_sends_more_sound_than_there_is_time_is_cut_off(hub: MemoryHub) -> None:
    async with window(hub) as place:
        place.seated["s"] = Seated("ann")
        ear = hub.join("hearing", "perception").subscribe(keys.ANY_SOUND)
        page = await place.microphone("s")
        for number in range(40):
            page.sound(place.bus.now(), bytes(2 * 1600), number)
        await asyncio.sleep(0.1)

    assert page.closed == (4408, "more sound comes than there is time")
    assert len(ear) <= 10 * (sounds.BURST + 0.2) + 2


async def test_a_page_that_sends_sound_where_it_is_to_play_is_cut_off(hub: MemoryHub) -> None:
    async with window(hub) as place:
        page = await place.voice()
        page.sound(0.0)
        await asyncio.sleep(0.1)

    assert page.closed == (1003, "this link takes no sound")


async def test_there_is_room_for_so_many_pages_and_no_more(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(links, "MOST_LINKS", 2)
    async with window(hub) as place:
        pages = [await place.voice() for _ in range(3)]
        pages[0].go()
        await asyncio.sleep(0.1)
        again = await place.voice()

    assert [page.closed and page.closed[0] for page in (*pages, again)] == [None, None, 4429, None]
