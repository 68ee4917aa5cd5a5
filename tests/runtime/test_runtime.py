import asyncio
from importlib.metadata import version

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.participants import AskStatus, PeerAlive, PeerGone, Status
from engage_hri.schemas.requests import Accepted
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.runtime.service import Ready, running, serve


async def stand_late(bus: Bus, ready: Ready) -> None:
    await asyncio.sleep(2.0)
    ready()
    await asyncio.Event().wait()


async def test_the_body_runs_when_all_services_stand_and_its_end_stops_them(hub: MemoryHub):
    inbox = hub.join("watch").subscribe(keys.ANY_ALIVE)

    async with running(hub, {"one": stand_late, "other": stand_late}):
        stood_at = asyncio.get_running_loop().time()

    seen = [received.message for received in [await inbox.next() for _ in range(4)] if received]
    assert stood_at == 2.0
    assert [type(message) for message in seen] == [PeerAlive, PeerAlive, PeerGone, PeerGone]
    assert sorted(message.participant for message in seen[2:]) == ["one", "other"]  # type: ignore[union-attr]


async def test_a_bug_in_a_service_ends_all_of_them_loudly(hub: MemoryHub):
    async def stumble(bus: Bus, ready: Ready) -> None:
        ready()
        await asyncio.sleep(1.0)
        raise ZeroDivisionError

    with pytest.raises(ExceptionGroup) as failed:
        async with running(hub, {"one": stand_late, "clumsy": stumble}):
            await asyncio.Event().wait()

    assert failed.group_contains(ZeroDivisionError)


async def test_a_service_that_ends_before_it_stands_is_a_failure_and_not_a_wait_for_ever(hub: MemoryHub):
    async def give_up(bus: Bus, ready: Ready) -> None:
        await asyncio.sleep(1.0)

    with pytest.raises(ExceptionGroup) as failed:
        async with running(hub, {"quitter": give_up}):
            raise AssertionError("it never stood")

    assert failed.group_contains(RuntimeError, match="quitter ended before it stood")


async def test_a_service_answers_how_it_is_before_and_after_it_stands(hub: MemoryHub):
    async def work(bus: Bus, ready: Ready) -> None:
        with bus.subscribe(keys.FEEDBACK, capacity=2):
            await stand_late(bus, ready)

    watch = hub.join("watch")
    async with running(hub, {"other": stand_late}), asyncio.TaskGroup() as group:
        working = group.create_task(serve(hub, "worker", work))
        await asyncio.sleep(1.0)
        early = await watch.query(keys.status("worker"), AskStatus())
        for number in range(5):
            watch.publish(keys.FEEDBACK, Accepted(id=str(number)))
        await asyncio.sleep(9.0)
        late = await watch.query(keys.status("worker"), AskStatus())
        working.cancel()

    assert isinstance(early, Status)
    assert isinstance(late, Status)
    assert (early.participant, early.run, early.version) == ("worker", "3", version("engage-hri"))
    assert (early.joined.seconds, early.stands, early.at.seconds) == (2.0, None, 3.0)
    assert (late.stands, late.at) == (watch.stamp(4.0), watch.stamp(12.0))
    assert early.bus.peers == ("other",)
    assert late.bus.peers == ("other", "worker")
    assert (early.bus.overflowed, late.bus.overflowed) == (0, 3)


@pytest.mark.parametrize("is_other_first", [True, False])
async def test_of_two_services_with_one_name_that_started_at_once_one_is_refused(
    hub: MemoryHub, is_other_first: bool
) -> None:
    serving = asyncio.create_task(serve(hub, "control", stand_late))
    await asyncio.sleep(3.0)
    run = "" if is_other_first else "~"
    hub.announce(PeerAlive(participant="control", run=f"{run}0"))
    await asyncio.sleep(0.1)
    assert serving.done() == is_other_first
    if is_other_first:
        with pytest.raises(InputRefused, match="control: robot 'robot' has this on the bus twice"):
            await serving
    serving.cancel()
    await asyncio.gather(serving, return_exceptions=True)
    assert "control" not in hub.alive
