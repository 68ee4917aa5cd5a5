"""Command `engage record`: all that a robot says on its bus, into a file that outlives its recorder."""

import asyncio
import os
import time
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from engage_hri.schemas import access, keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.commandline.shell.options import Connected
from engage_hri.services.commandline.shell.outputs import complain
from engage_hri.services.commandline.shell.process import DONE, FAILED, run_until_signal, unique_name
from engage_hri.services.commandline.shell.recording_file import needed, recording
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.runtime.service import installed_version

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
    config = options.load()
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
        patterns = [access.owned(row, bus.name) for row in rows if keys.SOUND not in row]
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


def _facts(options: Options) -> dict[str, str]:
    """Facts for the beginning of the file that only its user knows, and the version."""
    told = {
        "engage": installed_version(), "condition": options.condition, "participant": options.participant,
        "notes": "\n".join(options.note or ()), "began at": datetime.now().astimezone().isoformat(timespec="seconds"),
    }  # fmt: skip
    return {name: value for name, value in told.items() if value}
