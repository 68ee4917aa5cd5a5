"""The room of Appendix B as cameras and a microphone have it: nothing that the person does is told, all is rendered.

The person reacts to the robot, so each picture is drawn when it is taken, from what the person does just then: their
face from the robot's eyes (`people.py`), the table with their hands from above it (`tables.py`). Heads go a part of
the way to what is looked at, and the eyes go the rest. The microphone has the person's voice, lips move with it, and
the robot's own voice out of the room's echo, and noise.

`eyes`, `pieces` and `hearing` run on that as they would live. Only the clock is virtual: what looking costs is time
that passes between the instant of a picture and what is told of it.

What is not in the pictures: the robot's own arms, and the person's body behind the table.
"""

import asyncio
import math
import random
from collections.abc import AsyncGenerator, Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from imageio_ffmpeg import write_frames

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, FaceLandmarks, SoundFrame
from engage_hri.schemas.units import Seconds, Stamp, Vector
from engage_hri.services.bus.interface import Bus
from engage_hri.services.perception.eyes.looking import packed
from engage_hri.services.perception.eyes.sources.litert import FaceFinder
from engage_hri.services.perception.hearing.own_voice import OwnVoice
from engage_hri.services.perception.hearing.sound import Piece
from engage_hri.services.perception.hearing.voice import RATE, Samples
from engage_hri.services.perception.pieces.colors import written_palette
from engage_hri.services.perception.pieces.finding import PieceFinder, learned
from engage_hri.services.perception.pieces.spotting import SpottedPieces
from engage_hri.services.runtime.service import Ready
from engage_hri.services.simulation.human import Act, Ended, Human, Rule, Start, speech
from engage_hri.services.tangram.people.appendix_b import rules
from engage_hri.services.tangram.people.head import Sightlines
from engage_hri.services.tangram.people.person_at_table import PersonAtTable
from engage_hri.services.tangram.people.service import AWAIT_PARTICIPANTS, _wait_for
from engage_hri.services.tangram.people.table import HandSide, Table, minimum_jerk
from engage_hri.services.tangram.table import tangram_table
from tests.perception.echoes import room as way_through_a_room
from tests.perception.eyes.drawing import Picture
from tests.perception.eyes.fetched import MODELS
from tests.perception.eyes.film_of_looks import GRAINS, TURN, habit, head_at, stray
from tests.perception.eyes.people import CAMERA, JUDGED, Light, Person, Pose
from tests.perception.eyes.people import drawn as drawn_people
from tests.perception.pieces.tables import EVEN, EYE, STARTS, TABLE, THICK, TOP, Hand
from tests.perception.pieces.tables import drawn as drawn_table
from tests.perception.pieces.test_finding import flat
from tests.perception.spoken import pink, voice

ROBOT = "robot"
FACES_A_SECOND = 15.0
LOOKING: Seconds = 0.06
"""Time from a picture of a face to what is told of it, as measured in a page (docs/eyes.md)."""
SPOTTING: Seconds = 0.5
"""The same of a table (docs/pieces.md); the next picture is taken then."""
HEARING: Seconds = 0.02
"""Length of the pieces of sound."""
REACH = 0.1
"""Metres from a palm to its fingertips, which hold a piece in its middle."""
HANDS: tuple[HandSide, ...] = ("left", "right")
TAKES = 4
"""Pictures of a table that stays as it is in which pieces are found anew."""
WORDS = {"step-5": "okay", "step-16-ours": "this one here", "step-21": "yes", "step-25": "thank you very much"}
"""What the person says after these steps, in which the robot waits for them. Appendix B has them say nothing."""
ANSWERING: Seconds = 0.4
ECHOES = 0.05, 0.3
"""Of the robot's voice in the room: delay, and time in which echoes fall by 60 dB."""


def talking_rules() -> tuple[Rule, ...]:
    """The person of Appendix B, who answers in words besides."""
    said = (Rule(step, Ended(), speech(words, len(voice(words)) / RATE), ANSWERING) for step, words in WORDS.items())
    return (*rules(), *said)


class TalkingPerson(Human):
    """A person by these rules. said: when they said which words."""

    def __init__(self, seed: int) -> None:
        chance = random.Random(seed)
        super().__init__(talking_rules(), ROBOT, lambda: chance.uniform(-0.03, 0.03))
        self.said: list[tuple[Seconds, str]] = []

    def due(self, now: Seconds) -> tuple[Act, ...]:
        acts = super().due(now)
        if acts and isinstance(acts[0], Start) and acts[0].words:
            self.said.append((now, acts[0].words))
        return acts


class FilmedRoom:
    """The person at the table, and what is to be seen and heard of them. looks: number of who it is.

    words: as they were said.
    """

    def __init__(self, seed: int, looks: int) -> None:
        self._table = Table(tangram_table())
        self._sightlines = Sightlines(self._table, ROBOT)
        self._human = TalkingPerson(seed)
        self._exact = PersonAtTable(
            self._human, self._table, robot=ROBOT, frame=1 / FACES_A_SECOND, stamp=lambda at: Stamp("loop", at)
        )
        self._chance = np.random.default_rng(seed)
        self._model = Person(JUDGED[looks])
        self._share = habit(self._chance)
        self._strays: dict[str, Vector] = {}
        """By how much the head is beside its habit, for each thing that is looked at."""
        self._target, self._since = "", -math.inf
        self._from = self._goal(0.0)
        self._drawn: dict[Pose | None, Picture] = {}
        """What was drawn of faces: noise apart, heads that stand look the same."""
        shape = (GRAINS, CAMERA.height, CAMERA.width, 3)
        self._grain = np.rint(self._chance.normal(0, 3, shape)).astype(np.int16)
        self._own, self._way = OwnVoice(), way_through_a_room(*ECHOES, self._chance)
        self._hiss = pink(60 * RATE) * 10

    @property
    def said(self) -> list[tuple[Seconds, str]]:
        """What the person has said, and when."""
        return self._human.said

    async def live(self, bus: Bus, ready: Ready) -> None:
        """Let the person come when the robot is there, and do what they do. Nothing of it is told."""
        with bus.subscribe(
            keys.ANY_ROBOT_ALIVE, keys.FEEDBACK, keys.SYNC_POINT, keys.ROBOT_ACTION, keys.ANY_CONNECTION_EVENT,
            keys.ROBOT_SEEN, keys.ROBOT_SOUND,
        ) as inbox:  # fmt: skip
            ready()
            await _wait_for({*AWAIT_PARTICIPANTS}, inbox)
            self._exact.enter(bus.now())
            while not inbox.is_over:
                received, now = await inbox.next(self._exact.deadline), bus.now()
                if received is not None and isinstance(received.message, SoundFrame):
                    frame = received.message
                    self._own.take(np.frombuffer(frame.samples, "<i2"), frame.rate, bus.local(frame.at))
                elif received is not None:
                    self._exact.feed(received.message, now)
                for message in self._exact.advance(now):
                    self._happened(message, now)

    def _happened(self, message: Message, now: Seconds) -> None:
        match message:
            case ActionBegan(action="look", targets=targets):
                self._from, self._since = self._pose(now), now
                self._target = (*targets, "")[0]

    # -- eyes ---------------------------------------------------------------------------------------------------

    def faces(self, now: Seconds) -> Picture:
        """What the robot's eyes see of people."""
        if (pose := self.pose(now)) not in self._drawn:
            people = [] if pose is None else [(self._model, pose)]
            self._drawn[pose] = drawn_people(people, Light(), CAMERA, seed=1)
        return self.grained(self._drawn[pose])

    def grained(self, picture: Picture) -> Picture:
        """A picture with the noise of a camera."""
        grain = self._grain[int(self._chance.integers(GRAINS))]
        return np.clip(grain + picture, 0, 255).astype(np.uint8)

    def pose(self, now: Seconds) -> Pose | None:
        """The head now; None: nobody is there."""
        return self._pose(now) if self._table.seated else None

    def _pose(self, now: Seconds) -> Pose:
        """The head now, on its way, or where it has come to: in steps, so that not each picture has to be drawn."""
        goal, part = self._goal(now), round(4 * minimum_jerk((now - self._since) / TURN)) / 4
        before = self._from
        yaw, pitch, roll, right, up = (
            round(2 * (a + part * (b - a))) / 2
            for a, b in zip((*before[1:4], *before.eyes), (*goal[1:4], *goal.eyes), strict=True)
        )
        return Pose(goal.at, yaw, pitch, roll, (right, up), self._mouth(now), goal.lids)

    def _goal(self, now: Seconds) -> Pose:
        eyes, there = self._sightlines.eyes, self._sightlines.to(self._target, now)
        x, y, z = (a + b for a, b in zip(eyes, there, strict=True))
        if self._target not in self._strays:
            self._strays[self._target] = stray(self._chance)
        goal = head_at(eyes, (x, y, z), self._share, self._strays[self._target])
        return goal._replace(lids=round(goal.lids, 1))

    def _mouth(self, now: Seconds) -> float:
        """Lips as far open as the voice is loud."""
        window = self._voice(round(now * RATE) - 400, 800).astype(np.float64)
        return round(min(0.6, float(np.sqrt(np.mean(window**2))) / 5000), 1)

    # -- the table ----------------------------------------------------------------------------------------------

    def top(self, now: Seconds, take: int) -> tuple[Any, Callable[[], Picture]]:
        """What the robot's eyes see of the table: what differs from one picture to the next, and what draws it."""
        poses = {each.id: (*each.position[:2], each.yaw) for each in self._table.pieces(now)}
        hands = tuple(held_at(self._table.hand(side, now)) for side in HANDS) if self._table.seated else ()
        state = tuple(poses.items()), hands
        return state, lambda: drawn_table(poses, EYE, EVEN._replace(noise=8), hands, seed=1, take=take)

    # -- the microphone -----------------------------------------------------------------------------------------

    def sound(self, first: int, count: int) -> Samples:
        """Samples of the microphone from this number on, counted from loop time 0."""
        before = len(self._way) - 1
        robot = np.convolve(self._own.between(first - before, count + before) * 0.4, self._way, "valid")
        hiss = self._hiss[np.arange(first, first + count) % len(self._hiss)]
        return np.clip(robot + self._voice(first, count) + hiss, -32768, 32767).astype(np.int16)

    def _voice(self, first: int, count: int) -> Samples:
        """The person's voice alone."""
        made = np.zeros(count, np.int16)
        for at, words in self._human.said:
            said, begin = voice(words), round(at * RATE) - first
            since, until = max(begin, 0), min(begin + len(said), count)
            if since < until:
                made[since:until] += said[since - begin : until - begin]
        return made


def held_at(place: Vector) -> Hand:
    """A hand that holds what lies at a place, as it is drawn."""
    x, y, z = place
    return Hand((x + REACH, y), above=max(z - TOP, THICK))


# -- the senses' devices -------------------------------------------------------------------------------------------


class FilmingFaces:
    """The camera of the eyes, and LiteRT, in the place of a source in a process. kept: a folder for its film."""

    def __init__(self, room: FilmedRoom, kept: Path | None = None) -> None:
        self._room, self._finder = room, FaceFinder(MODELS, 4)
        self._keep = _keeping(kept, "faces.mp4", FACES_A_SECOND)

    def __call__(self, *order: object) -> "FilmingFaces":
        return self

    async def watch(self) -> AsyncGenerator[FaceLandmarks | None, None]:
        yield None
        now = asyncio.get_running_loop().time
        while True:
            at = now()
            picture = self._room.faces(at)
            self._keep(picture)
            faces = tuple(packed(*face) for face in self._finder.find(picture))
            await asyncio.sleep(LOOKING)
            yield FaceLandmarks(at=Stamp("", at), width=CAMERA.width, height=CAMERA.height, faces=faces)
            await asyncio.sleep(at + 1 / FACES_A_SECOND - now())


class FilmingTable:
    """The camera over the table, and what finds pieces in its pictures.

    While nothing on the table moves its pictures differ by their noise alone: after some of them what was found in
    these is told in turn. kept: a folder for the film.
    """

    def __init__(self, room: FilmedRoom, kept: Path | None = None) -> None:
        self._room = room
        self._keep = _keeping(kept, "table.mp4", 1 / SPOTTING)
        self._finder = PieceFinder(TABLE, flat(), _palette())

    def __call__(self, *order: object) -> "FilmingTable":
        return self

    async def watch(self) -> AsyncGenerator[SpottedPieces | None, None]:
        yield None
        now, before, found, number = asyncio.get_running_loop().time, None, list[Any](), 0
        while True:
            at = now()
            state, draw = self._room.top(at, number)
            if state != before:
                before, found = state, []
            if len(found) < TAKES:
                picture = draw()
                found.append(self._finder.find(picture))
            self._keep(picture)
            told = found[number % TAKES] if len(found) == TAKES else found[-1]
            number += 1
            await asyncio.sleep(SPOTTING)
            yield SpottedPieces(at=Stamp("", at), **told._asdict())


def _keeping(folder: Path | None, name: str, rate: float) -> Callable[[Picture], None]:
    """What keeps pictures as a film, to be looked at; nothing, without a folder."""
    if folder is None:
        return lambda picture: None
    film: Any = None

    def keep(picture: Picture) -> None:
        nonlocal film
        if film is None:
            folder.mkdir(parents=True, exist_ok=True)
            quick = ["-preset", "ultrafast"]  # noise is dear to encode
            film = write_frames(
                str(folder / name), picture.shape[1::-1], fps=rate, macro_block_size=1, output_params=quick
            )
            film.send(None)
        film.send(np.ascontiguousarray(picture))

    return keep


def microphone(room: FilmedRoom) -> Any:
    """The place of `opened`: sound as it comes from a device."""

    async def recorded() -> AsyncGenerator[Piece, None]:
        loop, count = asyncio.get_running_loop(), round(HEARING * RATE)
        first = math.ceil(loop.time() * RATE)
        while True:
            await asyncio.sleep((first + count) / RATE - loop.time())
            yield Piece(room.sound(first, count)[:, None], first / RATE)
            first += count

    return lambda source, channels: recorded


@cache
def _palette() -> Any:
    return learned(drawn_table(STARTS, seed=99), TABLE, flat())


def colors(folder: Path) -> str:
    """File with the colors of the pieces, as `engage calibrate colors` makes it."""
    path = folder / "colors.toml"
    path.write_text(written_palette(_palette()))
    return str(path)
