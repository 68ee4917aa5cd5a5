"""What `engage up` does with its children: real processes, no sleeping."""

import asyncio
import os
import signal
import sys
from asyncio.subprocess import Process

import pytest

from engage_hri.services.commandline.shell.supervisor import (
    FIRST_PAUSE,
    LONGEST_PAUSE,
    STABLE,
    Child,
    ChildRefused,
    killed,
    pause_after,
    spawned,
    supervised,
)


class Logs:
    """What children said, and a way to wait for it."""

    def __init__(self) -> None:
        self.lines: asyncio.Queue[tuple[str, str]] = asyncio.Queue()

    def __call__(self, name: str, line: str) -> None:
        self.lines.put_nowait((name, line))

    async def until(self, text: str) -> str:
        async with asyncio.timeout(20):
            while text not in (line := (await self.lines.get())[1]):
                pass
            return line


def python(code: str) -> list[str]:
    return [sys.executable, "-u", "-c", code]


def test_the_pause_doubles_up_to_a_limit_and_starts_over_after_a_good_while() -> None:
    pauses = [pause_after(None, 0.1)]
    for _ in range(6):
        pauses.append(pause_after(pauses[-1], 0.1))

    assert pauses == [FIRST_PAUSE, 1.0, 2.0, 4.0, 8.0, LONGEST_PAUSE, LONGEST_PAUSE]
    assert pause_after(LONGEST_PAUSE, STABLE) == FIRST_PAUSE


@pytest.mark.real_time
async def test_a_crashed_child_is_started_again() -> None:
    logs = Logs()
    child = Child("a", python("import sys, time; print('alive'); sys.stdin.read()"), logs)

    async with supervised({"a": child}):
        await logs.until("alive")
        assert child.pid is not None
        os.kill(child.pid, signal.SIGKILL)
        said = await logs.until("starting it again")
        await logs.until("alive")

    assert "signal 9" in said
    assert child.starts == 2
    assert child.pid is None


@pytest.mark.real_time
async def test_at_the_end_children_get_sigterm_and_their_last_words_are_heard() -> None:
    logs = Logs()
    code = (
        "import signal, sys\n"
        "signal.signal(signal.SIGTERM, lambda *_: (print('goodbye'), sys.exit(0)))\n"
        "print('alive')\n"
        "sys.stdin.read()"
    )

    async with supervised({"a": Child("a", python(code), logs)}):
        await logs.until("alive")

    assert await logs.until("goodbye")


@pytest.mark.real_time
async def test_a_child_that_runs_once_may_end() -> None:
    child = Child("a", python("print('done')"), Logs(), once=True)

    async with supervised({"a": child}):
        async with asyncio.timeout(20):
            await child.ended.wait()

    assert child.starts == 1


@pytest.mark.real_time
async def test_a_refused_child_ends_everything() -> None:
    child = Child("a", python("import sys; sys.exit(2)"), Logs())

    with pytest.raises(ExceptionGroup) as caught:
        async with supervised({"a": child}):
            await child.ended.wait()

    assert caught.group_contains(ChildRefused, match=r"a could not start \(its own message above says why\)")


@pytest.mark.real_time
async def test_a_child_is_seen_to_its_end_however_often_its_keeper_is_cancelled() -> None:
    ending, may_end = asyncio.Event(), asyncio.Event()
    ended: list[int | None] = []

    async def end(process: Process) -> None:
        ending.set()
        await may_end.wait()
        await killed(process)
        ended.append(process.returncode)

    async def keep() -> None:
        async with spawned(end, *python("import sys; sys.stdin.read()")) as process:
            await process.wait()

    keeper = asyncio.create_task(keep())
    await asyncio.sleep(0)
    keeper.cancel()  # while it is being created
    async with asyncio.timeout(20):
        await ending.wait()
        keeper.cancel()
        await asyncio.sleep(0)
        assert not keeper.done()
        may_end.set()
        await asyncio.gather(keeper, return_exceptions=True)

    assert keeper.cancelled()
    assert ended == [-signal.SIGKILL]
