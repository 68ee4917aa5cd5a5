"""Long work on the event loop a slice at a time: whatever else is due comes in between."""

import asyncio
from collections.abc import Coroutine
from typing import Any

from engage_hri.services.runtime.steps import SLICE, Steps, T


async def unhurried(steps: Steps[T]) -> T:
    """The result of long work, done a slice at a time: whatever else is due comes in between.

    A cancellation takes effect at the end of the slice.
    """
    done = 0
    try:
        while True:
            done += next(steps)
            if done >= SLICE:
                done = 0
                await asyncio.sleep(0)
    except StopIteration as end:
        result: T = end.value
        return result
    finally:
        steps.close()


class InTurns:
    """Long works one after the other, in slices: two at once would only make both late."""

    def __init__(self) -> None:
        self._turn = asyncio.Lock()

    def answer(self, steps: Steps[T]) -> T | Coroutine[Any, Any, T]:
        """The result, if one slice is enough for it, else what is to be awaited for it."""
        done = 0
        try:
            while done < SLICE:
                done += next(steps)
        except StopIteration as end:
            result: T = end.value
            return result
        return self._rest(steps)

    async def _rest(self, steps: Steps[T]) -> T:
        try:
            async with self._turn:
                await asyncio.sleep(0)
                return await unhurried(steps)
        finally:
            steps.close()
