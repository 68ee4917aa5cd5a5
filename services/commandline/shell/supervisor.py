"""Supervision of child processes: logs with a name before each line, restarts with growing pauses, an orderly end.

At the end a child gets SIGTERM, then SIGKILL if it does not end in time. If the supervisor is killed, the child sees
its standard input close. So no child outlives its supervisor.
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
from engage_hri.services.commandline.shell.process import REFUSED, UNREADY, left

LOG = logging.getLogger("engage.up")
Tell = Callable[[str, str], None]
"""Receiver of a child's name and a line of its log."""
FIRST_PAUSE: Seconds = 0.5
LONGEST_PAUSE: Seconds = 10.0
"""Pauses between a crash and the restart; each is twice the one before."""
STABLE: Seconds = 20.0
"""Running time after which the next pause is the first one again."""
PATIENCE: Seconds = 5.0
"""Time from SIGTERM to SIGKILL."""


LONGEST = 2**17
"""Bytes of a line that is passed on: a key in Zenoh's log has up to 2**16."""


def pause_after(previous: Seconds | None, lived: Seconds) -> Seconds:
    """Pause before the next start. previous: the pause before that, None at the first crash."""
    if previous is None or lived >= STABLE:
        return FIRST_PAUSE
    return min(2 * previous, LONGEST_PAUSE)


@contextmanager
def without_threads() -> Iterator[None]:
    """Make Python 3.11 watch children without a thread for each, as later versions do on Linux."""
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
    end: Callable[[Process], Awaitable[object]],
    *arguments: str,
    limit: int = 2**16,
    stderr: int | None = None,
    shared: Sequence[int] = (),
) -> AsyncIterator[Process]:
    """Run a child process while the body of `async with` runs, with pipes to standard input and output.

    end: is called at the end, and must end the process; cancellations do not cut it short. shared: files of ours that
    are open in it, too, with the same numbers. The child has its own process group: a terminal's Ctrl-C reaches only
    us, and we end the children in order.
    """
    creating = asyncio.ensure_future(
        asyncio.create_subprocess_exec(
            *arguments, stdin=PIPE, stdout=PIPE, stderr=stderr, limit=limit, start_new_session=True, pass_fds=shared
        )
    )
    try:
        yield await asyncio.shield(creating)
    finally:
        await _uncancelled(_ended(creating, end))


async def _ended(creating: "asyncio.Future[Process]", end: Callable[[Process], Awaitable[object]]) -> None:
    process = await creating
    await end(process)
    # asyncio closes its own part with the last pipe; it complains if the loop is closed before.
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.close()
    await _drained(process)


async def each_line(stream: asyncio.StreamReader, take: Callable[[bytes], None]) -> None:
    """Take each line of a stream, in pieces: whoever waits for each line of a flood holds up who writes it."""
    rest = b""
    while piece := await stream.read(LONGEST):
        *lines, rest = (rest + piece).split(b"\n")
        if len(rest) > LONGEST:
            lines.append(rest)
            rest = b""
        for line in lines:
            take(line if len(line) <= LONGEST else b"(a line too long to show)")
    if rest:
        take(rest)


async def _drained(process: Process) -> None:
    assert process.stdout is not None
    while await process.stdout.read(2**16):
        pass


async def _uncancelled(work: Coroutine[Any, Any, None]) -> None:
    """Await `work` to its end; a cancellation is raised only after that."""
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
    """Kill a process that needs no orderly end."""
    with suppress(ProcessLookupError):
        process.kill()
    await process.wait()


async def ended_in_order(process: Process, read: Callable[[Process], Awaitable[None]] = _drained) -> bool:
    """End a process, if it still runs: by SIGTERM, and by SIGKILL after `PATIENCE`. Returns False if it was killed.

    read: reads its output to the end, so that it is not kept from ending by a full pipe.
    """
    if process.returncode is not None:
        return True
    with suppress(ProcessLookupError):
        process.terminate()
    try:
        async with asyncio.timeout(PATIENCE):
            await read(process)
            await process.wait()
    except TimeoutError:
        await killed(process)
        return False
    return True


class Child:
    """A supervised process. once: it may end by itself, with exit code 0, and is then not started again."""

    def __init__(self, name: str, arguments: Sequence[str], tell: Tell, *, once: bool = False) -> None:
        self.name = name
        self.once = once
        self.starts = 0
        self.ended = asyncio.Event()
        self.pid: int | None = None
        self._arguments = arguments
        self._tell = tell

    async def keep(self) -> None:
        """Run the process, again after each crash, until cancelled (which stops it), or done if it runs once."""
        loop = asyncio.get_running_loop()
        pause: Seconds | None = None
        while True:
            began = loop.time()
            code = await self._life()
            if self.once and code == 0:
                self.ended.set()
                return
            if code in (REFUSED, UNREADY):
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
                left.add(self.name)
                await self._pass_on(process)
                return await process.wait()
        finally:
            self.pid = None
            left.discard(self.name)

    async def _pass_on(self, process: Process) -> None:
        assert process.stdout is not None
        await each_line(process.stdout, lambda line: self._tell(self.name, line.decode(errors="replace").rstrip()))

    async def _end(self, process: Process) -> None:
        if not await ended_in_order(process, self._pass_on):
            self._tell(self.name, f"did not end within {PATIENCE:g} s; killed")


class ChildRefused(RunFailed):
    """A child was refused: its input is wrong, or not what it has to be as things stand."""

    def __init__(self, name: str) -> None:
        super().__init__(Fault(reason=f"{name} could not start", advice="its own message above says why"))


def ending(code: int) -> str:
    """Words for the end of a process. code: the return code as asyncio gives it, negative for a signal."""
    return f"signal {-code}" if code < 0 else f"exit code {code}"


@asynccontextmanager
async def supervised(children: Mapping[str, Child]) -> AsyncIterator[None]:
    """Keep children running while the body of `async with` runs; at its end all are ended, the last one first."""
    with without_threads():
        async with asyncio.TaskGroup() as group:
            tasks = [group.create_task(child.keep(), name=f"child {name}") for name, child in children.items()]
            try:
                yield
            finally:
                for task in reversed(tasks):
                    task.cancel()
