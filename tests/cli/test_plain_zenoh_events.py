"""The plain example and Engage's own client behind one cable that is cut, beside a client that is not cut off."""

import asyncio
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import Iterable

import pytest

from engage_hri.services.bus.zenoh.hub import ZenohHub
from engage_hri.services.bus.zenoh.session import open_session
from engage_hri.services.client.feeds import EventFeed
from engage_hri.services.client.robot import connect
from tests.bus.cable import Cable
from tests.bus.places import free_endpoint
from tests.cli.test_processes import PATIENCE, line, stopped
from tests.cli.test_watch import EXAMPLE, MUTUAL, Scene, heard, scene

pytestmark = pytest.mark.real_time

LIMIT = "recognition.mutual_facial_gaze_limit=1"
LAST = "carl"
Told = tuple[str, str]


async def told(events: EventFeed) -> list[Told]:
    """The id and state of all changes, until those of the last person."""
    found = []
    async for event in events:
        found.append((event.id, event.state))
        if LAST in (event.initiator, event.responder):
            break
    return found


async def plainly_told(plain: Process, first: str) -> list[Told]:
    lines = [first]
    while LAST not in lines[-1]:
        lines.append(await line(plain, MUTUAL, log=False))
    parts = [text.split(": ") for text in lines]
    return [(id, state.split()[0]) for id, _, state in parts]


async def looks_in_vain(our: Scene, events: EventFeed, people: Iterable[str]) -> None:
    """One after the other looks at the robot, which does not look back: two changes each, the limit of 1 s apart."""
    for person in people:
        our.look(person, "seen")
        await heard(events, "failed")


async def behind(cable: Cable) -> ZenohHub:
    """In client mode, so that nobody is met past the cable. Opening waits for the link, which this loop carries."""
    session, _ = await asyncio.to_thread(open_session, "seen", [cable.endpoint], [], None, "client")
    return ZenohHub("seen", session)


async def test_the_plain_example_tells_what_the_client_tells_through_cuts_and_a_kill() -> None:
    endpoint = free_endpoint()
    cable = Cable(endpoint)
    await cable.join()
    async with (
        scene("seen", endpoint, "--set", LIMIT) as our,
        await behind(cable) as hub,
        connect(hub=hub) as distant,
    ):
        our.look("seen", "ann")
        our.look("ann", "seen")
        with our.robot.connection_events(open=True) as events:
            await heard(events, "succeeded")
        plain = await asyncio.create_subprocess_exec(
            sys.executable, EXAMPLE, "--robot", "seen", "--kind", MUTUAL, cable.endpoint, stdout=PIPE, stderr=PIPE
        )
        try:
            first = await line(plain, MUTUAL, log=False)
            with (
                our.robot.connection_events(open=True) as near,
                our.robot.connection_events(open=True) as guide,
                distant.connection_events(open=True) as far,
            ):
                async with asyncio.timeout(PATIENCE), asyncio.TaskGroup() as reading:
                    reads = (told(near), told(far), plainly_told(plain, first))
                    readers = [reading.create_task(read) for read in reads]
                    for number, seconds in enumerate((1, 1, 5)):
                        await cable.cut()
                        await looks_in_vain(our, guide, (f"{number}-{second}" for second in range(seconds)))
                        await cable.join()
                        await looks_in_vain(our, guide, (f"{number}-after",))
                    our.recognition[0].kill()
                    await heard(guide, "lost")
                    await our.recognize()
                    our.look(LAST, "seen")
        finally:
            await stopped(plain)
            await cable.cut()

    here, there, plainly = (reader.result() for reader in readers)
    shared = here[0]
    assert [state for _, state in here] == ["succeeded", *["started", "failed"] * 10, "lost", "started"]
    assert plainly == there
    assert there[:8] == here[:8]  # through the cuts of 1 s
    corrected = [shared, (shared[0], "lost"), shared, (shared[0], "lost")]
    assert [change for change in there if change[0] == shared[0]] == corrected
    # What was on its way at a cut may be told as lost before it comes, too.
    assert [change for change in dict.fromkeys(there) if change[1] != "lost"] == [
        change for change in here if change[1] != "lost"
    ]
