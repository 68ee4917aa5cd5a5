"""Of several `engage up` of one robot exactly one goes on, whenever they meet. In virtual time."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.robot.one_per_robot import PATIENCE, StartClaim, claiming

EARLY, LATE = "00000000", "ffffffff"


async def start(hub: MemoryHub, id: str, ready: asyncio.Event) -> None:
    """Be an `up` until its services are there."""
    async with claiming(hub, id) as claim:
        await claim.granted()
        await claim.held_until(ready)
        await asyncio.get_running_loop().create_future()


@asynccontextmanager
async def starting(hub: MemoryHub, *ids: str) -> AsyncIterator[tuple[asyncio.Event, list[asyncio.Task[None]]]]:
    """All at once; the event says that services are there."""
    ready = asyncio.Event()
    tasks = [asyncio.create_task(start(hub, id, ready)) for id in ids]
    yield ready, tasks
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


@pytest.mark.parametrize("ids", [(EARLY, LATE), (LATE, EARLY), (LATE, "88888888", EARLY)])
async def test_of_those_that_start_at_once_the_earliest_id_goes_on(hub: MemoryHub, ids: tuple[str, ...]) -> None:
    async with starting(hub, *ids) as (ready, tasks):
        await asyncio.sleep(2 * PATIENCE)
        ready.set()
        await asyncio.sleep(1.0)

        assert [task.done() for task in tasks] == [id != EARLY for id in ids]
        refused = [task.exception() for task in tasks if task.done()]
        assert all(isinstance(error, InputRefused) for error in refused)


async def test_one_that_is_up_gives_way_to_none(hub: MemoryHub) -> None:
    async with starting(hub, LATE) as (ready, (first,)):
        ready.set()
        await asyncio.sleep(1.0)
        async with starting(hub, EARLY) as (_, (second,)):
            began = asyncio.get_running_loop().time()
            with pytest.raises(InputRefused, match="up: robot 'robot' has this on the bus already"):
                await second

            assert asyncio.get_running_loop().time() == began + PATIENCE
        assert not first.done()


async def test_one_that_is_up_is_not_shown_as_starting_any_more(hub: MemoryHub) -> None:
    bus = hub.join("looker")
    with bus.subscribe(keys.ANY_ALIVE) as presence:
        async with starting(hub, LATE) as (ready, _):
            await asyncio.sleep(1.0)
            ready.set()
            await asyncio.sleep(1.0)
            told = [received.message for _ in range(len(presence)) if (received := await presence.next())]

    assert [(type(one), getattr(one, "participant", "")) for one in told] == [
        (PeerAlive, f"up-starting-{LATE}"), (PeerAlive, f"up-{LATE}"), (PeerGone, f"up-starting-{LATE}"),
    ]  # fmt: skip


async def test_one_that_was_killed_is_waited_out(hub: MemoryHub) -> None:
    async with starting(hub, EARLY) as (ready, _):
        ready.set()
        await asyncio.sleep(1.0)
        async with starting(hub, LATE) as (more, (second,)):
            await asyncio.sleep(PATIENCE - 0.1)
            hub.kill(f"up-{EARLY}")
            more.set()
            await asyncio.sleep(1.0)

            assert not second.done()


async def test_those_that_meet_only_while_their_services_start_part_at_once(hub: MemoryHub) -> None:
    async with starting(hub, LATE) as (_, (first,)):
        await asyncio.sleep(2 * PATIENCE)
        assert not first.done()
        async with starting(hub, EARLY) as (_, (second,)):
            await asyncio.sleep(0.1)

            assert isinstance(first.exception(), InputRefused)
            assert not second.done()


def test_two_claims_never_give_way_to_each_other_nor_both_go_on() -> None:
    for ours in (False, True):
        for theirs in (False, True):
            one, other = StartClaim("r", EARLY), StartClaim("r", LATE)
            one.is_up, other.is_up = ours, theirs
            one.feed(PeerAlive(participant=f"up-{'' if theirs else 'starting-'}{LATE}"))
            other.feed(PeerAlive(participant=f"up-{'' if ours else 'starting-'}{EARLY}"))

            # Two that are up have met too late to give way.
            assert [one.is_good, other.is_good].count(True) == (2 if ours and theirs else 1)


def test_nobody_else_is_in_the_way() -> None:
    claim = StartClaim("r", LATE)
    for name in ("upright", "up-x", "control", f"up-{LATE}", f"up-starting-{LATE}", "up-123456789"):
        claim.feed(PeerAlive(participant=name))
    assert claim.is_good

    claim.feed(PeerAlive(participant=f"up-{EARLY}"))
    assert not claim.is_good
    claim.feed(PeerGone(participant=f"up-{EARLY}"))
    assert claim.is_good
