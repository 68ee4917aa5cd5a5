"""The real command line as processes of their own, over real sockets. Nothing sleeps: each wait is for something."""

import asyncio
import os
import re
import signal
from asyncio.subprocess import Process
from contextlib import suppress
from pathlib import Path

import pytest

from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.commandline.shell.process import UNREADY
from engage_hri.services.commandline.shell.roster import PLAY, ROBOT
from tests.bus.places import free_endpoint
from tests.cli.command import FRAGMENT, GOOD_BLOCK, start, threads

pytestmark = pytest.mark.real_time

PATIENCE = 30
ZENOH = re.compile(r"(acc|app|net|rx|tx)-\d+")
"""How Zenoh's runtime names its threads."""


@pytest.fixture
def endpoint() -> str:
    """Where nobody listens yet."""
    return free_endpoint()


async def line(process: Process, text: str, *, log: bool = True) -> str:
    """The next line of its standard error (or output) with this text in it."""
    stream = process.stderr if log else process.stdout
    assert stream is not None
    seen = []
    async with asyncio.timeout(PATIENCE):
        while raw := await stream.readline():
            seen.append(raw.decode())
            if text in seen[-1]:
                return seen[-1]
    raise AssertionError(f"ended without {text!r}: {''.join(seen)}")


async def stopped(process: Process, how: signal.Signals = signal.SIGINT) -> int:
    """Its exit code, once stopped."""
    if process.returncode is None:
        process.send_signal(how)
    async with asyncio.timeout(PATIENCE):
        await process.communicate()
    assert process.returncode is not None
    return process.returncode


async def gone(pid: int) -> None:
    """Wait until a process that is not our child has ended."""
    try:
        handle = os.pidfd_open(pid)
    except ProcessLookupError:
        return
    loop = asyncio.get_running_loop()
    ended = asyncio.Event()
    loop.add_reader(handle, ended.set)
    try:
        async with asyncio.timeout(PATIENCE):
            await ended.wait()
    finally:
        loop.remove_reader(handle)
        os.close(handle)


async def strangers(pid: int) -> list[str]:
    """Threads that are not Zenoh's. Its own carry our name for the instant until they have named themselves."""
    found: list[str] = []
    with suppress(TimeoutError):
        async with asyncio.timeout(5):
            # Nothing tells when; the pause lets the timeout through.
            while found := [thread for thread in threads(pid) if not ZENOH.fullmatch(thread)]:  # noqa: ASYNC110
                await asyncio.sleep(0)
    return found


def children(pid: int) -> list[int]:
    return list(map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split()))


async def test_a_running_demo_has_one_thread() -> None:
    demo = await start("demo", "--quiet", "--feedback", "-")
    try:
        await line(demo, "sync_point_progress", log=False)

        assert threads(demo.pid) == []
    finally:
        await stopped(demo)

    assert demo.returncode == 130


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
async def test_a_signal_while_it_still_loads_ends_it_without_a_word(how: signal.Signals, tmp_path: Path) -> None:
    (tmp_path / "typer.py").write_text("import sys\nprint('loading', flush=True)\nsys.stdin.read()\n")
    demo = await start("demo", PYTHONPATH=str(tmp_path))
    try:
        await line(demo, "loading", log=False)
        demo.send_signal(how)
        async with asyncio.timeout(PATIENCE):
            _, err = await demo.communicate()
    finally:
        await stopped(demo, signal.SIGKILL)

    assert (demo.returncode, err) == (128 + how, b"")


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
async def test_a_signal_ends_what_was_started_with_ctrl_c_ignored(how: signal.Signals) -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as a shell does to `engage demo &`
    try:
        demo = await start("demo", "--quiet", "--feedback", "-")
    finally:
        signal.signal(signal.SIGINT, before)
    await line(demo, "block_progress", log=False)
    demo.send_signal(how)
    async with asyncio.timeout(PATIENCE):
        _, err = await demo.communicate()

    assert (demo.returncode, err) == (128 + how, b"")


async def test_a_second_sigterm_says_nothing_new(tmp_path: Path, endpoint: str) -> None:
    log = tmp_path / "log"
    up = await start("up", "--listen", endpoint, "--log", log)
    try:
        await line(up, "all services are up", log=False)
        for _ in range(3):
            up.send_signal(signal.SIGTERM)
        async with asyncio.timeout(PATIENCE):
            _, err = await up.communicate()
    finally:
        await stopped(up, signal.SIGKILL)

    assert (up.returncode, err) == (0, b"")
    assert "ERROR" not in log.read_text()
    assert [log.read_text().count(f"INFO peers: peer {name}: here, ") for name in ROBOT] == [1] * len(ROBOT)


@pytest.mark.parametrize(
    "arguments", [("demo", "--virtual-time"), ("demo", "--virtual-time", "--quiet", "--feedback", "-")]
)
async def test_a_reader_who_has_had_enough_ends_it_without_a_word(arguments: tuple[str, ...]) -> None:
    ours, theirs = os.pipe()
    demo = await start(*arguments, stdout=theirs)
    os.close(theirs)
    with os.fdopen(ours) as reader:
        assert reader.readline()
    async with asyncio.timeout(PATIENCE):
        _, err = await demo.communicate()

    assert (demo.returncode, err) == (141, b"")


COMMANDS_THAT_PRINT = {
    "plan": ("plan", "ask.xml"),
    "bml": ("bml", "ask.xml"),
    "plan with reasons": ("plan", "ask.xml", "--why"),
    "reasons as json": ("plan", "ask.xml", "--why", "--format", "json"),
    "tool": ("tool",),
    "play": ("play", "ask.xml", "--embedded", "--virtual-time"),
    "simulate": ("simulate", "--limit", "12", "--sessions", "2", "--jobs", "2", "--out", "study"),
    "help": ("--help",),
    "version": ("--version",),
}


@pytest.mark.parametrize("arguments", COMMANDS_THAT_PRINT.values(), ids=COMMANDS_THAT_PRINT)
async def test_with_no_reader_at_all_every_command_ends_as_the_shell_expects(
    arguments: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "ask.xml").write_text(FRAGMENT)
    ours, theirs = os.pipe()
    os.close(ours)
    places = {"ask.xml": tmp_path / "ask.xml", "study": tmp_path / "study"}
    process = await start(*(places.get(each, each) for each in arguments), stdout=theirs)
    os.close(theirs)
    async with asyncio.timeout(PATIENCE):
        _, err = await process.communicate()

    assert (process.returncode, err) == (128 + signal.SIGPIPE, b"")


async def test_output_that_finds_no_room_is_a_failure_in_one_line() -> None:
    full = os.open("/dev/full", os.O_WRONLY)
    process = await start("tool", stdout=full)
    os.close(full)
    async with asyncio.timeout(PATIENCE):
        _, err = await process.communicate()

    assert (process.returncode, err) == (3, b"cannot write the output: No space left on device\n")


async def test_each_service_runs_alone_with_only_zenohs_threads_and_stops_on_a_signal() -> None:
    arguments = ("--robot", "alone", "--listen", "tcp/127.0.0.1:0")
    services = {name: await start("run", name, *arguments) for name in PLAY}
    try:
        found = {}
        for name, process in services.items():
            await line(process, f"{name} is ready")
            found[name] = await strangers(process.pid)

        assert found == {name: [] for name in PLAY}
    finally:
        codes = {name: await stopped(process, signal.SIGTERM) for name, process in services.items()}

    assert codes == dict.fromkeys(PLAY, 0)


async def test_up_performs_what_is_played_and_ctrl_c_ends_all_of_it(endpoint: str, tmp_path: Path) -> None:
    (tmp_path / "block.xml").write_text(GOOD_BLOCK)
    (tmp_path / "bad.xml").write_text(FRAGMENT.replace('turnStatus="full"', 'turnStatus="end"'))
    up = await start("up", "--robot", "upright", "--listen", endpoint)
    try:
        await line(up, "all services are up", log=False)
        offspring = children(up.pid)
        where = ("--robot", "upright", "--connect", endpoint)
        codes = {}
        for name in ("bad.xml", "block.xml", "block.xml"):
            play = await start("play", *where, "--feedback", tmp_path / "feedback", tmp_path / name)
            async with asyncio.timeout(PATIENCE):
                out, err = await play.communicate()
            codes[name] = play.returncode

        assert codes == {"bad.xml": 2, "block.xml": 0}, err
        assert b"block hello: done" in out
        # The second time only the second performance is told, though the bus still has the first.
        assert (tmp_path / "feedback").read_text().count('"progress":"end"') == 1
        assert len(offspring) == 5
        assert await strangers(up.pid) == []
    finally:
        code = await stopped(up)

    assert code == 0
    for pid in offspring:
        await gone(pid)


async def test_a_second_one_of_a_robot_is_refused_and_the_first_goes_on(endpoint: str, tmp_path: Path) -> None:
    (tmp_path / "wait.xml").write_text('<bml id="w"><wait id="p" duration="6"/></bml>')
    where = ("--robot", "only", "--connect", endpoint)
    up = await start("up", "--robot", "only", "--listen", endpoint)
    try:
        await line(up, "all services are up", log=False)
        play = await start("play", "-v", *where, tmp_path / "wait.xml")
        await line(play, "w:p:start", log=False)
        second = [await start("up", *where), await start("run", "realizer", *where)]
        async with asyncio.timeout(PATIENCE):
            told = [(await process.communicate())[1].decode() for process in second]
            _, err = await play.communicate()

        assert [process.returncode for process in second] == [UNREADY, UNREADY]
        assert told[0].startswith("up: robot 'only' has this on the bus already (stop what runs there")
        assert told[1].startswith("realizer: robot 'only' has this on the bus already (stop what runs there")
        assert [text.count("\n") for text in told] == [1, 1]
        assert (play.returncode, err) == (0, b"")
    finally:
        await stopped(up)


def processes_of(robot: str) -> list[int]:
    """All that were started for it, by us or by one of those."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if f"\0{robot}\0".encode() in (place / "cmdline").read_bytes():
                found.append(int(place.name))
    return found


@pytest.mark.parametrize("time", range(3))
async def test_of_two_that_are_started_at_once_exactly_one_goes_on(endpoint: str, time: int) -> None:
    robot = f"twins-{os.getpid()}-{time}"
    twins = [await start("up", "--robot", robot, how, endpoint) for how in ("--listen", "--connect")]
    ends = [asyncio.create_task(twin.wait()) for twin in twins]
    try:
        async with asyncio.timeout(PATIENCE):
            await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        loser, winner = sorted(twins, key=lambda twin: twin.returncode is None)
        out, err = await loser.communicate()
        await line(winner, "all services are up", log=False)

        assert loser.returncode == UNREADY
        assert b"all services are up" not in out
        assert err.startswith(b"up: robot '%s' has this on the bus " % robot.encode())
        assert err.count(b"\n") == 1
        assert sorted(processes_of(robot)) == sorted([winner.pid, *children(winner.pid)])
        assert len(children(winner.pid)) == 5
    finally:
        for twin in twins:
            await stopped(twin)

    assert winner.returncode == 0
    assert processes_of(robot) == []


async def test_a_killed_service_may_come_back_at_once(endpoint: str) -> None:
    where = ("--robot", "phoenix", "--connect", endpoint)
    realizer = await start("run", "realizer", "--robot", "phoenix", "--listen", endpoint)
    control = await start("run", "control", *where)
    try:
        await line(realizer, "realizer is ready")
        await line(control, "control is ready")
        for how in (signal.SIGKILL, signal.SIGSTOP):
            # Who is stopped seems to be there until its lease is over.
            control.send_signal(how)
            former, control = control, await start("run", "control", *where)
            await line(control, "control is ready")
            await stopped(former, signal.SIGKILL)
    finally:
        codes = [await stopped(process) for process in (control, realizer)]

    assert codes == [0, 0]


async def test_services_do_not_outlive_a_killed_supervisor(endpoint: str) -> None:
    up = await start("up", "--robot", "orphans", "--listen", endpoint)
    try:
        await line(up, "all services are up", log=False)
        offspring = children(up.pid)
    finally:
        await stopped(up, signal.SIGKILL)

    for pid in offspring:
        await gone(pid)


@pytest.mark.parametrize(("text", "server"), [(GOOD_BLOCK, b"realizer"), (FRAGMENT, b"generation")])
async def test_playing_to_nobody_fails_readably(endpoint: str, tmp_path: Path, text: str, server: bytes) -> None:
    (tmp_path / "it.xml").write_text(text)
    (tmp_path / "it-again.xml").write_text(text)
    files = (tmp_path / "it.xml", tmp_path / "it-again.xml")
    async with await open_hub("somebody", listen=[endpoint]):
        play = await start("play", "--robot", "nobody", "--connect", endpoint, *files)
        async with asyncio.timeout(PATIENCE):
            _, err = await play.communicate()

    assert play.returncode == 3
    assert b"is %s running?" % server in err
    assert b"no answer within 5 s" in err
    hint, reason = err.splitlines()  # one patience for all
    assert b"no robot 'nobody' here yet" in hint
    assert b"no answer" in reason


async def test_watch_prints_json_lines_of_a_running_system(endpoint: str, tmp_path: Path) -> None:
    watch = await start("watch", "--json", "--robot", "seen", "--connect", endpoint)
    realizer = await start("run", "realizer", "--robot", "seen", "--listen", endpoint)
    control = await start("run", "control", "--robot", "seen", "--connect", endpoint)
    try:
        await line(realizer, "realizer is ready")
        await line(control, "control is ready")
        (tmp_path / "wait.xml").write_text('<bml id="w"><wait id="p" duration="0.1"/></bml>')
        play = await start("play", "--robot", "seen", "--connect", endpoint, tmp_path / "wait.xml")
        async with asyncio.timeout(PATIENCE):
            _, err = await play.communicate()
        assert play.returncode == 0, err
        seen = await line(watch, "block_progress", log=False)

        assert '"block":"w"' in seen
    finally:
        codes = [await stopped(process) for process in (watch, control, realizer)]

    assert codes == [0, 0, 0]


async def test_of_two_services_of_one_name_that_are_started_at_once_exactly_one_goes_on(endpoint: str) -> None:
    where = ("--robot", f"one-name-{os.getpid()}", "--connect", endpoint, "--mode", "client")
    router = await start("router", "--listen", endpoint)
    twins = []
    try:
        await line(router, "router is ready")
        twins = [await start("run", "control", *where) for _ in range(2)]
        ends = [asyncio.create_task(twin.wait()) for twin in twins]
        async with asyncio.timeout(PATIENCE):
            await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        loser, winner = sorted(twins, key=lambda twin: twin.returncode is None)
        _, err = await loser.communicate()

        assert loser.returncode == UNREADY
        assert b"has this on the bus " in err
        assert winner.returncode is None
    finally:
        for process in (*twins, router):
            await stopped(process)
