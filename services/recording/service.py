"""The recorder: puts all that it hears into a file, as it came. It asks, but commands nothing."""

import asyncio
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.body import DescribeBody
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.messages import Message, encode, encoding_of
from engage_hri.schemas.participants import AskStatus
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.interface import Bus, Sample, Tap
from engage_hri.services.recording.disk import FULL_CHUNK, RecordingFile, Tell
from engage_hri.services.recording.form import CLOCK, JSON, LOST, MORE, MSGPACK, MissingMessages, Offset, kept
from engage_hri.services.recording.reading import BILLION
from engage_hri.services.recording.writing import Line

FLUSH: Seconds = 0.4
"""Longest time that a message waits until its chunk goes to the disk: a recorder that is killed loses no more."""
LOOK: Seconds = 1.0
"""Time between two looks at clocks of others and at what was lost."""
STILL: Seconds = 1.0
"""Lateness from which on the recorder has stood still."""
ASKED = (*keys.SERVICES, "simulation", "collaboration")
"""Participants that are asked for their status when they come."""


class Recorder:
    """A recording while it is made. began, wall: the same instant, on the bus' clock and in ns since 1970."""

    def __init__(self, bus: Bus, file: RecordingFile, began: Seconds, wall: int) -> None:
        self.losses = MissingMessages()
        self.is_whole = False
        """True once the file has its end."""
        self.messages = 0
        self._bus = bus
        self._file = file
        self._began = began
        self._wall = wall
        self._known_before = bus.health.dropped
        self._offsets: dict[str, Seconds] = {}
        self._still: Seconds = 0.0

    def take(self, sample: Sample) -> None:
        """Put a message into the file's next chunk."""
        form = kept(sample)
        line = Line(
            f"{self._bus.robot}/{sample.key}", form.encoding, key=sample.key, sender=sample.source, life=sample.life,
            clock=sample.clock, encoding=sample.encoding, past=sample.past, typed=form.is_typed,
        )  # fmt: skip
        if not self._file.writer.has_room(line):
            self._own(MORE, msgspec.msgpack.encode(sample), MSGPACK)
            return
        log_time = self._nanoseconds(sample.at)
        sent = self._bus.local(Stamp(sample.clock, sample.sent)) if sample.clock else sample.at
        self._file.writer.add(line, form.data, log_time, self._nanoseconds(sent), sample.number)
        self.messages += 1
        if self._file.writer.size > FULL_CHUNK:
            self._file.write()

    def told(self, key: str, message: Message, source: str) -> None:
        """Put an answer into the file that somebody gave to the recorder."""
        self.take(Sample(key, encode(message), encoding_of(message), source, self._bus.now()))

    def stood_still(self, seconds: Seconds) -> None:
        """Take the news that this process did nothing for so long; others take it for gone meanwhile."""
        self._still += seconds
        self._file.tell(
            f"{self._file.path}: the recorder stood still for {seconds:.1f} s; motion of that time is missing"
        )

    def look(self) -> None:
        """Note what has changed of other machines' clocks and of what was lost."""
        changed = {
            each.clock: Offset(offset=each.offset, error=each.error)
            for each in self._bus.health.clocks
            if self._offsets.get(each.clock) != each.offset
        }
        if changed:
            self._offsets = {each.clock: each.offset for each in self._bus.health.clocks}
            self._own(CLOCK, msgspec.json.encode(changed))
        health = self._bus.health
        losses = MissingMessages(
            dropped=health.dropped - self._known_before, overflowed=health.overflowed, lost=health.lost,
            disk=self._file.dropped, still=self._still,
        )  # fmt: skip
        if losses != self.losses:
            self.losses = losses
            self._own(LOST, msgspec.json.encode(losses))

    def _own(self, topic: str, data: bytes, form: str = JSON) -> None:
        now = self._nanoseconds(self._bus.now())
        self._file.writer.add(Line(topic=topic, form=form), data, now, now)

    def _nanoseconds(self, at: Seconds) -> int:
        return max(0, self._wall + round((at - self._began) * BILLION))

    def close(self) -> bool:
        """End the file. Returns False if something found no room on the disk."""
        self.look()
        note = {"messages": str(self.messages), "lost": str(self.losses.total)}
        self.is_whole = is_whole = self._file.close({"end": note})
        self.losses = replace(self.losses, disk=self._file.dropped)  # what waited for room to the end, too
        return is_whole


def facts(bus: Bus, wall: int, patterns: Sequence[str], more: Mapping[str, str]) -> dict[str, str]:
    """Facts that stand at the beginning of a recording. more: those that its caller knows."""
    own = {
        "format": "1", "robot": bus.robot, "clock": bus.clock, "began": repr(bus.now()), "wall": str(wall),
        "keys": " ".join(patterns),
    }  # fmt: skip
    return own | dict(more)


async def record(bus: Bus, tap: Tap, recorder: Recorder, file: RecordingFile) -> None:
    """Record until cancelled. All that has come by then is in the file; closing it is the caller's."""
    asked: asyncio.Queue[str] = asyncio.Queue()
    try:
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(_write(recorder, file), name="disk")
            tasks.create_task(_ask(bus, recorder, asked), name="questions")
            async for sample in tap:
                recorder.take(sample)
                if keys.is_presence(sample.key) and sample.source in ASKED and sample.encoding.endswith(_CAME):
                    asked.put_nowait(sample.source)
    finally:
        while len(tap) and (left := await tap.next(bus.now())) is not None:
            recorder.take(left)


_CAME = "engage.PeerAlive/1"


async def _write(recorder: Recorder, file: RecordingFile) -> None:
    loop = asyncio.get_running_loop()
    looked = loop.time()
    while True:
        due = loop.time() + FLUSH
        await asyncio.sleep(FLUSH)
        if (late := loop.time() - due) > STILL:
            recorder.stood_still(late)
        if loop.time() >= looked + LOOK:
            looked = loop.time()
            recorder.look()
        file.write()


async def _ask(bus: Bus, recorder: Recorder, asked: "asyncio.Queue[str]") -> None:
    """Ask who has come for its status, and the body what it can."""
    while True:
        name = await asked.get()
        questions: list[tuple[str, Message]] = [(keys.status(name), AskStatus())]
        if name == "control":
            questions.append((keys.DESCRIBE, DescribeBody()))
        for key, question in questions:
            try:
                recorder.told(key, await bus.query(key, question), name)
            except EngageError as error:
                bus.log.debug("recorder: %s", error)


def opened(
    bus: Bus,
    path: Path,
    wall: int,
    patterns: Sequence[str],
    more: Mapping[str, str],
    *,
    overwrite: bool = False,
    tell: Tell | None = None,
) -> tuple[Recorder, RecordingFile, Tap]:
    """Open a file and listen. tell: takes a line about trouble with the disk, which the log has in any case.

    Raises InputRefused: it cannot be written.
    """
    began = bus.now()

    def told(text: str) -> None:
        bus.log.warning(text)
        if tell is not None:
            tell(text)

    file = RecordingFile(path, facts(bus, wall, patterns, more), told, overwrite=overwrite)
    return Recorder(bus, file, began, wall), file, bus.tap(*patterns)
