"""Clients that come and go leave nothing behind in a process of ours."""

import gc
import tracemalloc

from engage_hri.schemas import keys
from engage_hri.services.bus.memory import MemoryHub

VISITORS = 2000
EACH = 40
"""Bytes that one may leave behind on the average: less than any object of Python. It was 100 in each subscription."""


async def test_who_came_and_went_is_forgotten_by_who_watches(hub: MemoryHub) -> None:
    watching = [hub.join(f"watcher-{number}").subscribe(keys.ANY_ALIVE, keys.EVERYTHING) for number in range(4)]

    async def visit(name: str) -> None:
        bus = hub.join(name)
        bus.declare_alive()
        await bus.leave()
        for subscription in watching:
            here, gone = await subscription.next(), await subscription.next()
            assert here is not None
            assert gone is not None
            assert here.key == gone.key == keys.alive(name, "client")

    for number in range(100):
        await visit(f"first-{number}")
    gc.collect()
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        for number in range(VISITORS):
            await visit(f"client-{number}")
        gc.collect()
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()

    assert (after - before) / VISITORS < EACH
