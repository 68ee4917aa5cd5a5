"""Sound of pages: the robot's voice, which they play, and their microphones. Each is a WebSocket, open while it is
on.

A page plays at instants of the window's clock, and tells by it when its microphone picked a sound up. It asks what
that clock shows, again and again, by `{"asked": 12.5}`, and is answered `{"asked": 12.5, "now": 93.1}`, in seconds.
Sound is binary: the instant of its first sample (float64), the number of the frame (uint32), to a page the samples
per second as well (uint32), and then the samples, 16 bit, one channel; all of it little-endian.
"""

import asyncio
import struct
from math import isfinite

from starlette.websockets import WebSocket

from engage_hri.schemas import keys
from engage_hri.schemas.perception import SoundFrame
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.console.web.links import NONSENSE, TOO_MUCH, PageLinks
from engage_hri.services.runtime.installation import extra_command, has_hearing

WAITING = 64
"""Frames of the voice that wait for a page that takes none: some 6 s. The oldest go."""
RATE = 16_000
"""Samples per second of a microphone."""
LONGEST: Seconds = 0.25
"""Sound that a page may send at a time."""
BURST: Seconds = 3.0
"""So much more sound than time has passed a page may send: what its link has kept back."""
LATEST: Seconds = 10.0
"""Age from which on sound of a microphone is of no use."""
_TO_PAGE = struct.Struct("<dII")
_FROM_PAGE = struct.Struct("<dI")


def unheard(bus: Bus, key: str) -> str:
    """Say why nobody hears the sound on `key`, and what to do; empty: somebody does."""
    if bus.is_heard(key):
        return ""
    advice = "start `engage run hearing --from page`"
    if not has_hearing():
        advice = f"install it, {extra_command('hearing')}, and {advice}"
    return f"hearing does not run, or is not ready yet: {advice}"


class Sounds(PageLinks):
    """The links of all pages for sound."""

    async def voice(self, page: WebSocket) -> None:
        """Let a page play the robot's voice, until it goes."""
        await self._linked(page, self._play)

    async def microphone(self, page: WebSocket) -> None:
        """Publish the sound of a page's microphone as that of the person at it, until one of them goes."""
        await self._linked(page, self._listen)

    # -- the robot's voice ----------------------------------------------------------------------------------------

    async def _play(self, page: WebSocket) -> None:
        with self._bus.subscribe(keys.ROBOT_SOUND, capacity=WAITING) as inbox:

            async def send() -> None:
                async for received in inbox:
                    if (told := self._for_page(received)) is not None:
                        await page.send_bytes(told)

            sending = asyncio.create_task(send(), name="voice for a page")
            try:
                await self._received(page)
                await page.close(NONSENSE, "this link takes no sound")
            finally:
                sending.cancel()
                await asyncio.wait([sending])

    def _for_page(self, received: Received) -> bytes | None:
        frame = received.message
        if not isinstance(frame, SoundFrame):
            return None
        return _TO_PAGE.pack(self._bus.local(frame.at), frame.number & 0xFFFFFFFF, frame.rate) + frame.samples

    # -- microphones ----------------------------------------------------------------------------------------------

    async def _listen(self, page: WebSocket) -> None:
        visitor = await self._seated(page, "a microphone")
        if visitor is None:
            return
        person = visitor.person
        key, numbers, begun, got = keys.sound(person), 0, self._bus.now(), 0.0
        try:
            while True:
                content = await self._received(page, lambda: unheard(self._bus, key))
                if not await self._still_seated(page, visitor, person):
                    return
                frame = self._of_page(content)
                if frame is None:
                    await page.close(NONSENSE, "this is no sound")
                    return
                got += len(frame.samples) / 2 / RATE
                if got > self._bus.now() - begun + BURST:
                    await page.close(TOO_MUCH, "more sound comes than there is time")
                    return
                numbers = max(numbers, frame.number)
                if self._bus.now() - frame.at.seconds < LATEST:
                    self._bus.publish(key, frame)
        finally:
            if self._is_newest(page, person):
                self._bus.publish(key, SoundFrame(at=self._bus.stamp(), rate=RATE, number=numbers + 1))

    def _of_page(self, content: bytes) -> SoundFrame | None:
        """The sound in what a page has sent; None: it is none. It was not picked up later than now."""
        size = len(content) - _FROM_PAGE.size
        if size <= 0 or size % 2 or size > 2 * LONGEST * RATE:
            return None
        at, number = _FROM_PAGE.unpack_from(content)
        if not isfinite(at):
            return None
        at = min(at, self._bus.now() - size / 2 / RATE)
        return SoundFrame(at=self._bus.stamp(at), rate=RATE, number=number, samples=content[_FROM_PAGE.size :])
