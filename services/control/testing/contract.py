"""The contract suite: what every body must do. A driver subclasses `BodyContract` and says how to make its body.

    class TestMyRobot(BodyContract):
        tolerance = 0.15
        def make(self):
            return MyRobot(simulated=True)

Each test is a law. Its docstring says what holds, and, after that, what it usually is if it does not.
"""

import asyncio
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from msgspec import Struct

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.testing.endings import EndingLaws
from engage_hri.services.control.testing.estimates import ClaimLaws, PredictionLaws
from engage_hri.services.control.testing.findings import broken, ms
from engage_hri.services.control.testing.holding import HoldingLaws
from engage_hri.services.control.testing.looking import LookingLaws, TakeoverLaws
from engage_hri.services.control.testing.motions import recorded
from engage_hri.services.control.testing.points import PointsLaws
from engage_hri.services.control.testing.stage import done
from engage_hri.services.control.testing.suite import Suite, by_each
from engage_hri.services.control.testing.truth import TruthLaws

LONGEST: Seconds = 0.02
"""Most that one call of the loop may hold it: less than half of the time in which a point has to be told."""
TRIES = 3


class FreedomLaws(Suite):
    """Part of `BodyContract`."""

    topic = "the loop"

    @by_each()
    async def test_keeps_the_loop_free(self, body: Body, behavior: BlockBehavior) -> None:
        """Nothing that a body does holds the loop for more than 20 ms: others have their turn meanwhile.

        Usually `go`, `angles` or a task of the driver calls an SDK that blocks (a serial port, HTTP, `time.sleep`):
        `await asyncio.to_thread(...)` in the driver, or a process of its own for the SDK.
        """
        turns: list[LoopTurn] = []
        while len(turns) < TRIES and (not turns or turns[-1].held > LONGEST):
            async with recorded(body):
                with longest_turn() as turn:
                    body.see(self.world)
                    await done(body, behavior)
                    await body.home()
            turns.append(turn)
        best = min(turns, key=lambda each: each.held)
        if best.held > LONGEST:
            broken(
                expected=f"at most {ms(LONGEST)} in one call of the loop",
                measured=f"{ms(best.held)}, of which it computes {ms(best.computes)}",
                advice="it computes: in a process of its own, or with an `await` in between"
                if best.computes > best.held / 2
                else "it waits: by `await asyncio.to_thread(...)`, or in a process of its own",
            )


class LoopTurn(Struct):
    """The longest turn of the loop. held: time for which it is to blame. computes: time of the processor in it."""

    held: Seconds = 0.0
    computes: Seconds = 0.0


@contextmanager
def longest_turn() -> Iterator[LoopTurn]:
    """Time each call that the running loop makes meanwhile. What is given to it before is not timed."""
    loop, longest = asyncio.get_running_loop(), LoopTurn()
    soon, at = loop.call_soon, loop.call_at

    def timed(callback: Callable[..., object], *args: Any) -> None:
        waits, computed, since = _waits(), time.thread_time(), time.perf_counter()
        try:
            callback(*args)
        finally:
            took, computes = time.perf_counter() - since, time.thread_time() - computed
            held = took if waits is None or _waits() != waits else computes
            if held > longest.held:
                longest.held, longest.computes = held, computes

    loop.call_soon = lambda callback, *args, context=None: soon(  # type: ignore[method-assign]
        partial(timed, callback), *args, context=context
    )
    loop.call_at = lambda when, callback, *args, context=None: at(  # type: ignore[method-assign]
        when, partial(timed, callback), *args, context=context
    )
    try:
        yield longest
    finally:
        del loop.call_soon, loop.call_at


def _waits() -> int | None:
    """Count how often this thread has given the processor away by itself; None: this system does not tell."""
    if sys.platform != "linux":
        return None
    from resource import RUSAGE_THREAD, getrusage

    return getrusage(RUSAGE_THREAD).ru_nvcsw


class BodyContract(
    PointsLaws, HoldingLaws, EndingLaws, TakeoverLaws, PredictionLaws, ClaimLaws, TruthLaws, LookingLaws, FreedomLaws
):
    """All laws of the contract. Subclass it in a test file; `Suite` has what a subclass may set."""
