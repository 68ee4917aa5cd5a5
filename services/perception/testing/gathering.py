"""Evidence of what a source of head poses has told: a recording, or what eyes tell while they look with it."""

import asyncio
import csv
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from engage_hri.schemas import keys
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.perception import ActorFound, ActorLost, HeadPose, Looked
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.perception.eyes.config import EyesConfig
from engage_hri.services.perception.eyes.looking import settings_of
from engage_hri.services.perception.eyes.service import see
from engage_hri.services.perception.eyes.watching import OutsideWatching, SourceLost, SourceOrder
from engage_hri.services.perception.testing.laws import Evidence, Finding, Told, TrueLook
from engage_hri.services.recording.disk import read
from engage_hri.services.recording.reading import RecordingTimes
from engage_hri.services.runtime.parcels import data_folder
from engage_hri.services.runtime.service import Ready, running

KINDS = (HeadPose, Looked, ActorFound, ActorLost, Fault)
PATTERNS = (keys.PERCEIVED_ACTION, keys.ANY_HEAD_POSE, keys.ANY_LOOKED, keys.fault("eyes"))
WORDS = 12
"""Letters that a reason in words has at least."""
PATIENCE: Seconds = 2.0
"""Time within which it is told that a source was killed."""
OPENING: Seconds = 30.0


def truth_of(path: Path) -> tuple[TrueLook, ...]:
    """Read truths: lines of `from, until, person, x, y, z`. Raises InputRefused."""
    found = []
    try:
        lines = path.read_text().splitlines()
    except OSError as error:
        raise InputRefused(Fault(reason=error.strerror or "cannot be read", where=str(path))) from error
    for number, row in enumerate(csv.reader(lines), 1):
        if not row or row[0].strip().startswith(("#", "from")):
            continue
        try:
            since, until, person, *place = row
            x, y, z = map(float, place)
            found.append(TrueLook(float(since), float(until), person.strip(), (x, y, z)))
        except ValueError:
            reason = f"line {number} is not `from, until, person, x, y, z`"
            advice = "seconds from the beginning; the place that the head faces, metres in the robot's frame"
            raise InputRefused(Fault(reason=reason, where=str(path), advice=advice)) from None
    return tuple(found)


def recorded(path: Path, truth: Sequence[TrueLook]) -> Evidence:
    """Gather what was told in a recording. Times are seconds from its beginning. Raises InputRefused."""
    recording, told = read(path), list[Told]()
    times = RecordingTimes(recording)
    for number in range(len(recording)):
        received = recording.received(number) if recording.key(number) else None
        if received is not None and isinstance(received.message, KINDS):
            came = recording.time(number)
            told.append(Told(received.message, times.told(received.message, came), came))
    return Evidence(told, truth)


async def seen(config: EyesConfig, seconds: Seconds, truth: Sequence[TrueLook]) -> Evidence:
    """Gather what eyes tell with a source for a while. Times are seconds from its first picture.

    Raises InputRefused.
    """
    hub, told, begin = MemoryHub(), list[Told](), asyncio.get_running_loop().time()
    with hub.join("check", role="observer").subscribe(*PATTERNS) as inbox:
        async with (
            running(hub, {"recognition": _idle}),
            running(hub, {"eyes": partial(see, config=config)}) as over,
        ):
            try:
                async with asyncio.timeout(seconds + OPENING):
                    while not over.is_set():
                        received = await inbox.next(asyncio.get_running_loop().time() + 0.1)
                        if received is not None and isinstance(received.message, KINDS):
                            stamp = getattr(received.message, "at", None)
                            at = received.at if stamp is None else stamp.seconds
                            begin = at if not told else begin
                            told.append(Told(received.message, at, received.at))
                        if told and told[-1].came - begin > seconds:
                            break
            except TimeoutError:
                pass
    is_live = config.source.partition(":")[0] not in ("film", "landmarks")
    shifted = [each._replace(at=each.at - begin, came=each.came - begin) for each in told]
    return Evidence(shifted, truth, is_live=is_live)


async def killed_and_recovered(config: EyesConfig) -> Finding:
    """Kill the process of a source, and let it look again. Raises InputRefused: it cannot be opened."""
    settings = settings_of(config, str(data_folder("eyes")))
    watching = OutsideWatching(SourceOrder(config.source.partition(":")[0], settings))
    loop = asyncio.get_running_loop()
    killed_at = loop.time()
    try:
        async for picture in watching.watch():
            if picture is not None:
                killed_at = loop.time()
                watching.kill()
    except SourceLost as lost:
        if loop.time() - killed_at > PATIENCE:
            return f"that its process was killed is told {loop.time() - killed_at:.1f} s later", "end `look` with it"
        if len(lost.fault.reason) < WORDS:
            return f"that its process was killed is told as {lost.fault.reason!r}", "say in words what has happened"
    else:
        return "it ends with its process, and tells no fault", "is it over before it can be killed?"
    try:
        async for picture in watching.watch():
            if picture is not None:
                return "", ""
    except EngageError as error:
        return (
            f"after its process was killed it does not look again: {error}",
            "let go of the device with the process",
        )
    return "after its process was killed it tells no picture", "begin anew each time that it is made"


async def _idle(bus: Bus, ready: Ready) -> None:
    """A recognition that only is there: eyes wait for one."""
    ready()
    await asyncio.Event().wait()
