"""Command `engage router`: passes on what the processes of several machines send one another.

All robots of a site go through it, and a router that hangs is worse than one that has died: links stay, and nothing
comes. So it runs in a process of its own that shows signs of life, and is started anew when it shows none, or ends.
"""

import asyncio
import os
import re
import sys
from asyncio.subprocess import Process
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from engage_hri.schemas.access import ROUTER
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.config import is_encrypted
from engage_hri.services.bus.deadlines import Sight, Silences
from engage_hri.services.bus.keyring import Keys, read_keys
from engage_hri.services.commandline.shell.outputs import LOG, Patient, beneath, complain, without_waiting
from engage_hri.services.commandline.shell.process import FAILED, first_of, run_until_signal, until_closed
from engage_hri.services.commandline.shell.supervisor import (
    each_line,
    ended_in_order,
    ending,
    killed,
    spawned,
    without_threads,
)
from engage_hri.services.runtime.configuration import bus_config

FILES = 8192
"""Files that a router may have open, for links, and more of them that are about to open."""
ZENOH_THREADS = "(rx: (worker_threads: 32))"
"""Threads of Zenoh that receive; it has two. One is busy for up to 10 s with closing the link of a machine that was
cut off, and while all are, the router hears nobody, of no robot."""
ARENAS = "2"
"""Heaps among which the C library spreads what these threads take; else eight for each core. Floods of questions then
leave holes in all of them: after twenty the router had 120 MB, with two it has 81, and grows no more."""


@dataclass(frozen=True, kw_only=True)
class Options:
    listen: Annotated[
        list[str],
        typer.Option(
            metavar="ENDPOINT", help="Where others connect: tcp/0.0.0.0:7447; may be repeated.", show_default=False
        ),
    ]
    connect: Annotated[
        list[str] | None, typer.Option(metavar="ENDPOINT", help="Another router; may be repeated.")
    ] = None
    keys: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Keys made by `engage keys`: strangers are refused, and all have a role.",
            show_default="open to all",
        ),
    ] = None  # fmt: skip
    robot_listen: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT", help="Where the robot's services connect: a router of their own, joined to this one."
            " Whoever fills this one takes no place of theirs. May be repeated.",
        ),
    ] = None  # fmt: skip
    attended: Annotated[int, typer.Option("--attended", hidden=True)] = 0


def main(options: Options) -> int:
    """Route until a signal, in a process of its own that is watched over.

    options: attended: number of the pipe to whoever watches over this process.
    """
    keys = _keys(options)
    if options.attended:
        os.environ.setdefault("ZENOH_RUNTIME", ZENOH_THREADS)  # read when the first session opens
        return run_until_signal(_route(options, keys))
    return run_until_signal(_watch(options))


async def _watch(options: Options) -> int:
    """Watch over the router, or the robot's and that of all others. Returns the exit code of one that refuses."""
    from engage_hri.services.bus.zenoh.denials import Denials

    connect = options.connect or []
    os.environ.setdefault("MALLOC_ARENA_MAX", ARENAS)  # read when a process starts
    commands = {"the router": _command(options, options.listen, connect)}
    if options.robot_listen:
        near = [_from_here(endpoint) for endpoint in options.robot_listen]
        commands = {
            "the robot's router": _command(options, options.robot_listen, connect),
            "the router of all others": _command(options, options.listen, near),
        }
    tell = _teller("standard output", beneath(sys.stdout).fileno())
    return await first_of(
        *(
            watched([*each, "--attended"], name, tell, LOG.warning, Denials(tell).feed)
            for name, each in commands.items()
        )
    )


def _keys(options: Options) -> Keys | None:
    """Read the keys. Raises InputRefused if they are not a router's, or an endpoint does not go with them."""
    folder = bus_config(keys=str(options.keys or "")).keys
    endpoints = (*options.listen, *(options.robot_listen or ()), *(options.connect or ()))
    if not folder:
        if closed := [each for each in endpoints if is_encrypted(each)]:
            advice = "--keys FOLDER names those that `engage keys` has made"
            raise InputRefused(Fault(reason=f"{closed[0]!r} without keys", where="engage router", advice=advice))
        return None
    own = read_keys(folder, ROUTER)
    if own.holder.role != ROUTER:
        reason = f"these are the keys of {own.holder.common_name}, not of a router"
        raise InputRefused(Fault(reason=reason, where=str(own.folder)))
    if plain := [each for each in endpoints if not is_encrypted(each)]:
        raise InputRefused(Fault(reason=f"{plain[0]!r} with keys", where=str(own.folder), advice="tls/HOST:PORT"))
    return own


def _from_here(endpoint: str) -> str:
    """Endpoint at which this machine reaches what listens at one for all machines."""
    return re.sub(r"/(?:0\.0\.0\.0|\[::\]):", "/localhost:", endpoint)


def _command(options: Options, listen: list[str], connect: list[str]) -> list[str]:
    """Make the command line of a router's process."""
    return [
        *(sys.executable, "-P", "-m", "engage_hri", "router"),
        *(part for endpoint in listen for part in ("--listen", endpoint)),
        *(part for endpoint in connect for part in ("--connect", endpoint)),
        *(("--keys", str(options.keys)) if options.keys else ()),
    ]


def _teller(name: str, number: int) -> Callable[[str], None]:
    """name, number: of the file to which lines go."""
    out = Patient(name, partial(without_waiting, number), LOG.warning)

    def tell(line: str) -> None:
        out.write(f"{line}\n")

    return tell


async def _route(options: Options, keys: Keys | None) -> None:
    from engage_hri.services.bus.zenoh.router import routing
    from engage_hri.services.bus.zenoh.session import MOST_SESSIONS

    tell = _teller("the watch", options.attended)

    def sign() -> None:
        """Show a sign of life, in whatever thread: past what the loop has to write."""
        without_waiting(options.attended, f"{SIGN}\n".encode())

    _let_in_many()
    async with (
        routing(options.listen, options.connect or (), tell, keys, sign) as router,
        asyncio.TaskGroup() as group,
    ):
        complain(f"router is ready at {', '.join(options.listen)} (at most {MOST_SESSIONS} links)")
        group.create_task(_show(router.works, lambda: tell(SIGN)), name="signs of life")
        await until_closed()
        os._exit(FAILED)  # Who watched over it was killed, and may be started again at the same endpoints.


def _let_in_many() -> None:
    """Let this process have as many open files as it may: each link is one, and many systems begin with 1024."""
    with suppress(ImportError, OSError, ValueError):
        from resource import RLIMIT_NOFILE, getrlimit, setrlimit

        soft, hard = getrlimit(RLIMIT_NOFILE)
        setrlimit(RLIMIT_NOFILE, (max(soft, min(FILES, hard) if hard >= 0 else FILES), hard))


async def _show(works: Callable[[], Awaitable[None]], sign: Callable[[], None]) -> None:
    while True:
        await works()
        sign()
        await asyncio.sleep(EVERY)


# -- the watch over it -----------------------------------------------------------------------------------------

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
