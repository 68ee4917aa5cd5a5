"""Recordings that commands read and write: the extra that they need, and what to say of one that is not whole."""

import asyncio
import time
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from engage_hri.schemas.faults import InputRefused, raised_as
from engage_hri.services.commandline.shell.outputs import complain
from engage_hri.services.runtime.installation import extra_command

if TYPE_CHECKING:
    from engage_hri.services.bus.interface import Bus
    from engage_hri.services.recording.disk import RecordingFile
    from engage_hri.services.recording.reading import Recording
    from engage_hri.services.recording.service import Recorder


def needed() -> None:
    """Check that recordings can be read and written. Raises InputRefused."""
    with raised_as(InputRefused, ImportError, "", "recordings need mcap", extra_command("record")):
        import mcap.records  # noqa: F401
        import zstandard  # noqa: F401


def opened(path: Path) -> "Recording":
    """Open a recording, and say on standard error what it lacks. Raises InputRefused."""
    needed()
    from engage_hri.services.recording.disk import read

    recording = read(path)
    if recording.has_all_data and not recording.is_whole:
        whole = f"its data is there, {len(recording)} messages"
        complain(f"{path}: the index at its end is damaged, or more stands behind it; {whole}")
    if not recording.has_all_data:
        behind = f", {recording.lost_bytes} bytes behind them are not" if recording.lost_bytes else ""
        complain(
            f"{path}: its end is missing or damaged; {len(recording)} messages until {recording.duration:.2f} s"
            f" are whole{behind}"
        )
    if recording.repaired:
        complain(f"{path}: it is a copy of a recording that lacked something: {recording.repaired}")
    for place in recording.damaged:
        complain(f"{path}: damaged at byte {place.offset}: {place.reason}")
    if recording.losses.total:
        complain(f"{path}: {recording.losses.total} messages are missing, as its recorder says")
    return recording


@asynccontextmanager
async def recording(
    bus: "Bus", path: Path, patterns: Sequence[str], facts: Mapping[str, str], *, overwrite: bool = False
) -> AsyncIterator[tuple["Recorder", "asyncio.Task[None]"]]:
    """Record into a file while the body of `async with` runs; at the end say what is in it, and what is not.

    Raises InputRefused: it cannot be written. The task ends by itself only if recording fails.
    """
    from engage_hri.services.recording import service

    recorder, file, tap = service.opened(
        bus, path, time.time_ns(), patterns, facts, overwrite=overwrite, tell=complain
    )
    running = asyncio.create_task(service.record(bus, tap, recorder, file), name="recorder")
    try:
        yield recorder, running
    finally:
        running.cancel()
        await asyncio.wait([running])
        _report(recorder, file, recorder.close())


def _report(recorder: "Recorder", file: "RecordingFile", is_whole: bool) -> None:
    """Say what is in the file, and what is not."""
    lost = recorder.losses
    if file.is_removed:
        complain(f"{file.path}: it was removed while it was recorded, and is lost")
        return
    complain(f"{file.path}: {recorder.messages - lost.disk} messages, {file.written / 1e6:.1f} MB")
    if lost.total:
        complain(f"{file.path}: {lost.total} messages are missing, {lost.disk} of them for want of room on the disk")
    if not is_whole:
        complain(
            f"{file.path}: it has no end; `engage record --repair` makes a copy that has one, once there is room"
        )
