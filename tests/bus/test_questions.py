"""What a process asks another for its past, when the question or its answer gets lost."""

import asyncio
import os
from collections.abc import AsyncIterator, Callable, Sequence

import pytest
import pytest_asyncio

from engage_hri.schemas import keys
from engage_hri.services.bus.zenoh.hub import ZenohHub, open_hub
from engage_hri.services.bus.zenoh.order import Missing, Past
from engage_hri.services.bus.zenoh.readers import RUNS_KEPT, TRIES
from tests.bus.places import acquainted, free_endpoint, messages, numbers, state

pytestmark = pytest.mark.real_time
Told = Callable[[str, Past], None]
Ended = Callable[[], None]


@pytest_asyncio.fixture
async def pair() -> AsyncIterator[tuple[ZenohHub, ZenohHub]]:
    """Two processes; the second has something to tell, and no pulse that would betray that it was missed."""
    robot, end = f"asked-{os.getpid()}", free_endpoint()
    here, there = await open_hub(robot, listen=[end]), await open_hub(robot, connect=[end])
    await acquainted(here, there)
    there.join("there").publish(keys.WORLD, state(1))
    assert there._pulse is not None
    there._pulse.cancel()
    yield here, there
    await there.close()
    await here.close()


def unanswered(hub: ZenohHub, times: int) -> list[str]:
    """Let the next questions of the hub for somebody's past die; the list tells how many were asked."""
    ask, asked = hub._history.ask, []

    def ask_past(patterns: Sequence[str], run: str, missing: Missing, told: Told, ended: Ended) -> None:
        asked.append(run)
        if len(asked) <= times:
            asyncio.get_running_loop().call_soon(ended)
        else:
            ask(patterns, run, missing, told, ended)

    hub._history.ask = ask_past  # type: ignore[method-assign]
    return asked


async def test_a_process_that_is_there_is_asked_again_when_it_has_not_answered(pair: tuple[ZenohHub, ZenohHub]):
    here, there = pair
    asked = unanswered(here, TRIES - 1)

    inbox = here.join("here").subscribe(keys.WORLD)

    assert numbers(await messages(inbox)) == [1]
    assert asked == TRIES * [there.run]


async def test_a_process_that_never_answers_holds_up_nobody_for_ever(pair: tuple[ZenohHub, ZenohHub]):
    here, there = pair
    inbox = here.join("here").subscribe(keys.WORLD)
    assert numbers(await messages(inbox)) == [1]
    asked = unanswered(here, 1000)

    here.readers.process_came(there.run)
    there.join("another").publish(keys.WORLD, state(2))

    assert numbers(await messages(inbox)) == [2]
    assert asked == TRIES * [there.run]


async def test_who_comes_back_under_a_question_is_asked_once_more_after_it(pair: tuple[ZenohHub, ZenohHub]):
    here, there = pair
    inbox = here.join("here").subscribe(keys.WORLD)
    waiting: asyncio.Queue[Told] = asyncio.Queue()
    asked = unanswered(here, 0)
    ask = here._history.ask

    def ask_late(patterns: Sequence[str], run: str, missing: Missing, told: Told, ended: Ended) -> None:
        if len(asked) > 0:
            ask(patterns, run, missing, told, ended)
        else:
            ask(patterns, run, missing, lambda run, past: waiting.put_nowait(told), lambda: None)

    assert numbers(await messages(inbox)) == [1]
    here._history.ask = ask_late  # type: ignore[method-assign]
    here.readers.process_came(there.run)
    here.readers.process_came(there.run)
    there.join("another").publish(keys.WORLD, state(2))
    told = await waiting.get()

    # The answer to the first question is from before the cut: it has nothing new.
    told(there.run, Past({keys.WORLD: 1}, ()))

    assert numbers(await messages(inbox)) == [2]
    assert len(asked) == 2


async def test_processes_that_come_and_go_are_forgotten_but_none_that_is_there(pair: tuple[ZenohHub, ZenohHub]):
    here, there = pair
    inbox = here.join("here").subscribe(keys.WORLD)
    assert numbers(await messages(inbox)) == [1]
    for number in range(2 * RUNS_KEPT):
        here.readers.process_came(f"run-{number}")
    [reader] = here.readers._readers

    assert len(reader.followers) == RUNS_KEPT
    assert there.run in reader.followers
