"""Watch over one child process: it shows signs of life, and is started anew when it shows none, or ends."""

import asyncio
import os
from asyncio.subprocess import Process
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager

from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import Sight, Silences
from engage_hri.services.commandline.shell.supervisor import (
    each_line,
    ended_in_order,
    ending,
    killed,
    spawned,
    without_threads,
)

SIGN = "\x06"
"""Line that is a sign of life, and not passed on."""
EVERY: Seconds = 1.0
"""Time between two signs."""
SILENCE: Seconds = 5.0
"""Time without any line after which a child is taken to hang."""
BEGINNING: Seconds = 30.0
"""The same for the first sign, on a machine that is busy or slow."""
BRIEF: Seconds = 2.0
"""Life of a child after which the next one does not come at once, but after `PAUSE`."""
PAUSE: Seconds = 0.5


async def watched(
    command: Sequence[str],
    name: str,
    tell: Callable[[str], None],
    warn: Callable[[str], None],
    other: Callable[[bytes], bool] = lambda line: False,
) -> int:
    """Run a process until cancelled, and again whenever it hangs or ends. Returns the exit code of one that refuses.

    The process gets the number of a pipe as its last argument, for its lines and signs. What Zenoh logs in it goes
    to standard output: in a flood that is always full, and a sign would find no room there.
    One that ends by itself before its first sign refuses to run: it has said why. name: of the process, for people.
    tell: gets the lines of its pipe. other: gets those of its standard output, and says of each whether it is a sign
    of life. warn: gets what became of it.
    """
    loop = asyncio.get_running_loop()
    with without_threads():
        while True:
            began = loop.time()
            async with _piped(command) as (process, lines):
                has_shown, is_silent = await _listen(process, lines, tell, other)
                if is_silent:
                    await killed(process)
                code = await process.wait()
            if is_silent:
                after = f"for {SILENCE:g} s" if has_shown else f"within {BEGINNING:g} s"
                warn(f"{name} showed no sign of life {after}; it was killed, and is started anew")
            elif not has_shown and code >= 0:
                return code
            else:
                warn(f"{name} ended with {ending(code)}; it is started anew")
            if loop.time() - began < BRIEF:
                await asyncio.sleep(PAUSE)


@asynccontextmanager
async def _piped(command: Sequence[str]) -> AsyncIterator[tuple[Process, asyncio.StreamReader]]:
    """Run a process that has one more pipe to us, and its number as the last argument."""
    loop, lines = asyncio.get_running_loop(), asyncio.StreamReader()
    ours, its = os.pipe()
    writing = os.fdopen(its, "wb", 0)
    reading, _ = await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(lines), os.fdopen(ours, "rb", 0))
    try:
        async with spawned(ended_in_order, *command, str(its), shared=(its,)) as process:
            writing.close()  # the pipe ends with the process
            yield process, lines
    finally:
        reading.close()
        writing.close()


async def _listen(
    process: Process, lines: asyncio.StreamReader, tell: Callable[[str], None], other: Callable[[bytes], bool]
) -> tuple[bool, bool]:
    """Pass on the lines until they end. Returns whether there was a sign of life, and whether it fell silent."""
    assert process.stdout is not None
    loop, has_shown = asyncio.get_running_loop(), False
    silences: Silences[str] = Silences(Sight(""))

    def is_alive() -> None:
        silences.set(SIGN, loop.time() + (SILENCE if has_shown else BEGINNING))

    def take(line: bytes) -> None:
        nonlocal has_shown
        if (text := line.decode(errors="replace")) == SIGN:
            has_shown = True
        else:
            tell(text)
        is_alive()

    def take_other(line: bytes) -> None:
        if other(line):
            is_alive()

    is_alive()
    reading = {
        asyncio.create_task(each_line(lines, take)),
        asyncio.create_task(each_line(process.stdout, take_other)),
    }
    left = reading
    try:
        while left:
            patience = min(SILENCE, silences.look - loop.time())
            done, left = await asyncio.wait(left, timeout=patience, return_when=asyncio.FIRST_COMPLETED)
            for each in done:
                each.result()
            if left and silences.due(loop.time()):
                return has_shown, True
        return has_shown, False
    finally:
        for each in reading:
            each.cancel()
        await asyncio.wait(reading)
