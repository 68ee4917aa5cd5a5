"""What a process asks another for its past, when the question or its answer gets lost."""

import asyncio
import os
import time
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from typing import Any

import pytest
import pytest_asyncio
import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.access import WATCHED
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.zenoh import history, hub
from engage_hri.services.bus.zenoh.history import History
from engage_hri.services.bus.zenoh.hub import ZenohHub, open_hub
from engage_hri.services.bus.zenoh.order import Missing, Past, Written
from engage_hri.services.bus.zenoh.peers import CLOCK_TRIPS, Peers
from engage_hri.services.bus.zenoh.readers import CROWD, PAUSE, RUNS_KEPT, UNANSWERED
from tests.bus.places import PATIENCE, acquainted, free_endpoint, messages, numbers, state

pytestmark = pytest.mark.real_time
Told = Callable[[Past], None]
Ended = Callable[[Past | None], None]


@pytest_asyncio.fixture
async def pair() -> AsyncIterator[tuple[ZenohHub, ZenohHub]]:
    """Two processes; the second has something to tell, and no pulse that would betray that it was missed."""
    robot, end = f"asked-{os.getpid()}", free_endpoint()
    here, there = await open_hub(robot, listen=[end]), await open_hub(robot, connect=[end])
    await acquainted(here, there)
    there.join("there").publish(keys.WORLD, state(1))
    assert there._pulse is not None
    there._pulse.cancel()
    await publishing(here, there)
    yield here, there
    await there.close()
    await here.close()


async def publishing(here: ZenohHub, *others: ZenohHub) -> None:
    """Wait until it is known that these have published something."""
    here.peers.hear("news")
    while here.peers.publishers.keys() != {other.run for other in others}:
        assert await here.peers.change(asyncio.get_running_loop().time() + PATIENCE)


def unanswered(asking: ZenohHub, times: int) -> list[str]:
    """Let the next questions of the hub for somebody's past die; the list tells how many were asked."""
    ask, asked = asking._history.ask, []

    def ask_past(patterns: Sequence[str], run: str, missing: Missing, told: Told, ended: Ended) -> None:
        asked.append(run)
        if len(asked) <= times:
            asyncio.get_running_loop().call_soon(ended, None)
        else:
            ask(patterns, run, missing, told, ended)

    asking._history.ask = ask_past  # type: ignore[method-assign]
    return asked


async def test_a_process_that_is_there_is_asked_again_when_it_has_not_answered(pair: tuple[ZenohHub, ZenohHub]):
    here, there = pair
    asked = unanswered(here, 3)

    inbox = here.join("here").subscribe(keys.WORLD)

    assert numbers(await messages(inbox)) == [1]
    assert asked == 4 * [there.run]


async def test_an_answer_of_which_a_part_is_missing_is_asked_for_again(
    pair: tuple[ZenohHub, ZenohHub], monkeypatch: pytest.MonkeyPatch
):
    """A part is lost in a cut, or comes under another key (`mark_of`), and the end of the answer comes after it."""
    here, there = pair
    there.join("another").publish(keys.FEEDBACK, state(2))
    whole, answers = history.fitting, []

    def torn(written: Sequence[Written], limit: int) -> Iterator[list[Written]]:
        answers.append(len(written))
        return whole(written, limit) if len(answers) > 2 else iter(())

    monkeypatch.setattr(history, "fitting", torn)

    inbox = here.join("here").subscribe(keys.WORLD, keys.FEEDBACK)

    assert numbers(await messages(inbox, 2)) == [1, 2]
    assert answers == [1, 1, 1, 1]
    assert here._buses["here"].health.lost == 0


async def test_a_process_that_never_answers_holds_up_nobody_for_ever(pair: tuple[ZenohHub, ZenohHub]):
    here, there = pair
    inbox = here.join("here").subscribe(keys.WORLD)
    assert numbers(await messages(inbox)) == [1]
    asked = unanswered(here, 1000)
    began = asyncio.get_running_loop().time()

    here.readers.publisher_came(there.run, "news")
    there.join("another").publish(keys.WORLD, state(2))

    assert numbers(await messages(inbox)) == [2]
    assert asyncio.get_running_loop().time() >= began + UNANSWERED
    assert len(asked) == 5  # after 0, 0.2, 0.6, 1.4 and 3.0 s
    assert {*asked} == {there.run}


async def test_a_question_that_ends_with_a_link_is_asked_again(pair: tuple[ZenohHub, ZenohHub]):
    """A process seems to be gone then, and what is held after a gap would be delivered without what is missing."""
    here, there = pair
    inbox = here.join("here").subscribe(keys.FEEDBACK)
    there.join("another").publish(keys.FEEDBACK, state(2))
    assert numbers(await messages(inbox)) == [2]
    asked = unanswered(here, 2)
    here.peers.publishers.clear()
    [reader] = (each for each in here.readers._readers if each.subscription is inbox)
    here.readers._ask(reader, there.run, reader.followers[there.run])
    reader.followers[there.run].behind = True
    for number in (3, 4):
        there._buses["another"].publish(keys.FEEDBACK, state(number))

    assert numbers(await messages(inbox, 2)) == [3, 4]
    assert len(asked) >= 3
    assert here._buses["here"].health.lost == 0


async def test_who_comes_back_under_a_question_is_asked_once_more_after_it(pair: tuple[ZenohHub, ZenohHub]):
    here, there = pair
    inbox = here.join("here").subscribe(keys.WORLD)
    assert numbers(await messages(inbox)) == [1]
    waiting: asyncio.Queue[Told] = asyncio.Queue()
    asked = unanswered(here, 0)
    ask = here._history.ask

    def ask_late(patterns: Sequence[str], run: str, missing: Missing, told: Told, ended: Ended) -> None:
        if len(asked) > 0:
            ask(patterns, run, missing, told, ended)
        else:
            ask(patterns, run, missing, lambda past: waiting.put_nowait(told), lambda _: None)

    here._history.ask = ask_late  # type: ignore[method-assign]
    here.readers.publisher_came(there.run, "news")
    here.readers.publisher_came(there.run, "news")
    there.join("another").publish(keys.WORLD, state(2))
    told = await waiting.get()

    # The answer to the first question is from before the cut: it has nothing new.
    told(Past({keys.WORLD: 1}, ()))

    assert numbers(await messages(inbox)) == [2]
    assert len(asked) == 2


def questions(monkeypatch: pytest.MonkeyPatch, kind: type, name: str, whose: Callable[[Any], str]) -> list[str]:
    """Runs of the processes that this method of theirs was asked in; the list goes on."""
    answer, asked = getattr(kind, name), []

    def recorded(one: Any, query: zenoh.Query) -> None:
        asked.append(whose(one))
        answer(one, query)

    monkeypatch.setattr(kind, name, recorded)
    return asked


async def test_a_question_is_one_for_all_patterns_and_goes_to_no_other_process(monkeypatch: pytest.MonkeyPatch):
    asked = questions(monkeypatch, History, "_missing_asked", lambda history: history._sent.run)
    robot, end = f"asked-{os.getpid()}", free_endpoint()
    here, there, other, _ = hubs = [
        await open_hub(robot, listen=[end]), *[await open_hub(robot, connect=[end]) for _ in range(3)]
    ]  # fmt: skip
    await acquainted(*hubs)
    there.join("there").publish(keys.WORLD, state(1))
    other.join("other").publish(keys.statistics("ann"), state(2))
    await publishing(here, there, other)

    inbox = here.join("here").subscribe(*WATCHED, keys.WORLD)
    assert sorted(numbers(await messages(inbox, 2))) == [1, 2]
    assert sorted(asked) == sorted([there.run, other.run]), "who has published nothing was asked"
    asked.clear()
    here.readers.publisher_came(there.run, "news")
    there._buses["there"].publish(keys.WORLD, state(3))

    assert numbers(await messages(inbox)) == [3]
    assert set(asked) == {there.run}
    for each in reversed(hubs):
        await each.close()


async def test_who_has_never_answered_is_asked_once_for_all_who_want_something_of_it(
    pair: tuple[ZenohHub, ZenohHub], monkeypatch: pytest.MonkeyPatch
):
    """More than a question can have patterns for: it takes three."""
    here, there = pair
    there.join("another").publish(keys.FEEDBACK, state(2))
    asked, ask = list[int](), here._history.ask

    def ask_past(patterns: Sequence[str], run: str, missing: Missing, told: Told, ended: Ended) -> None:
        asked.append(len(patterns))
        ask(patterns, run, missing, told, ended)

    monkeypatch.setattr(here._history, "ask", ask_past)
    bus = here.join("here")

    inboxes = [bus.subscribe(keys.WORLD), bus.subscribe(keys.WORLD, keys.FEEDBACK)]
    many = [bus.subscribe(*[keys.statistics(f"p{number}-{each}") for each in range(40)]) for number in range(3)]

    assert numbers(await messages(inboxes[0])) == [1]
    assert numbers(await messages(inboxes[1], 2)) == [1, 2]
    assert asked == [2 + 40, 40, 40]
    assert not any(len(each) for each in many)


async def test_of_a_crowd_of_tokens_without_processes_few_are_asked_and_none_that_is_gone(
    pair: tuple[ZenohHub, ZenohHub],
):
    here, there = pair
    asked = unanswered(here, 10**6)
    inbox = here.join("here").subscribe(keys.WORLD)
    for number in range(500):
        here.peers.publishers[f"ghost{number}"] = {"news"}
        here.readers.publisher_came(f"ghost{number}", "news")
    for number in range(400):
        del here.peers.publishers[f"ghost{number}"]
    there.join("another").publish(keys.WORLD, state(2))

    assert numbers(await messages(inbox)) == [2]
    assert {*asked} == {there.run, *(f"ghost{number}" for number in range(400, 500))}


async def test_a_crowd_is_asked_a_few_at_a_time_and_each_once(
    pair: tuple[ZenohHub, ZenohHub], monkeypatch: pytest.MonkeyPatch
):
    here, _ = pair
    loop, asked, all_asked = asyncio.get_running_loop(), list[tuple[str, float]](), asyncio.Event()
    crowd = [f"process{number}" for number in range(3 * CROWD)]

    def ask_past(patterns: Sequence[str], run: str, missing: Missing, told: Told, ended: Ended) -> None:
        if run in crowd:
            asked.append((run, loop.time()))
        loop.call_soon(told, Past({}, ()))
        if len(asked) == len(crowd):
            all_asked.set()

    monkeypatch.setattr(here._history, "ask", ask_past)
    inbox = here.join("here").subscribe(keys.WORLD)
    for run in crowd:
        here.peers.publishers[run] = {"news"}
        here.readers.publisher_came(run, "news")
    await asyncio.wait_for(all_asked.wait(), PATIENCE)

    assert sorted(run for run, _ in asked) == sorted(crowd)
    assert all(late - early > PAUSE / 2 for (_, early), (_, late) in zip(asked, asked[CROWD:], strict=False))
    assert not len(inbox)


async def test_processes_that_read_one_clock_do_not_ask_one_another_for_the_time(monkeypatch: pytest.MonkeyPatch):
    asked = questions(monkeypatch, Peers, "_tell_time", lambda peers: peers._sent.run)
    robot, end = f"asked-{os.getpid()}", free_endpoint()
    here, there = await open_hub(robot, listen=[end]), await open_hub(robot, connect=[end])
    await acquainted(here, there)
    asked.clear()
    for each in (here, there):
        each.join(each.run, "perception").declare_alive()
    for each in (here, there):
        while not each.peers.processes:
            assert await each.peers.change(asyncio.get_running_loop().time() + PATIENCE)
    await here.peers.round_trip(there.run, PATIENCE)
    assert asked == [there.run]

    monkeypatch.setattr(hub, "own_clock", lambda *_: ("boot-elsewhere", lambda: 1000.0 + time.monotonic()))
    far = await open_hub(robot, connect=[end])
    far.join("far", "perception").declare_alive()
    await far.peers.round_trip(here.run, PATIENCE)  # which is asked after the first question for the time
    await here.peers.round_trip(far.run, PATIENCE)

    assert here.clocks.local(Stamp("boot-elsewhere", 1000.0)) == pytest.approx(0.0, abs=0.5)
    for each in (far, there, here):
        await each.close()


@pytest.mark.parametrize("is_first", [False, True])
async def test_what_time_a_machine_has_says_one_of_its_processes_and_no_other(
    monkeypatch: pytest.MonkeyPatch, is_first: bool
):
    """A liar says that it is on the robot's machine. With keys it need not have come later to be disbelieved."""
    robot, end = f"asked-{os.getpid()}", free_endpoint()
    here, hubs = await open_hub(robot, listen=[end]), {}
    if is_first:
        monkeypatch.setattr(here.peers, "_rank", lambda run: 0 if "true" in hubs and run == hubs["true"].run else 1)
    for name, ahead in sorted({"true": 1000.0, "lie": 5000.0}.items(), reverse=not is_first):
        clock = ("boot-elsewhere", lambda ahead=ahead: ahead + time.monotonic())
        monkeypatch.setattr(hub, "own_clock", lambda *_, clock=clock: clock)
        each = hubs[name] = await open_hub(robot, connect=[end])
        each.join(name, "perception").declare_alive()
        for _ in range(CLOCK_TRIPS + 1):  # each is asked after the last question for the time
            await each.peers.round_trip(here.run, PATIENCE)
            await here.peers.round_trip(each.run, PATIENCE)

    here.peers._measure_clocks()
    for each in hubs.values():
        for _ in range(CLOCK_TRIPS + 1):
            await here.peers.round_trip(each.run, PATIENCE)

    assert here.clocks.local(Stamp("boot-elsewhere", 1000.0)) == pytest.approx(0.0, abs=0.5)
    for each in (*hubs.values(), here):
        await each.close()


async def test_processes_that_come_and_go_are_forgotten_but_none_that_is_there(pair: tuple[ZenohHub, ZenohHub]):
    here, there = pair
    inbox = here.join("here").subscribe(keys.WORLD)
    assert numbers(await messages(inbox)) == [1]
    for number in range(2 * RUNS_KEPT):
        here.readers.publisher_came(f"run-{number}", "news")
    [reader] = here.readers._readers

    assert len(reader.followers) == RUNS_KEPT
    assert there.run in reader.followers
