"""A process that is watched over: started anew when it hangs or ends, and left alone if it refuses."""

import asyncio
import json
import os
import signal
import sys
from asyncio.subprocess import PIPE, Process
from pathlib import Path
from select import PIPE_BUF, select
from types import SimpleNamespace
from typing import cast

import pytest
import zenoh

from engage_hri.schemas import keys
from engage_hri.services.commandline.robot import router as module
from engage_hri.services.commandline.robot.router import SIGN, watched
from tests.bus.places import free_endpoint
from tests.cli.command import start
from tests.cli.test_processes import PATIENCE, children, gone, line, stopped

pytestmark = pytest.mark.real_time

BEATS = f"""
import itertools, os, signal, sys, time
out = open(int(sys.argv[-1]), "w", buffering=1)
life = len(open(sys.argv[1]).read()) if os.path.exists(sys.argv[1]) else 0
open(sys.argv[1], "a").write("x")
for beat in itertools.count():
    print({SIGN!r}, file=out)
    if beat == 0:
        print("life", life, file=out)
    if life == 0 and beat == 3:
        {{fault}}
    time.sleep(0.05)
"""


SILENT = "it showed no sign of life for 0.5 s; it was killed, and is started anew"


class Watch:
    """A child that has this fault in its first life."""

    def __init__(self, folder: Path, fault: str) -> None:
        self.lines: list[str] = []
        self.warnings: list[str] = []
        self.second = asyncio.Event()
        command = [sys.executable, "-c", BEATS.replace("{fault}", fault), str(folder / "lives")]
        self.task = asyncio.create_task(watched(command, "it", self._tell, self.warnings.append))

    def _tell(self, line: str) -> None:
        self.lines.append(line)
        if line == "life 1":
            self.second.set()

    async def end(self) -> None:
        self.task.cancel()
        await asyncio.wait([self.task])


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        (
            "os.kill(os.getpid(), signal.SIGSTOP)",
            "it showed no sign of life for 0.5 s; it was killed, and is started anew",
        ),
        ("time.sleep(1000)", "it showed no sign of life for 0.5 s; it was killed, and is started anew"),
        ("os.kill(os.getpid(), signal.SIGKILL)", "it ended with signal 9; it is started anew"),
        ("sys.exit(3)", "it ended with exit code 3; it is started anew"),
    ],
)
async def test_one_that_hangs_or_ends_is_started_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str, told: str
) -> None:
    monkeypatch.setattr(module, "SILENCE", 0.5)
    watch = Watch(tmp_path, fault)
    async with asyncio.timeout(PATIENCE):
        await watch.second.wait()
    await watch.end()

    assert watch.lines == ["life 0", "life 1"]
    assert watch.warnings == [told]


async def test_one_that_refuses_before_it_has_begun_is_not_tried_again(tmp_path: Path) -> None:
    lines: list[str] = []
    source = "import os, sys; os.write(int(sys.argv[-1]), b'why'); raise SystemExit(2)"
    async with asyncio.timeout(PATIENCE):
        code = await watched([sys.executable, "-c", source], "it", lines.append, lines.append)

    assert (code, lines) == (2, ["why"])


async def test_its_lines_come_whole_and_in_order_however_they_are_written() -> None:
    """Some are cut anywhere by the pipe; `other` gets what is of standard output. One without its end counts, too."""
    source = """
import sys
out = open(int(sys.argv[-1]), "w")
for number in range(4000):
    print(number, "x" * (number % 300), file=out if number % 3 else sys.stdout)
print("y" * 200_000, "", "the end", sep=chr(10), end="", file=out)
"""
    lines: list[str] = []
    others: list[bytes] = []

    def other(line: bytes) -> bool:
        others.append(line)
        return False

    async with asyncio.timeout(PATIENCE):
        code = await watched([sys.executable, "-c", source], "it", lines.append, lines.append, other)

    written = [f"{number} {'x' * (number % 300)}" for number in range(4000)]
    assert code == 0
    assert [line for line in lines if line[:1].isdigit()] == [line for n, line in enumerate(written) if n % 3]
    assert others == [line.encode() for line in written[::3]]
    assert "(a line too long to show)" in lines
    assert lines[-2:] == ["", "the end"]


async def test_one_whose_output_is_always_full_shows_its_signs_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a flood, of which Zenoh logs each message in many threads."""
    monkeypatch.setattr(module, "SILENCE", 0.5)
    source = f"""
import os, select, sys, threading, time
out = int(sys.argv[-1])
for _ in range(8):
    threading.Thread(target=lambda: [os.write(1, b"authorized\\n" * 300) for _ in iter(int, 1)], daemon=True).start()
end = time.monotonic() + 3.0
while time.monotonic() < end:
    if select.select([], [out], [], 0)[1]:
        os.write(out, {SIGN!r}.encode() + b"\\n")
    time.sleep(0.05)
os.write(out, b"the end\\n")
os._exit(0)
"""
    ended, lines, warnings = asyncio.Event(), list[str](), list[str]()

    def tell(line: str) -> None:
        lines.append(line)
        ended.set()

    task = asyncio.create_task(watched([sys.executable, "-c", source], "it", tell, warnings.append))
    async with asyncio.timeout(PATIENCE):
        await ended.wait()
    task.cancel()
    await asyncio.wait([task])

    assert (lines, warnings) == (["the end"], [])


async def test_a_sign_that_came_while_the_watch_itself_stood_still_is_heard_before_it_judges(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "SILENCE", 0.05)
    lines, other = asyncio.StreamReader(), asyncio.StreamReader()
    process = cast(Process, SimpleNamespace(stdout=other))
    lines.feed_data(f"{SIGN}\n".encode())
    listening = asyncio.create_task(module._listen(process, lines, print, bool))
    for _ in range(9):
        await asyncio.sleep(0)
    loop = asyncio.get_running_loop()
    loop.call_later(0, lines.feed_data, f"{SIGN}\n".encode())
    until = loop.time() + 0.1
    while loop.time() < until:
        pass  # all in this process waits, and the time of the sign before is over
    for _ in range(9):
        await asyncio.sleep(0)
    lines.feed_eof()
    other.feed_eof()

    assert await listening == (True, False)


@pytest.mark.skipif(sys.platform != "linux", reason="looks for children in /proc")
async def test_a_router_whose_lines_nobody_reads_is_watched_over_all_the_same() -> None:
    """As in a terminal that is paused: standard output and standard error are one, and it is full."""
    endpoint = free_endpoint()
    reading, full = os.pipe()
    command = (sys.executable, "-m", "engage_hri", "router", "--listen", endpoint)
    router = await asyncio.create_subprocess_exec(*command, stdin=PIPE, stdout=full, stderr=full)
    try:
        told = b""
        while b"router is ready" not in told:
            told += await asyncio.to_thread(os.read, reading, 2**16)
        while select([], [full], [], 0)[1]:
            os.write(full, bytes(PIPE_BUF))
        (child,) = children(router.pid)
        os.kill(child, signal.SIGSTOP)
        await gone(child)

        async with asyncio.timeout(PATIENCE):
            while not children(router.pid):  # noqa: ASYNC110 - the system tells of no child of another
                await asyncio.sleep(0)
    finally:
        code = await stopped(router)
        os.close(reading)
        os.close(full)

    assert code == 0


@pytest.mark.skipif(sys.platform != "linux", reason="looks for children in /proc")
async def test_a_router_that_is_frozen_is_started_anew_and_all_are_back() -> None:
    endpoint = free_endpoint()
    router = await start("router", "--listen", endpoint)
    try:
        await line(router, "router is ready")
        service = await start("run", "recognition", "--mode", "client", "--connect", endpoint)
        await line(service, "recognition is ready")
        await line(router, "robot: recognition is here", log=False)
        (child,) = children(router.pid)
        os.kill(child, signal.SIGSTOP)

        await line(router, "the router showed no sign of life for 5 s; it was killed, and is started anew")
        await line(router, "router is ready")
        await line(router, "robot: recognition is here", log=False)
        await line(service, "a router is there again")
    finally:
        codes = [await stopped(process) for process in (service, router)]

    assert codes == [0, 0]


@pytest.mark.skipif(sys.platform != "linux", reason="looks for children in /proc")
async def test_a_question_that_never_ends_costs_the_others_some_seconds() -> None:
    """Each `$*` multiplies the time that Zenoh takes to match a token; a dozen of them were ten seconds and more."""
    endpoint = free_endpoint()
    router = await start("router", "--listen", endpoint)

    def visitor() -> zenoh.Session:
        settings = {"mode": "client", "connect/endpoints": [endpoint], "scouting/multicast/enabled": False}
        config = zenoh.Config()
        for key, value in settings.items():
            config.insert_json5(key, json.dumps(value))
        return zenoh.open(config)

    try:
        await line(router, "router is ready")
        service = await start("run", "recognition", "--mode", "client", "--connect", endpoint)
        await line(service, "recognition is ready")
        holder, asker = visitor(), visitor()
        tokens = [holder.liveliness().declare_token(keys.own(f"{number:032x}", "log")) for number in range(20)]
        await line(router, "robot: recognition is here", log=False)
        asker.liveliness().get(keys.own(f"{'$*0' * 12}x", "log"), timeout=1.0)

        await line(router, "the router showed no sign of life for 5 s; it was killed, and is started anew")
        await line(router, "robot: recognition is here", log=False)
        assert len(tokens) == 20
        for session in (holder, asker):
            session.close()  # type: ignore[no-untyped-call]
    finally:
        codes = [await stopped(process) for process in (service, router)]

    assert codes == [0, 0]


@pytest.mark.skipif(sys.platform != "linux", reason="looks for children in /proc")
async def test_a_router_goes_with_who_watches_over_it_and_its_place_is_free() -> None:
    endpoint = free_endpoint()
    first = await start("router", "--listen", endpoint)
    await line(first, "router is ready")
    (child,) = children(first.pid)
    first.kill()
    await gone(child)
    second = await start("router", "--listen", endpoint)
    await line(second, "router is ready")

    third = await start("router", "--listen", endpoint)
    async with asyncio.timeout(PATIENCE):
        out, err = await third.communicate()
    assert (third.returncode, out, err.count(b"\n")) == (3, b"", 1)
    assert await stopped(second, signal.SIGTERM) == 0
    _, complaints = await second.communicate()
    assert complaints == b""
    await first.communicate()


async def test_the_robots_services_have_a_router_of_their_own_and_all_others_see_them_through_it() -> None:
    people, services = free_endpoint(), free_endpoint()
    router = await start("router", "--listen", people, "--robot-listen", services)
    try:
        for _ in range(2):
            await line(router, "router is ready")
        service = await start("run", "recognition", "--mode", "client", "--connect", services)
        await line(service, "recognition is ready")
        for _ in range(2):
            await line(router, "robot: recognition is here", log=False)
    finally:
        codes = [await stopped(process) for process in (service, router)]

    assert codes == [0, 0]
