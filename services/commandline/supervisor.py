"""Keep child processes running: logs with a name before each line, restarts with growing pauses, an orderly end.

A child gets SIGTERM when we are told to stop, SIGKILL if it does not listen, and sees its standard input close if
we die without a word, so that nothing outlives its supervisor.
"""

import asyncio
import logging
import sys
from asyncio.subprocess import PIPE, STDOUT, Process
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager, contextmanager, suppress
from typing import Any

from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.schemas.units import Seconds

LOG = logging.getLogger("engage.up")
Tell = Callable[[str, str], None]
"""Takes a child's name and a line of its log."""
FIRST_PAUSE: Seconds = 0.5
LONGEST_PAUSE: Seconds = 10.0
"""Between a crash and the restart, doubling from the first to the longest."""
STABLE: Seconds = 20.0
"""A child that ran for so long starts over with the first pause."""
PATIENCE: Seconds = 5.0
"""From SIGTERM to SIGKILL."""


def pause_after(previous: Seconds | None, lived: Seconds) -> Seconds:
    """How long to wait before the next start. previous: the pause before, None at the first crash."""
    if previous is None or lived >= STABLE:
        return FIRST_PAUSE
    return min(2 * previous, LONGEST_PAUSE)


@contextmanager
def without_threads() -> Iterator[None]:
    """Python 3.11 watches each child with a thread unless told to use what Linux offers, as later ones do."""
    if sys.version_info >= (3, 12) or sys.platform != "linux":
        yield
        return
    policy = asyncio.get_event_loop_policy()
    before, watcher = policy.get_child_watcher(), asyncio.PidfdChildWatcher()
    watcher.attach_loop(asyncio.get_running_loop())
    policy.set_child_watcher(watcher)
    try:
        yield
    finally:
        policy.set_child_watcher(before)


@asynccontextmanager
async def spawned(
    end: Callable[[Process], Awaitable[None]], *arguments: str, limit: int = 2**16, stderr: int | None = None
) -> AsyncIterator[Process]:
    """A child process while the body of `async with` runs, with pipes to standard input and output. At the end `end`
    must see to it that it has ended; no cancellation cuts that short, however often it comes.

    The child has its own process group: a terminal's Ctrl-C reaches us alone, and we end the children in order.
    """
    creating = asyncio.ensure_future(
        asyncio.create_subprocess_exec(
            *arguments, stdin=PIPE, stdout=PIPE, stderr=stderr, limit=limit, start_new_session=True
        )
    )
    try:
        yield await asyncio.shield(creating)
    finally:
        await _to_its_end(_ended(creating, end))


async def _ended(creating: "asyncio.Future[Process]", end: Callable[[Process], Awaitable[None]]) -> None:
    process = await creating
    await end(process)
    # Only with the last of its pipes is asyncio's own part of it closed; if the loop was sooner it would complain.
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.close()
    while await process.stdout.read(2**16):
        pass


async def _to_its_end(work: Coroutine[Any, Any, None]) -> None:
    """As `await work`, but a cancellation is raised only when that is done."""
    task = asyncio.ensure_future(work)
    cancellation: asyncio.CancelledError | None = None
    while not task.done():
        try:
            await asyncio.shield(task)
        except asyncio.CancelledError as error:
            cancellation = error
    task.result()
    if cancellation is not None:
        raise cancellation


async def killed(process: Process) -> None:
    """End it at once: it holds nothing that needs an orderly end."""
    with suppress(ProcessLookupError):
        process.kill()
    await process.wait()


class Child:
    """One supervised process. once: it may end by itself, with exit code 0, and is then not started again."""

    def __init__(self, name: str, arguments: Sequence[str], tell: Tell, *, once: bool = False) -> None:
        self.name = name
        self.once = once
        self.starts = 0
        self.ended = asyncio.Event()
        self.pid: int | None = None
        self._arguments = arguments
        self._tell = tell

    async def keep(self) -> None:
        """Run it, again after each crash, until cancelled (which stops it), or done if it runs once."""
        loop = asyncio.get_running_loop()
        pause: Seconds | None = None
        while True:
            began = loop.time()
            code = await self._life()
            if self.once and code == 0:
                self.ended.set()
                return
            if code == 2:
                raise ChildRefused(self.name)
            pause = pause_after(pause, loop.time() - began)
            news = f"ended with {ending(code)}; starting it again in {pause:g} s"
            self._tell(self.name, news)
            LOG.warning("%s %s", self.name, news)
            await asyncio.sleep(pause)

    async def _life(self) -> int:
        try:
            async with spawned(self._end, *self._arguments, stderr=STDOUT) as process:
                self.starts += 1
                self.pid = process.pid
                await self._pass_on(process)
                return await process.wait()
        finally:
            self.pid = None

    async def _pass_on(self, process: Process) -> None:
        assert process.stdout is not None
        while line := await _line(process.stdout):
            self._tell(self.name, line.decode(errors="replace").rstrip())

    async def _end(self, process: Process) -> None:
        if process.returncode is not None:
            return
        with suppress(ProcessLookupError):
            process.terminate()
        try:
            async with asyncio.timeout(PATIENCE):
                await self._pass_on(process)
                await process.wait()
        except TimeoutError:
            self._tell(self.name, f"did not end within {PATIENCE:g} s; killed")
            await killed(process)


class ChildRefused(RunFailed):
    """A child ended with exit code 2: what it was given is wrong, and would be wrong again."""

    def __init__(self, name: str) -> None:
        super().__init__(Fault(reason=f"{name} could not start", advice="its log says why"))


async def _line(stream: asyncio.StreamReader) -> bytes:
    try:
        return await stream.readline()
    except ValueError:
        return b"(a line too long to show)\n"


def ending(code: int) -> str:
    """How a process ended, from its return code as asyncio has it."""
    return f"signal {-code}" if code < 0 else f"exit code {code}"


@asynccontextmanager
async def supervised(children: Mapping[str, Child]) -> AsyncIterator[None]:
    """Keep the children running while the body of `async with` runs; at its end all have ended, last first."""
    with without_threads():
        async with asyncio.TaskGroup() as group:
            tasks = [group.create_task(child.keep(), name=f"child {name}") for name, child in children.items()]
            try:
                yield
            finally:
                for task in reversed(tasks):
                    task.cancel()
