"""Recognition as a process of its own, killed and started again, over Zenoh."""

import asyncio
import os
import sys
from asyncio.subprocess import PIPE, STDOUT, Process

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Event
from engage_hri.schemas.perception import ActionBegan, ActorFound
from engage_hri.schemas.recognition import ConnectionEvent, EventOutcome, RequestEvent
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.client.people.perceived_person import PerceivedActions
from engage_hri.services.requests.ends import Requester
from tests.bus.places import PATIENCE, free_endpoint
from tests.recognition.observations import HUMAN, world

pytestmark = pytest.mark.real_time
ROBOT = f"restarted-{os.getpid()}"


async def start(endpoint: str) -> Process:
    """Start recognition, and wait until it is there."""
    words = ("run", "recognition", "--robot", ROBOT, "--connect", endpoint)
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "engage_hri", *words, stdout=PIPE, stderr=STDOUT
    )
    assert process.stdout is not None
    async with asyncio.timeout(PATIENCE):
        while b"is ready" not in (line := await process.stdout.readline()):
            assert line, "recognition has ended"
    return process


async def end(process: Process) -> None:
    process.kill()
    await process.communicate()


async def test_who_has_been_looking_at_the_robot_does_so_after_a_restart_of_recognition() -> None:
    """The history is 2 s long; the look has lasted for more than that when recognition is killed."""
    endpoint = free_endpoint()
    async with await open_hub(ROBOT, listen=[endpoint]) as hub:
        camera, realizer = hub.join("camera", role="perception"), hub.join("realizer", role="realizer")
        camera.declare_alive()
        realizer.declare_alive()
        recognition = await start(endpoint)
        try:
            camera.publish(keys.WORLD, world())
            perceived = PerceivedActions(camera)
            perceived.tell(
                ActorFound(actor=HUMAN, at=camera.stamp()),
                ActionBegan(actor=HUMAN, action="look", at=camera.stamp(), targets=(ROBOT,)),
            )
            with camera.subscribe(keys.ANY_CONNECTION_EVENT) as inbox:
                while True:  # the look begins an event, which fails once it has lasted for 1.9 s
                    received = await inbox.next(camera.now() + PATIENCE)
                    assert received is not None
                    if isinstance(received.message, ConnectionEvent) and received.message.state == "failed":
                        break
                await inbox.next(camera.now() + keys.HISTORY_MAX_AGE)
            await end(recognition)
            recognition = await start(endpoint)
            async with Requester(realizer) as requests:
                look = Event(id="look", kind="mutual_facial_gaze", responder=HUMAN)
                request = RequestEvent(id="r", requester="realizer", block="b", at=realizer.stamp(), event=look)
                outcome = await asyncio.wait_for(requests.send(keys.EVENT, request).outcome, PATIENCE)
        finally:
            await end(recognition)

    assert isinstance(outcome, EventOutcome)
    assert (outcome.state, outcome.delay) == ("succeeded", 0.0)
