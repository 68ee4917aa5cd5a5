"""Long work on the event loop a slice at a time: whatever else is due comes in between."""

import asyncio

from engage_hri.services.runtime.steps import Steps, T

SLICE = 512
"""Elements that are worked on in one go (see `steps`): one to five milliseconds. Counted: equal runs stay equal."""


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
