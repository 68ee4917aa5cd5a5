"""Visitors who sit down at the same instant: each is a person of their own, in one window and in two."""

import asyncio
import gc
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager

import pytest
from msgspec import Raw

from engage_hri.schemas import keys
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.console.web.frames import OrderNews, Receipts
from engage_hri.services.console.web.orders import Given
from engage_hri.services.console.web.script import Script
from engage_hri.services.console.web.seats import Seats
from engage_hri.services.console.web.service import window
from engage_hri.services.console.web.visitor import Visitor
from engage_hri.services.runtime.service import Ready, running

CUP = Entity(id="cup", kind="object", position=(0.5, 0.0, 0.7))


async def idle(bus: Bus, ready: Ready) -> None:
    """Recognition that only stands there."""
    ready()
    await asyncio.get_running_loop().create_future()


@asynccontextmanager
async def visitors(hub: MemoryHub, windows: int, each: int) -> AsyncIterator[list[Visitor]]:
    """Visitors with the token, so many at each window."""
    async with AsyncExitStack() as stack:
        await stack.enter_async_context(running(hub, {"recognition": idle}))
        hub.join("camera", role="perception").publish(keys.WORLD, World(entities=(CUP,)))
        made = []
        for number in range(windows):
            bus = hub.join(f"console-{number}", role="wizard")
            shown = await stack.enter_async_context(window(hub, bus, Script(())))
            bus.declare_alive()
            made += [Visitor(shown, True, Receipts()) for _ in range(each)]
        await asyncio.sleep(0.1)
        yield made
        for visitor in made:
            await visitor.leave()


async def places(hub: MemoryHub) -> list[tuple[float, ...]]:
    with hub.join("reader").subscribe(keys.WORLD) as inbox:
        received = await inbox.next()
        await asyncio.sleep(0)
    assert received is not None
    assert isinstance(received.message, World)
    return [person.position for person in received.message.people]


def give(visitor: Visitor, order: str) -> None:
    """Give an order, as the page does."""
    visitor.take(Given(number=1, order=Raw(order.encode())))


def news(visitor: Visitor) -> tuple[OrderNews, ...]:
    """News of the orders since this was asked last."""
    told = visitor.receipts.news()
    visitor.receipts.confirm()
    return told


def told(visitor: Visitor) -> str:
    return " ".join(each.text for each in news(visitor))


@pytest.mark.parametrize(("windows", "each"), [(1, 2), (2, 1), (2, 2), (3, 3)])
async def test_who_takes_one_name_at_once_gets_it_alone_and_the_others_are_told(
    hub: MemoryHub, windows: int, each: int
) -> None:
    async with visitors(hub, windows, each) as everybody:
        for visitor in everybody:
            give(visitor, '{"do": "sit", "name": "ann"}')
        await asyncio.sleep(3.0)

        assert sorted(visitor.you.person for visitor in everybody) == [""] * (windows * each - 1) + ["ann"]
        assert all("'ann' is there already" in told(visitor) for visitor in everybody if not visitor.you.person)


@pytest.mark.parametrize(("windows", "each"), [(1, 2), (2, 1), (2, 2), (3, 3)])
async def test_who_takes_any_seat_at_once_gets_a_name_and_a_place_of_their_own(
    hub: MemoryHub, windows: int, each: int
) -> None:
    async with visitors(hub, windows, each) as everybody:
        for visitor in everybody:
            give(visitor, '{"do": "sit"}')
        await asyncio.sleep(10.0)

        names = {visitor.you.person for visitor in everybody}
        assert len(names) == windows * each
        assert "" not in names
        assert len(set(await places(hub))) == windows * each


async def test_who_asks_twice_sits_once_and_may_come_again_after_leaving(hub: MemoryHub) -> None:
    async with visitors(hub, 1, 1) as [visitor]:
        give(visitor, '{"do": "sit", "name": "ann"}')
        give(visitor, '{"do": "sit", "name": "bob"}')
        await asyncio.sleep(2.0)
        assert (visitor.you.person, len(await places(hub))) == ("ann", 1)

        give(visitor, '{"do": "leave"}')
        await asyncio.sleep(1.0)
        give(visitor, '{"do": "sit", "name": "ann"}')
        await asyncio.sleep(2.0)
        assert visitor.you.person == "ann"


async def test_a_seat_whose_window_was_killed_is_free_again(hub: MemoryHub) -> None:
    seats = Seats()
    claim = seats.claim("ann")
    other = Seats()
    other.feed(PeerAlive(participant=f"holder-{claim}", run="1"))

    with pytest.raises(InputRefused, match="'ann' is there already"):
        other.name("ann", ())
    assert other.name("", ()) == "visitor"

    other.feed(PeerGone(participant=f"holder-{claim}"))
    assert other.name("ann", ()) == "ann"


@pytest.mark.parametrize("name", ["cup", "robot", "all", "a/b"])
async def test_a_name_of_a_thing_or_of_the_robot_is_refused_with_the_reason(hub: MemoryHub, name: str) -> None:
    async with visitors(hub, 1, 1) as [visitor]:
        give(visitor, f'{{"do": "sit", "name": "{name}"}}')
        await asyncio.sleep(2.0)

        assert visitor.you.person == ""
        assert "can't be a person's id" in told(visitor)


def test_who_gives_way_takes_no_place_and_none_is_kept_for_them() -> None:
    """Else who chooses before and who chooses after that count differently, and choose one place."""
    seats = Seats()
    for name in ("seat-00000001-ann", "seat-00000002-ann", "seat-00000005-kim", "seat-00000007-uma"):
        seats.feed(PeerAlive(participant=name, run="1"))
    before = [seats.before(name, ()) for name in ("seat-00000005-kim", "seat-00000007-uma")]
    seats.feed(PeerGone(participant="seat-00000002-ann"))

    assert before == [1, 2]
    assert [seats.before(name, ()) for name in ("seat-00000005-kim", "seat-00000007-uma")] == before


@pytest.mark.filterwarnings("error")
async def test_who_leaves_in_the_very_instant_of_an_order_leaves_nothing_behind(hub: MemoryHub) -> None:
    async with visitors(hub, 1, 1) as (visitor,):
        give(visitor, '{"do": "sit", "name": "ann"}')
        await asyncio.sleep(1.0)
        for order in ('{"do": "type", "text": "hello"}', '{"do": "point", "target": "cup"}', '{"do": "head"}'):
            give(visitor, order)
        await visitor.leave()
        gc.collect()

        assert visitor.you.person == ""
