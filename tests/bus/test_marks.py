"""What Zenoh brings under another key than it was sent on is taken by nobody, and comes again under its own.

That Zenoh mixes keys up needs a process that calls again while its old link ends: `python -m tests.rigs.deaf`.
"""

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import pytest
import pytest_asyncio
import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.messages import encode
from engage_hri.services.bus.zenoh.history import pack
from engage_hri.services.bus.zenoh.hub import ZenohHub, open_hub
from engage_hri.services.bus.zenoh.order import mark_of
from tests.bus.places import PATIENCE, acquainted, echo, free_endpoint, messages, numbers, state

pytestmark = pytest.mark.real_time


@pytest_asyncio.fixture
async def pair() -> AsyncIterator[tuple[ZenohHub, ZenohHub]]:
    endpoint = free_endpoint()
    here = await open_hub("robot", listen=[endpoint])
    there = await open_hub("robot", connect=[endpoint])
    await acquainted(here, there)
    yield here, there
    await there.close()
    await here.close()


class Mixing:
    """A session that sends what is for one key on another, while it is told to."""

    def __init__(self, session: zenoh.Session) -> None:
        self._real: Any = session
        self.is_on = False

    def declare_publisher(self, key: str, **options: Any) -> Any:
        right = self._real.declare_publisher(key, **options)
        wrong = self._real.declare_publisher(keys.FEEDBACK if key == keys.BLOCK else key, **options)
        mixing = self

        class Publisher:
            def put(self, payload: bytes, **more: Any) -> None:
                (wrong if mixing.is_on else right).put(payload, **more)

            def __getattr__(self, name: str) -> Any:
                return getattr(right, name)

        return Publisher()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._real, name)


async def test_a_message_under_another_key_is_left_and_comes_under_its_own(pair: tuple[ZenohHub, ZenohHub]) -> None:
    here, there = pair
    bus = here.join("here")
    blocks, feedback = bus.subscribe(keys.BLOCK), bus.subscribe(keys.FEEDBACK)
    mixing: Any = Mixing(there.session)
    there._publishers._session = mixing
    far = there.join("there")

    far.publish(keys.BLOCK, state(0))
    assert numbers(await messages(blocks)) == [0]
    for number in range(1, 9):
        mixing.is_on = number in (2, 3, 8)
        far.publish(keys.BLOCK, state(number))
    far.publish(keys.FEEDBACK, state(100))

    assert numbers(await messages(blocks, 8)) == list(range(1, 9))
    assert numbers(await messages(feedback)) == [100]
    assert here.health.refused == 3
    assert bus.health.lost == 0


async def test_a_question_under_another_key_gets_no_answer_and_one_without_a_mark_does(
    pair: tuple[ZenohHub, ZenohHub],
) -> None:
    here, there = pair
    here.join("here").answer(keys.DESCRIBE, echo)
    loop = asyncio.get_running_loop()

    async def answers(**more: Any) -> int:
        came: list[zenoh.Reply] = []
        ended = asyncio.Event()
        handler: Any = zenoh.handlers.Callback(
            lambda reply: came.append(reply) if reply.ok is not None else None,
            lambda: loop.call_soon_threadsafe(ended.set) and None,
            indirect=False,
        )
        session: Any = there.session
        question = {"payload": encode(state(1)), "encoding": "application/msgpack", "timeout": PATIENCE}
        session.get(keys.DESCRIBE, handler, **question, **more)
        await ended.wait()
        return len(came)

    async with asyncio.timeout(PATIENCE):
        while not await answers():
            pass  # until the server is known
        assert await answers(attachment=pack(mark_of(keys.DESCRIBE))) == 1
        assert await answers(attachment=pack(mark_of(keys.ESTIMATE))) == 0
