"""Watch over one child process: it shows signs of life, and is started anew when it shows none, or ends."""

import asyncio
from asyncio.subprocess import Process
from collections.abc import Callable, Sequence

from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.supervisor import ended_in_order, ending, killed, spawned, without_threads

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
LONGEST = 2**16
"""Bytes of a line that is passed on."""


async def watched(
    command: Sequence[str],
    name: str,
    tell: Callable[[str], None],
    warn: Callable[[str], None],
    mark: bytes = b"",
    other: Callable[[bytes], bool] = lambda line: False,
) -> int:
    """Run a process until cancelled, and again whenever it hangs or ends. Returns the exit code of one that refuses.

    One that ends by itself before its first sign refuses to run: it has said why. name: of the process, for people.
    tell: gets the lines of its standard output that begin with `mark`. other: gets all that do not, and says of each
    whether it is a sign of life. warn: gets what became of it.
    """
    loop = asyncio.get_running_loop()
    with without_threads():
        while True:
            began = loop.time()
            async with spawned(_end, *command) as process:
                has_shown, is_silent = await _listen(process, tell, mark, other)
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


async def _listen(
    process: Process, tell: Callable[[str], None], mark: bytes, other: Callable[[bytes], bool]
) -> tuple[bool, bool]:
    """Pass on the lines until they end. Returns whether there was a sign of life, and whether it fell silent."""
    assert process.stdout is not None
    loop = asyncio.get_running_loop()
    has_shown, deadline, rest = False, loop.time() + BEGINNING, b""
    while True:
        try:
            async with asyncio.timeout_at(deadline):
                # In pieces: whoever waits for each line of a flood holds up the process that writes it.
                piece = await process.stdout.read(LONGEST)
        except TimeoutError:
            return has_shown, True
        *lines, rest = (rest + piece).split(b"\n")
        if len(rest) > LONGEST or (rest and not piece):
            lines.append(rest)
            rest = b""
        for raw in lines:
            line = raw if len(raw) <= LONGEST else mark + b"(a line too long to show)"
            if line.startswith(mark):
                text = line.removeprefix(mark).decode(errors="replace")
                if text == SIGN:
                    has_shown = True
                else:
                    tell(text)
            elif not other(line):
                continue
            deadline = loop.time() + (SILENCE if has_shown else BEGINNING)
        if not piece:
            return has_shown, False


async def _end(process: Process) -> None:
    await ended_in_order(process, _drained)


async def _drained(process: Process) -> None:
    assert process.stdout is not None
    while await process.stdout.read(2**16):
        pass
