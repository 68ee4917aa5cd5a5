"""Command `engage replay`: a recording on a bus again, as fast as one likes, to and fro."""

import asyncio
import re
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.shell.options import Listening
from engage_hri.services.commandline.shell.outputs import complain
from engage_hri.services.commandline.shell.process import DONE, run_until_signal, typed
from engage_hri.services.commandline.shell.recording_file import opened
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.console.wording import clock

if TYPE_CHECKING:
    from engage_hri.services.bus.interface import Hub
    from engage_hri.services.recording.player import Playback
    from engage_hri.services.recording.reading import Recording
    from engage_hri.services.recording.replay import Control

JUMP: Seconds = 5.0
"""Time by which an arrow key goes to and fro."""
SHOW: Seconds = 0.25
"""Time between two looks at the place, on a terminal."""
_KEY = re.compile(rb"\x1b[\[O][0-9;]*[@-~]|.", re.DOTALL)
HELP = "space: pause, ←/→: 5 s back or on, ↑/↓: faster or slower, 0: from the beginning, q: end"


@dataclass(frozen=True, kw_only=True)
class Options(Listening):
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording of `engage record`.", show_default=False)]
    speed: Annotated[float, typer.Option(metavar="X", min=0.01, max=100, help="Times as fast as it was.")] = 1.0
    at: Annotated[Seconds, typer.Option(metavar="S", min=0, help="Begin at this time of the recording.")] = 0.0
    until: Annotated[
        float | None, typer.Option(metavar="S", min=0, help="End at this time of it.", show_default=False)
    ] = None
    commands: Annotated[
        bool, typer.Option("--commands", help="Say commands, too. A robot that hears them moves.")
    ] = False


def main(options: Options) -> int:
    recording = opened(options.file)
    if options.at > recording.duration:
        raise InputRefused(Fault(reason=f"the recording ends after {recording.duration:.2f} s", where="--at"))
    options = options if options.robot else replace(options, robot=recording.robot)
    config = options.load()
    if config.bus.keys:
        reason = "a replay says what all services of a robot say, which no keys allow to one holder"
        raise InputRefused(Fault(reason=reason, where="--keys", advice="replay on a bus without keys"))
    if config.bus.robot != recording.robot:
        complain(f"the robot in it calls itself {recording.robot!r}, and so do its messages still")
    return run_until_signal(_replay(options, config, recording))


async def _replay(options: Options, config: RobotConfig, recording: "Recording") -> int:
    from engage_hri.services.recording.player import Playback
    from engage_hri.services.recording.replay import ReplayBus, replay

    async def hub() -> "Hub":
        return await options.open(config.bus, "replay", options.listen or ())

    player = Playback(recording, asyncio.get_running_loop().time(), speed=options.speed, until=options.until)
    stage = ReplayBus(player, hub, commands=options.commands)
    controls: asyncio.Queue[Control] = asyncio.Queue()
    async with typing(controls):
        await replay(stage, player, controls, begin=options.at)
    if stage.unread:
        complain(f"{stage.unread} messages in it are none that can be read, and were left out")
    return DONE


@asynccontextmanager
async def typing(controls: "asyncio.Queue[Control]") -> AsyncIterator[None]:
    """Take keys from a terminal, and show the place in the recording there, while the body of `async with` runs."""
    if not (sys.stdin is not None and sys.stdin.isatty() and sys.stderr.isatty()):
        yield
        return
    import termios
    import tty

    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    complain(HELP)
    tasks = [asyncio.create_task(_take_keys(controls)), asyncio.create_task(_show(controls))]
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
        print(file=sys.stderr)


async def _take_keys(controls: "asyncio.Queue[Control]") -> None:
    while came := await typed():
        for pressed in keys_in(came):
            if (control := control_of(pressed)) is not None:
                controls.put_nowait(control)


def keys_in(came: bytes) -> list[bytes]:
    """Take apart what a terminal gave at once: several keys come together when one is held down.

    Arrows are `ESC [ A` and on, or `ESC O A` in a terminal whose last program has left it so.
    """
    return [key.replace(b"\x1bO", b"\x1b[") for key in _KEY.findall(came)]


def control_of(pressed: bytes) -> "Control | None":
    """Turn a key into what it wants of the player; None: nothing."""

    def jump(by: Seconds) -> "Control":
        return lambda player, now: max(0.0, player.at(now) + by)

    def faster(factor: float) -> "Control":
        def change(player: "Playback", now: Seconds) -> None:
            paused = player.is_paused
            player.play(now, player.speed * factor)
            if paused:
                player.pause(now)

        return change

    def pause(player: "Playback", now: Seconds) -> None:
        (player.play if player.is_paused else player.pause)(now)

    return {
        b" ": pause, b"\x1b[C": jump(JUMP), b"\x1b[D": jump(-JUMP), b"\x1b[A": faster(2.0), b"\x1b[B": faster(0.5),
        b"0": lambda player, now: 0.0, b"q": lambda player, now: player.finish(),
    }.get(pressed)  # fmt: skip


async def _show(controls: "asyncio.Queue[Control]") -> None:
    def show(player: "Playback", now: Seconds) -> None:
        state = "paused " if player.is_paused else f"x{player.speed:g}"
        with suppress(OSError):
            print(
                f"\r{clock(player.at(now))} of {clock(player.end)}  {state}   ", end="", file=sys.stderr, flush=True
            )

    while True:
        controls.put_nowait(show)
        await asyncio.sleep(SHOW)
