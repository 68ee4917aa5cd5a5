"""The links of pages for cameras: who may have one, what goes over it, and where somebody looks who is seen."""

import asyncio
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="needs the extra `console`")

import httpx

from engage_hri.schemas import keys
from engage_hri.schemas.perception import FACE_POINTS, ActionBegan, ActionEnded, FaceLandmarks, FacePoints, HeadPose
from engage_hri.schemas.units import Vector
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.console.web import server, sights
from engage_hri.services.console.web.own_look import GLANCE
from engage_hri.services.console.web.server import PAGE
from engage_hri.services.console.web.sights import POLICY, Sights
from engage_hri.services.console.web.visitor import Visitor
from engage_hri.services.runtime.parcels import PARCELS
from tests.console.fake_page import FakePage
from tests.console.test_seats import give, visitors

POINTS = (bytes(range(256)) * 11)[: FACE_POINTS * 6]
SEAT = (1.2, 0.0, 1.2)


def picture(at: float, faces: int = 1, width: int = 640, confidence: float = 0.5) -> bytes:
    """What a page sends of a picture."""
    each = struct.pack("<f", confidence) + POINTS
    return struct.pack("<dIHHB", at, 7, width, 480, faces) + faces * each


class Place:
    """A window, at which ann sits. told: what came to the bus."""

    def __init__(self, bus: Bus, visitor: Visitor) -> None:
        self.bus, self.visitor = bus, visitor
        self.sights = Sights(bus, lambda session: visitor if session == "own" else None)
        self.links: list[asyncio.Task[None]] = []
        self.told: list[Any] = []

    async def camera(self, session: str = "own") -> FakePage:
        page = FakePage(f"session={session}")
        self.links.append(asyncio.create_task(self.sights.camera(page.link)))
        await asyncio.sleep(0.1)
        return page

    async def sends(self, page: FakePage, content: bytes) -> None:
        page.say({"type": "websocket.receive", "bytes": content})
        await asyncio.sleep(0.05)

    async def sees(self, place: Vector) -> None:
        """Tell of ann's head as eyes do."""
        pose = HeadPose(actor="ann", position=place, direction=(-1.0, 0.0, 0.0), at=self.bus.stamp())
        self.bus.publish(keys.head_pose("ann"), pose)
        await asyncio.sleep(0.05)

    def looks(self) -> list[tuple[str, ...]]:
        """Targets of the looks of ann that have been told, in their order; ("ended",): one has ended."""
        found = []
        for each in self.told:
            match each:
                case ActionBegan(action="look", targets=targets):
                    found.append(targets)
                case ActionEnded(action="look"):
                    found.append(("ended",))
        return found

    def place(self) -> Vector:
        """Place of ann's face in the world."""
        return next(each.position for each in self.visitor._window.picture.world.people if each.id == "ann")


@asynccontextmanager
async def window(hub: MemoryHub) -> AsyncIterator[Place]:
    async with visitors(hub, 1, 1) as [visitor]:
        place = Place(visitor._window.bus, visitor)
        with hub.join("watcher").subscribe(keys.PERCEIVED_ACTION, keys.ANY_LANDMARKS) as inbox:

            async def listen() -> None:
                async for received in inbox:
                    place.told.append(received.message)

            listening = asyncio.create_task(listen())
            give(visitor, '{"do": "sit", "name": "ann"}')
            await asyncio.sleep(1.0)
            yield place
            for task in (*place.links, listening):
                task.cancel()
            await asyncio.gather(*place.links, listening, return_exceptions=True)


async def test_what_a_camera_sees_is_told_as_points_with_its_instant_until_it_goes(hub: MemoryHub):
    async with window(hub) as place:
        page = await place.camera()
        at = place.bus.now() - 0.2
        await place.sends(page, picture(at))
        await place.sends(page, picture(at + 0.1, faces=0))
        await place.sends(page, picture(at + 100))
        page.go()
        await asyncio.sleep(0.1)
        now = place.bus.now()

    seen = [each for each in place.told if isinstance(each, FaceLandmarks)]
    assert seen[0] == FaceLandmarks(
        at=place.bus.stamp(at), width=640, height=480, faces=(FacePoints(points=POINTS, confidence=0.5),)
    )
    assert seen[1] == FaceLandmarks(at=place.bus.stamp(at + 0.1), width=640, height=480)
    assert seen[2].at.seconds <= now  # nothing was seen later than now
    assert [each.over for each in seen] == [False, False, False, True]
    assert seen[3].faces == ()


async def test_a_camera_is_that_of_a_person_and_ends_with_the_seat(hub: MemoryHub):
    async with window(hub) as place:
        assert (await place.camera("other")).closed == (4403, "take a seat first: a camera is that of a person")
        page = await place.camera()
        give(place.visitor, '{"do": "leave"}')
        await asyncio.sleep(0.5)
        await place.sends(page, picture(place.bus.now()))
        assert page.closed == (4403, "you have left your seat")
        assert place.told[-1].over


@pytest.mark.parametrize(
    "content",
    [
        b"", b"x" * 16, picture(1.0)[:-1], picture(1.0) + b"x", picture(float("nan")), picture(1.0, faces=17),
        picture(1.0, width=8), picture(1.0, confidence=1.5), picture(1.0, confidence=float("nan")),
        b"\xff\xd8" * 3000,
    ],
)  # fmt: skip
async def test_what_is_no_points_ends_the_link_and_comes_to_nobody(hub: MemoryHub, content: bytes):
    """The last of these begins as a JPEG does: there is no way for a picture."""
    async with window(hub) as place:
        page = await place.camera()
        await place.sends(page, content)
        assert page.closed == (1003, "this is nothing that a camera sees")
        assert [each for each in place.told if isinstance(each, FaceLandmarks) and not each.over] == []


async def test_who_tells_of_more_pictures_than_there_is_time_is_cut_off(hub: MemoryHub):
    async with window(hub) as place:
        page = await place.camera()
        for _ in range(1000):
            page.say({"type": "websocket.receive", "bytes": picture(place.bus.now(), faces=0)})
        await asyncio.sleep(0.1)
        assert page.closed == (4408, "more pictures come than there is time")


async def test_a_page_is_told_the_time_and_that_no_eyes_run(hub: MemoryHub):
    async with window(hub) as place:
        page = await place.camera()
        page.text('{"asked": 2.5}')
        await asyncio.sleep(0.05)
        assert page.got[0]["asked"] == 2.5
        assert page.got[0]["now"] == pytest.approx(place.bus.now(), abs=0.1)
        assert "unheard" not in page.got[0]  # this test listens

    assert "engage run eyes --from page" in sights.unseen(hub.join("alone"), keys.landmarks("nobody"))


async def test_who_is_seen_looks_where_their_head_says_and_is_where_it_is(hub: MemoryHub):
    async with window(hub) as place:
        assert place.looks() == [("robot",)]
        page = await place.camera()
        assert place.looks() == [("robot",)]  # as long as no eyes tell of a head
        await place.sees((1.2, 0.02, 1.2))
        await place.sees((1.1, 0.2, 1.2))
        assert place.looks() == [("robot",), ("ended",)]
        assert place.place() == (1.1, 0.2, 1.2)

        give(place.visitor, '{"do": "look", "target": "cup"}')
        await asyncio.sleep(GLANCE - 0.1)
        assert place.looks()[2:] == [("cup",)]
        await asyncio.sleep(0.2)
        assert place.looks()[2:] == [("cup",), ("ended",)]

        page.go()
        await asyncio.sleep(0.1)
        assert place.looks()[4:] == [("robot",)]
        assert place.place() == SEAT
        await place.sees((1.1, 0.2, 1.2))
        assert place.place() == SEAT


async def test_who_leaves_in_a_glance_leaves(hub: MemoryHub):
    async with window(hub) as place:
        page = await place.camera()
        await place.sees((1.1, 0.2, 1.2))
        give(place.visitor, '{"do": "look", "target": "cup"}')
        await asyncio.sleep(0.1)
        give(place.visitor, '{"do": "leave"}')
        await place.sees((1.1, 0.3, 1.2))
        await asyncio.sleep(2 * GLANCE)
        assert place.visitor.person == ""
        assert place.looks()[-1] == ("ended",)
        page.go()


@pytest.mark.real_time
async def test_the_page_has_what_finds_faces_from_here_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hub: MemoryHub
):
    """Its worker may compile the runtime; that is in no policy of a page. What is not installed says what to do."""
    monkeypatch.setenv("ENGAGE_DATA", str(tmp_path))
    (tmp_path / "eyes").mkdir()
    (tmp_path / "eyes" / "mine.txt").write_text("not yours")
    app = server.Starlette(routes=Sights(hub.join("console"), lambda session: None).routes(PAGE))
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://here") as browser:
        wanted = "/eyes/litert_wasm_compat_internal.wasm"
        missing = await browser.get(wanted)
        assert (missing.status_code, "engage eyes install" in missing.text) == (404, True)

        for parcel in PARCELS["eyes"]:
            for name in parcel.names():
                (tmp_path / "eyes" / name).write_bytes(b"content")
        found = await browser.get(wanted)
        assert (found.status_code, found.content) == (200, b"content")
        assert found.headers["content-type"] == "application/wasm"
        again = await browser.get(wanted, headers={"if-none-match": found.headers["etag"]})
        assert again.status_code == 304
        assert (await browser.get("/eyes/mine.txt")).status_code == 404
        assert (await browser.get("/eyes/../eyes/mine.txt")).status_code == 404

        worker = await browser.get("/page/camera-link.js")
        assert worker.headers["content-security-policy"] == POLICY
        assert "'wasm-unsafe-eval'" in POLICY
