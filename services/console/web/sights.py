"""Cameras of pages: what a page has found in its pictures comes here, and never a picture.

A page sends binary, all little-endian: the instant of the picture by the window's clock (float64), the number of the
picture (uint32), its width and height (uint16 each) and the number of faces (uint8); then for each face the
confidence that it is one (float32), and its points as in `FacePoints`. What finds faces the page has from here, too.
"""

import asyncio
import struct
from collections.abc import Iterator
from math import isfinite
from pathlib import Path
from typing import Any

from msgspec.structs import replace
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from engage_hri.schemas import keys
from engage_hri.schemas.perception import FACE_POINTS, MOST_FACES, FaceLandmarks, FacePoints, HeadPose
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.console.web.links import NONSENSE, TOO_MUCH, PageLinks
from engage_hri.services.console.web.visitor import Visitor
from engage_hri.services.runtime.parcels import PARCELS, data_folder

MOST_PICTURES = 60
"""Pictures in a second that a page may tell of."""
BURST: Seconds = 3.0
"""So much more than time has passed it may tell of: what its link has kept back."""
LATEST: Seconds = 10.0
"""Age from which on what a page has seen is of no use."""
SIZES = range(16, 4097)
"""Widths and heights of pictures."""
WORKER = "camera-link.js"
POLICY = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; connect-src 'self' ws: wss:"
"""What the worker of a page that finds faces may load and do: compile its runtime, besides what the page may."""
KINDS = {".wasm": "application/wasm", ".js": "text/javascript", ".tflite": "application/octet-stream"}
"""Media types of what finds faces."""
_HEADER = struct.Struct("<dIHHB")
_FACE = struct.Struct(f"<f{FACE_POINTS * 3 * 2}s")


def unseen(bus: Bus, key: str) -> str:
    """Say why nobody takes what a camera tells on `key`, and what to do; empty: somebody does."""
    return "" if bus.is_heard(key) else "eyes do not run here for pages: start `engage run eyes --from page`"


class Sights(PageLinks):
    """The links of all pages for their cameras."""

    def routes(self, page: Path) -> list[BaseRoute]:
        """Make the routes to the link, and to what finds faces. page: folder of the scripts."""

        async def worker(request: Request) -> Response:
            headers = {"content-security-policy": POLICY, "cache-control": "no-cache"}
            return FileResponse(page / WORKER, media_type="text/javascript", headers=headers)

        return [
            WebSocketRoute("/camera", self.camera),
            Route(f"/page/{WORKER}", worker),
            Mount("/eyes", _Installed()),
        ]

    async def camera(self, page: WebSocket) -> None:
        """Publish what a page's camera sees as that of the person at it, until one of them goes."""
        await self._linked(page, self._watch)

    async def _watch(self, page: WebSocket) -> None:
        visitor = await self._seated(page, "a camera")
        if visitor is None:
            return
        person, begun, got = visitor.person, self._bus.now(), 0
        key, last = keys.landmarks(person), FaceLandmarks(at=self._bus.stamp(), width=640, height=480)
        following = asyncio.create_task(self._follow(visitor, person), name=f"camera of {person}")
        try:
            while True:
                content = await self._received(page, lambda: unseen(self._bus, key))
                if not await self._still_seated(page, visitor, person):
                    return
                told = self._of_page(content)
                if told is None:
                    await page.close(NONSENSE, "this is nothing that a camera sees")
                    return
                got += 1
                if got > (self._bus.now() - begun + BURST) * MOST_PICTURES:
                    await page.close(TOO_MUCH, "more pictures come than there is time")
                    return
                if self._bus.now() - told.at.seconds < LATEST:
                    last = told
                    self._bus.publish(key, told)
        finally:
            following.cancel()
            await asyncio.wait([following])
            if self._is_newest(page, person):
                self._bus.publish(key, replace(last, at=self._bus.stamp(), faces=(), over=True))

    async def _follow(self, visitor: Visitor, person: str) -> None:
        """Let the one at the page be where eyes see them, and look where their head says; until cancelled."""
        with self._bus.subscribe(keys.head_pose(person)) as inbox, visitor.seen() as look:
            async for received in inbox:
                if isinstance(received.message, HeadPose) and visitor.person == person:
                    look.is_at(received.message.position)

    def _of_page(self, content: bytes) -> FaceLandmarks | None:
        """Read what a page has told; None: it is nothing of the kind. The picture was not taken later than now."""
        if len(content) < _HEADER.size:
            return None
        at, _, width, height, count = _HEADER.unpack_from(content)
        fits = len(content) == _HEADER.size + count * _FACE.size and count <= MOST_FACES
        if not fits or not isfinite(at) or width not in SIZES or height not in SIZES:
            return None
        faces = tuple(_faces(content, count))
        if not all(0.0 <= face.confidence <= 1.0 for face in faces):
            return None
        stamp = self._bus.stamp(min(at, self._bus.now()))
        return FaceLandmarks(at=stamp, width=width, height=height, faces=faces)


def _faces(content: bytes, count: int) -> Iterator[FacePoints]:
    for number in range(count):
        confidence, points = _FACE.unpack_from(content, _HEADER.size + number * _FACE.size)
        yield FacePoints(points=points, confidence=confidence)


class _Installed(StaticFiles):
    """The files that `engage eyes install` has fetched, as they are now: nobody has to start the window anew."""

    def __init__(self) -> None:
        super().__init__(directory=data_folder("eyes"), check_dir=False)
        self.config_checked = True  # what is not installed is told below
        self._names = {name for parcel in PARCELS["eyes"] for name in parcel.names()}

    async def get_response(self, path: str, scope: Any) -> Response:
        if path not in self._names or not (data_folder("eyes") / path).is_file():
            raise HTTPException(404, "run `engage eyes install` where the window runs")
        response = await super().get_response(path, scope)
        response.headers["cache-control"] = "no-cache"
        if (kind := KINDS.get(Path(path).suffix)) is not None:
            response.headers["content-type"] = kind
        return response
