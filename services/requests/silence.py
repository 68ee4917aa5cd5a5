"""Waiting for others by the law of `Silences`: what is not done in time, although this process was awake."""

import asyncio
from collections.abc import Iterable
from typing import Any, TypeVar

from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.requests.deadlines import Silences

F = TypeVar("F", bound=asyncio.Future[Any])


async def unfinished(awaited: Iterable[F], within: Seconds, bus: Bus) -> set[F]:
    """Wait until all of these are done, or their time is over. Returns those that are not."""
    left, time = {*awaited}, Silences[str](bus.sight)
    time.set("over", bus.now() + within)
    while left and time.due(bus.now()) is None:
        assert time.earliest is not None
        _, left = await asyncio.wait(left, timeout=time.earliest - bus.now())
    return left
