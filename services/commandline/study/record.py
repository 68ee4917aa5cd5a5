"""Command `engage record`: all that a robot says on its bus, into a file that outlives its recorder."""

import asyncio
import os
import time
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from engage_hri.schemas import access, keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.commandline.shell.failing_output import complain
from engage_hri.services.commandline.shell.options import Connected
from engage_hri.services.commandline.shell.process import DONE, FAILED, run_until_signal, unique_name
from engage_hri.services.commandline.shell.recording_file import needed
from engage_hri.services.commandline.shell.settings import ELSEWHERE, RobotConfig
from engage_hri.services.runtime.service import installed_version

if TYPE_CHECKING:
    from engage_hri.services.bus.interface import Bus
    from engage_hri.services.recording.disk import RecordingFile
    from engage_hri.services.recording.service import Recorder

GIVES_WAY = 10
"""Niceness of the recorder: where processors are few the robot goes first, and messages wait in front of it."""


@dataclass(frozen=True, kw_only=True)
class Options(Connected):
    file: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="Where to; without it ROBOT-DATE-TIME.mcap.")
    ] = None
    condition: Annotated[str, typer.Option(metavar="NAME", help="Condition of a study, for `engage analyse`.")] = ""
    participant: Annotated[str, typer.Option(metavar="ID", help="Who takes part, for `engage analyse`.")] = ""
    note: Annotated[
        list[str] | None, typer.Option(metavar="TEXT", help="Anything worth knowing later; may be repeated.")
    ] = None
    seconds: Annotated[
        float | None, typer.Option(metavar="S", min=0, help="End by itself after so long.", show_default=False)
    ] = None
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file if there is one.")] = False
    repair: Annotated[
        bool, typer.Option("--repair", help="Copy all that can be read of a damaged FILE into a whole one beside it.")
    ] = False


def main(options: Options) -> int:
    needed()
    if options.repair:
        return _repair(options.file)
    config = options.read(RobotConfig, elsewhere=ELSEWHERE)
    os.nice(GIVES_WAY)
    path = options.file or Path(f"{config.bus.robot}-{time.strftime('%Y%m%d-%H%M%S')}.mcap")
    return run_until_signal(_record(options, config, path))


def _repair(path: Path | None) -> int:
    from engage_hri.services.recording.disk import read, repair

    if path is None:
        raise InputRefused(Fault(reason="needs a FILE", where="--repair"))
    recording = read(path)
    if recording.is_whole and not recording.damaged:
        print(f"{path}: nothing to repair")
        return DONE
    copy = path.with_suffix(".repaired.mcap")
    is_whole = repair(recording, copy, complain)
    print(f"{copy}: {len(recording)} messages")
    for lack in recording.lacks:
        print(f"{copy}: {lack}")
    return DONE if is_whole else FAILED


async def _record(options: Options, config: RobotConfig, path: Path) -> int:
    from engage_hri.services.bus.zenoh.neighbors import hinting

    async with await options.open(config.bus, "viewer") as hub:
        bus = hub.join(unique_name("record"), "observer")
        rows = access.rows(bus.role, "subscribes") if config.bus.keys else (keys.EVERYTHING,)
        patterns = [access.owned(row, bus.name) for row in rows]
        async with recording(bus, path, patterns, _facts(options), overwrite=options.overwrite) as (
            recorder,
            running,
        ):
            complain(f"recording {config.bus.robot} into {path}; Ctrl-C ends it")
            bus.declare_alive()
            try:
                async with asyncio.timeout(options.seconds), hinting(bus, config.bus.connect):
                    await running
            except (TimeoutError, asyncio.CancelledError):
                pass  # Ctrl-C is how a recording ends: the exit code says what became of it
    return DONE if recorder.is_whole and not recorder.losses.disk else FAILED


@asynccontextmanager
async def recording(
    bus: "Bus", path: Path, patterns: Sequence[str], facts: Mapping[str, str], *, overwrite: bool = False
) -> AsyncIterator[tuple["Recorder", "asyncio.Task[None]"]]:
    """Record into a file while the body of `async with` runs; at the end say what is in it, and what is not.

    Raises InputRefused: it cannot be written. The task ends by itself only if recording fails.
    """
    from engage_hri.services.recording.service import opened, record

    recorder, file, tap = opened(bus, path, time.time_ns(), patterns, facts, overwrite=overwrite, tell=complain)
    running = asyncio.create_task(record(bus, tap, recorder, file), name="recorder")
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


def _facts(options: Options) -> dict[str, str]:
    """Facts for the beginning of the file that only its user knows, and the version."""
    told = {
        "engage": installed_version(), "condition": options.condition, "participant": options.participant,
        "notes": "\n".join(options.note or ()), "began at": datetime.now().astimezone().isoformat(timespec="seconds"),
    }  # fmt: skip
    return {name: value for name, value in told.items() if value}
