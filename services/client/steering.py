"""Holding, continuing and ending what the robot performs, for its collaboration manager."""

from abc import ABC, abstractmethod
from typing import Literal

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import (
    BehaviorInterrupted,
    InterruptBehavior,
    PerformanceSteered,
    Steer,
    SteerPerformance,
    SteerRobot,
)
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.units import Seconds


class Steering(ABC):
    """The part of `Robot` that steers what is performed already."""

    @abstractmethod
    def _request_id(self, subject: str) -> str:
        """Id for a new request about `subject`."""

    @abstractmethod
    async def _ask(self, key: str, request: Request, timeout: Seconds | None) -> Outcome:
        """Send a request and wait for its outcome."""

    async def interrupt(self, block: str, behavior: str, *, timeout: Seconds | None = None) -> BehaviorInterrupted:
        """End one behavior of a live block, which goes on without it; returns when it has ended, with what was said.

        To end a whole block, cancel the task that awaits its `realize`.

        block: its id.
        behavior: its id within the block.
        timeout: seconds to wait for the request to be accepted; None: for ever.

        Raises:
            InputRefused: it is not being performed.
            RunFailed: the realizer is gone, or has not come within `timeout`.
        """
        id = self._request_id(f"{block}:{behavior}")
        request = InterruptBehavior(id=id, block=block, behavior=behavior)
        outcome = await self._ask(keys.BLOCK, request, timeout)
        assert isinstance(outcome, BehaviorInterrupted)
        return outcome

    async def hold(self, block: str = "", behavior: str = "", *, timeout: Seconds | None = None) -> tuple[str, ...]:
        """Hold a behavior, a block, or all that the robot performs, until `resume`; returns the ids of the blocks.

        Each behavior waits where it next can: a movement at its next hold point, speech between two words. Nothing
        begins, clocks stop, and nothing counts as late for it. What is held for longer than `realizer.longest_hold`
        is stopped.

        block: its id; empty: everything, and what comes meanwhile. Rules for access may keep that to operators.
        behavior: its id within the block; empty: all of it.
        timeout: seconds to wait for the request to be accepted; None: for ever.

        Raises:
            InputRefused: it is not being performed, or a behavior is given without its block.
            RunFailed: the realizer is gone, or has not come within `timeout`.
        """
        return await self._steer("hold", block, behavior, timeout)

    async def resume(self, block: str = "", behavior: str = "", *, timeout: Seconds | None = None) -> tuple[str, ...]:
        """Let what is held go on from where it is; returns the ids of the blocks.

        A block lets go all its behaviors, an empty `block` everything. Arguments and errors as in `hold`; it is also
        refused (InputRefused) if it is held still, because all of its block is, or the whole robot.
        """
        return await self._steer("continue", block, behavior, timeout)

    async def stop(self, block: str = "", behavior: str = "", *, timeout: Seconds | None = None) -> tuple[str, ...]:
        """End a behavior, a block, or all that the robot performs, safely; returns the ids of the blocks.

        It returns when they have ended: blocks as interrupted. Arguments and errors as in `hold`.
        """
        return await self._steer("stop", block, behavior, timeout)

    async def _steer(self, to: Steer, block: str, behavior: str, timeout: Seconds | None) -> tuple[str, ...]:
        if behavior and not block:
            raise InputRefused(Fault(reason="a behavior without its block", where=behavior))
        id = self._request_id(":".join((to, *filter(None, (block, behavior)))))
        if block:
            named = SteerPerformance(id=id, to=to, block=block, behavior=behavior)
            outcome = await self._ask(keys.BLOCK, named, timeout)
        else:
            outcome = await self._ask(keys.ROBOT, SteerRobot(id=id, to=to), timeout)
        assert isinstance(outcome, PerformanceSteered)
        if outcome.held_with:
            raise InputRefused(_still_held(block, behavior, outcome.held_with))
        return outcome.blocks


def _still_held(block: str, behavior: str, held_with: Literal["block", "robot"]) -> Fault:
    where = f"{block}: {behavior}" if behavior else block
    if held_with == "robot":
        advice = "let the robot go on: `engage steer continue`, or `resume()`"
        return Fault(reason="still held, because the whole robot is", where=where, advice=advice)
    advice = f"let the block go on: `engage steer continue {block}`, or `resume({block!r})`"
    return Fault(reason=f"still held, because all of block {block} is", where=where, advice=advice)
