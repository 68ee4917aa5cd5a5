"""The example in C prints what recognition says. It needs a C compiler and zenoh-pico, which no package index has."""

import json
import shlex
import shutil
import subprocess
from asyncio import StreamReader, create_subprocess_exec, create_task, timeout
from asyncio.subprocess import PIPE
from pathlib import Path

import pytest

from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.services.client.feeds import EventFeed
from tests.bus.places import free_endpoint
from tests.cli.test_processes import PATIENCE, stopped
from tests.cli.test_watch import MUTUAL, Scene, scene

SOURCE = Path(__file__).parents[2] / "examples" / "connection_events.c"

pytestmark = pytest.mark.real_time


def built(folder: Path) -> Path:
    """The program. Skips where it cannot be built; a warning of the compiler is a failure."""
    compiler, pkg_config = shutil.which("cc"), shutil.which("pkg-config")
    if compiler is None or pkg_config is None:
        pytest.skip("no C compiler, or no pkg-config")
    found = subprocess.run([pkg_config, "--cflags", "--libs", "zenohpico"], capture_output=True, text=True)
    if found.returncode != 0:
        pytest.skip("zenoh-pico is not installed (docs/other-languages.md)")
    program = folder / "connection_events"
    flags = ["-Wall", "-Wextra", "-Werror", "-DZENOH_LINUX", *shlex.split(found.stdout)]
    libraries = [f"-Wl,-rpath,{each[2:]}" for each in flags if each.startswith("-L")]
    subprocess.run([compiler, str(SOURCE), *flags, *libraries, "-o", str(program)], check=True)
    return program


def told(event: ConnectionEvent) -> tuple[str, str]:
    return event.id, event.state


async def printed_next(output: StreamReader) -> tuple[str, str]:
    event = json.loads(await output.readline())
    return event["id"], event["state"]


async def an_event(our: Scene, events: EventFeed) -> list[ConnectionEvent]:
    """Robot and person look at one another until one looks away: what the client is told of it."""
    our.look("robot", "ann")
    our.look("ann", "robot")
    changes = [await anext(events), await anext(events)]
    our.look_away("ann")
    return [*changes, await anext(events)]


async def test_the_c_example_prints_what_recognition_says(tmp_path: Path) -> None:
    program = built(tmp_path)
    endpoint = free_endpoint()
    async with scene("robot", endpoint) as our:
        process = await create_subprocess_exec(program, endpoint, stdout=PIPE)
        try:
            assert process.stdout is not None
            async with timeout(PATIENCE):
                assert await process.stdout.readline() == b"connected\n"
                with our.robot.connection_events() as events:
                    printed = create_task(process.stdout.readline())
                    ours = []
                    while not printed.done():  # recognition may learn a moment later that there is a subscriber
                        ours += await an_event(our, events)
                    first = json.loads(await printed)
                    ours += await an_event(our, events)
                    rest = ours[[told(each) for each in ours].index((first["id"], first["state"])) + 1 :]
                    for each in rest:
                        assert await printed_next(process.stdout) == (each.id, each.state)
                    assert first["kind"] == MUTUAL
        finally:
            await stopped(process)


async def test_the_c_example_says_that_no_robot_is_there(tmp_path: Path) -> None:
    process = await create_subprocess_exec(built(tmp_path), free_endpoint(), stdout=PIPE, stderr=PIPE)
    async with timeout(PATIENCE):
        _, complaint = await process.communicate()
    assert process.returncode == 1
    assert b"nobody listens at" in complaint
