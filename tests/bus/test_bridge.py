"""What waits between Zenoh's threads and the loop."""

import asyncio
import os

import pytest

from engage_hri.schemas import keys
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.bus.zenoh.session import Arrived
from tests.bus.places import PATIENCE, acquainted, free_endpoint, matched, messages, numbers, state

pytestmark = pytest.mark.real_time


@pytest.mark.parametrize("key", [keys.FEEDBACK, keys.NET])
async def test_a_message_that_waits_for_the_loop_keeps_nothing_of_zenohs_buffers(key: str):
    """Each sample would keep all of the buffer that it came in: kilobytes for a few bytes of message."""
    robot, end, loop = f"bridge-{os.getpid()}", free_endpoint(), asyncio.get_running_loop()
    here, there = await open_hub(robot, listen=[end]), await open_hub(robot, connect=[end])
    await acquainted(here, there)
    inbox, speaker = here.join("here").subscribe(key), there.join("there")
    await matched(there, key)

    speaker.publish(key, state(1))
    queue, deadline = here.bridge._streams if key == keys.NET else here.bridge._ordered, loop.time() + PATIENCE
    while not (waiting := [item for _, item in tuple(queue) if isinstance(item, Arrived)]):
        assert loop.time() < deadline

    assert [each.key for each in waiting] == [key]
    assert all(type(getattr(waiting[0], name)) in (str, bytes, bool) for name in waiting[0].__struct_fields__)
    assert numbers(await messages(inbox)) == [1]
    await there.close()
    await here.close()
