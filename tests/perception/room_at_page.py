"""The room of Appendix B before the camera and the microphone of a page, in real time.

A browser reads the film of its camera picture by picture, again and again, and the sound of its microphone when that
is switched on. So the film has two pictures, which are written anew while it is shown, and the person presses the
microphone for each thing that they say. Pieces and hands are told, for a page has no camera over the table.
"""

import asyncio
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.client.people.shared_world import SharedWorld
from engage_hri.services.perception.hearing.voice import RATE
from engage_hri.services.runtime.service import Ready
from tests.console.browser import Page
from tests.console.tapped import press
from tests.perception.eyes.drawing import Picture
from tests.perception.eyes.films import frame, head_of
from tests.perception.eyes.people import CAMERA, JUDGED, Light, Person, Pose, drawn
from tests.perception.filmed_room import FACES_A_SECOND, FilmedRoom
from tests.perception.spoken import voice, write_wav

LOOKS = 0
BEFORE, AFTER = 0.5, 1.5
"""Seconds of silence before and after what is said, in which the microphone is on."""
QUIET = 60.0
"""Seconds of silence that a microphone hears behind that."""


@cache
def _person() -> Person:
    return Person(JUDGED[LOOKS])


def face(pose: Pose | None) -> Picture:
    """Draw the person's head, in a process of its own: on a busy machine it takes a second."""
    return drawn([] if pose is None else [(_person(), pose)], Light(), CAMERA, seed=1)


class Film(NamedTuple):
    """Files that a browser takes for its camera and its microphone."""

    seen: Path
    heard: Path

    def begin(self) -> None:
        """Make them: gray pictures, and silence."""
        gray = np.full((CAMERA.height, CAMERA.width, 3), 128, np.uint8)
        self.seen.write_bytes(head_of(gray) + 2 * frame(gray))
        write_wav(self.heard, np.zeros(round(QUIET * RATE), np.int16))

    def show(self, picture: Picture, number: int) -> None:
        """Write a picture in the place of one of the two."""
        with self.seen.open("r+b") as file:
            file.seek(len(head_of(picture)) + number % 2 * len(frame(picture)))
            file.write(frame(picture))

    def say(self, words: str) -> float:
        """Have the microphone hear this when it is switched on. Returns how long it has to be on."""
        said = voice(words)
        silence = [np.zeros(round(seconds * RATE), np.int16) for seconds in (BEFORE, QUIET)]
        write_wav(self.heard, np.concatenate([silence[0], said, silence[1]]))
        return BEFORE + len(said) / RATE + AFTER


class RoomAtPage(FilmedRoom):
    """The person before the camera and the microphone of a page. The table and hands over it are told as they are."""

    def __init__(self, page: Page, film: Film, note: Callable[[str], None]) -> None:
        """Live there. note: told what the person really does, in words."""
        super().__init__(0, LOOKS)
        self._page, self._film, self._note, self._shown = page, film, note, face(None)
        self._world: Callable[[World, Seconds], None] = lambda world, now: None

    async def live(self, bus: Bus, ready: Ready) -> None:
        shared = SharedWorld(bus.name)

        def show(world: World, now: Seconds) -> None:
            own = tuple(each for each in world.entities if each.kind != "person")
            bus.publish(keys.WORLD, World(entities=shared.tell(own, now), at=bus.stamp(now)))

        self._world = show
        async with asyncio.TaskGroup() as tasks:
            for each in (super().live(bus, ready), self._draw(bus), self._film_it(), self._speak()):
                tasks.create_task(each)

    def _happened(self, message: Message, now: Seconds) -> None:
        super()._happened(message, now)
        match message:
            case World():
                self._world(message, now)
            case ActionBegan(action=action, targets=targets):
                self._note(f"    really: {action} {' '.join(targets)}")

    async def _draw(self, bus: Bus) -> None:
        known, loop = dict[Pose | None, Picture](), asyncio.get_running_loop()
        with ProcessPoolExecutor(1) as painter:
            while True:
                pose = self.pose(bus.now())
                if pose not in known:
                    known[pose] = await loop.run_in_executor(painter, face, pose)
                self._shown = known[pose]
                await asyncio.sleep(1 / FACES_A_SECOND)

    async def _film_it(self) -> None:
        number = 0
        while True:
            self._film.show(self.grained(self._shown), number)
            number += 1
            await asyncio.sleep(1 / FACES_A_SECOND)

    async def _speak(self) -> None:
        count = 0
        while True:
            await asyncio.sleep(0.05)
            for _, words in self.said[count:]:
                count += 1
                lasts = self._film.say(words)
                await press(self._page, "#microphone")
                await self._page.until("document.querySelector('#microphone.light')", 30)
                await asyncio.sleep(lasts)
                await press(self._page, "#microphone")
