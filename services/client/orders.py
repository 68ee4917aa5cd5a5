"""Orders to an engaged robot: to hold, go on, stop; faults of its body; the condition of a study."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Iterable
from contextlib import asynccontextmanager
from itertools import count
from typing import Any, Literal, Self

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import (
    BehaviorInterrupted,
    InterruptBehavior,
    PerformanceSteered,
    Steer,
    SteerPerformance,
    SteerRobot,
)
from engage_hri.schemas.body import Capabilities, DescribeBody
from engage_hri.schemas.body_faults import BodyFault, BodyFaults, FaultsSwitched, SwitchFaults
from engage_hri.schemas.faults import Fault, InputRefused, NoReply, RunFailed
from engage_hri.schemas.fragments import ConditionSet, Inhibit, SetCondition, StudyCondition
from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.interface import Bus, Keep
from engage_hri.services.client.feeds import Feed, first_of
from engage_hri.services.client.inputs import (
    checked,
    taken,
)
from engage_hri.services.requests.ends import Pending, Requester, RequestRefused


class OrderedRobot:
    """A robot that takes orders of a participant of its bus: base of `Robot`, which also performs and is followed."""

    def __init__(self, bus: Bus, requests: Requester) -> None:
        self._bus = bus
        self._requests = requests
        self._numbers = count(1)
        self._life = bus.new_life()
        """Part of the ids of fragments without one, so that they differ from those of another client or life."""

    @classmethod
    @asynccontextmanager
    async def on(cls, bus: Bus) -> AsyncIterator[Self]:
        """Make the client of a participant that has its own bus already.

        bus: its view of the bus. It stays open.
        """
        async with Requester(bus) as requests:
            yield cls(bus, requests)

    @property
    def id(self) -> str:
        """The robot's actor id, which is its namespace."""
        return self._bus.robot

    def now(self) -> Seconds:
        """Return the time on this process' clock: seconds, the time of the event loop."""
        return self._bus.now()

    def local(self, stamp: Stamp) -> Seconds:
        """Convert a message's stamp to seconds on this process' clock, comparable with `now`.

        stamp: an instant on any clock of the bus.
        """
        return self._bus.local(stamp)

    @asynccontextmanager
    async def inhibit_gaze(
        self,
        mode: Literal["release", "hold", "target"] = "hold",
        *,
        target: str = "",
        part: Literal["gaze", "point-left", "point-right"] = "gaze",
        ttl: Seconds = 5.0,
        timeout: Seconds | None = None,
    ) -> AsyncIterator[None]:
        """Keep the gaze (or an arm) from what fragments want, while the body of `async with` runs.

        It is a lease, renewed as long as this process lives. If it is lost the body runs on.

        mode: `release` lets the head go to the base gaze, `hold` keeps it where it is, `target` keeps it on `target`.
        target: id of an entity; for the mode `target` only.
        part: the head's gaze, or the arm that is not to point.
        ttl: seconds for which the lease holds when this process has died.
        timeout: seconds to wait for it to be accepted; None: for ever.

        Raises:
            InputRefused: for example, `target` is unknown.
            RunFailed: generation is gone, or has not come within `timeout`.
        """
        request = Inhibit(id=self._request_id("inhibit"), part=part, mode=mode, target=target, ttl=ttl)
        pending = self._requests.send(keys.INHIBIT, checked(keys.INHIBIT, request))
        try:
            await self._answer_of(pending, pending.accepted, timeout)
        except (asyncio.CancelledError, RunFailed):
            self._requests.cancel(request.id, "requester gave up")
            raise
        try:
            yield
        finally:
            self._requests.cancel(request.id, "released")
        # Only after a body without an error: one that was cancelled, or failed, must not wait here.
        await asyncio.wait([pending.outcome], timeout=ttl)

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

    async def switch_faults(
        self, faults: Iterable[BodyFault] = (), *, timeout: Seconds | None = None
    ) -> tuple[BodyFault, ...]:
        """Switch on exactly these faults of the body, in what is under way, too; returns what is on.

        Where others switch faults as well, `switch_on` and `switch_off` leave theirs as they are.

        faults: none: it is healthy again. `schemas/body_faults.py` says what each does. Rules for access keep this to
            operators and wizards.
        timeout: seconds to wait for the request to be accepted; None: for ever.

        Raises:
            InputRefused: the body cannot play one of them. Nothing has changed.
            RunFailed: control is gone, or has not come within `timeout`.
        """
        return await self._switch(on=tuple(faults), all_off=True, timeout=timeout)

    async def switch_on(self, *faults: BodyFault, timeout: Seconds | None = None) -> tuple[BodyFault, ...]:
        """Switch on these faults of the body besides those that are on; returns what is on.

        faults: each replaces one that differs from it in its amount alone. timeout, errors: as of `switch_faults`.
        """
        return await self._switch(on=faults, timeout=timeout)

    async def switch_off(self, *faults: BodyFault, timeout: Seconds | None = None) -> tuple[BodyFault, ...]:
        """Switch off these faults of the body, and no others; returns what is on.

        faults: of each, all go off that have the fields which it has; one with a kind alone means all of its kind.
        timeout, errors: as of `switch_faults`; InputRefused also if one of them is not on.
        """
        return await self._switch(off=faults, timeout=timeout)

    async def _switch(
        self,
        *,
        on: tuple[BodyFault, ...] = (),
        off: tuple[BodyFault, ...] = (),
        all_off: bool = False,
        timeout: Seconds | None,
    ) -> tuple[BodyFault, ...]:
        request = SwitchFaults(id=self._request_id("faults"), on=on, off=off, all_off=all_off)
        outcome = await self._ask(keys.FAULTS, request, timeout)
        assert isinstance(outcome, FaultsSwitched)
        return outcome.faults

    def body_faults(self) -> Feed[BodyFaults]:
        """Follow the faults that the body plays: now, and at every change."""
        return self._feed((BodyFaults,), keys.BODY_FAULTS)

    async def faults_on(self, timeout: Seconds | None = None) -> tuple[BodyFault, ...]:
        """Return the faults that the body plays now; waits for control.

        timeout: seconds to wait; None: for ever.

        Raises:
            NoReply: none within `timeout`.
        """
        return (await first_of(self.body_faults(), "state of the body", timeout)).faults

    async def capabilities(self, timeout: Seconds = 1.0) -> Capabilities:
        """Return what the body says of itself: its parts and joints, what it can do, which faults it can play.

        timeout: seconds to wait for control.

        Raises:
            NoReply: no answer within `timeout`.
        """
        said = await self._bus.query(keys.DESCRIBE, DescribeBody(), timeout=timeout)
        if not isinstance(said, Capabilities):
            raise NoReply(Fault(reason="no capabilities of a body", where=keys.DESCRIBE))
        return said

    async def set_condition(
        self, name: str = "", *, speech_only: bool = False, by: str = "", timeout: Seconds | None = None
    ) -> None:
        """Begin a condition; from now on what the robot does counts under this name, until another begins.

        name: at most 80 characters; empty: what comes belongs to none. speech_only: the robot says the words of the
            task and nothing else, its head to the upper right (`degraded-generation`; thesis 5.3).
        by: who sets it, for the record. Rules for access keep this to operators and wizards.
        timeout: seconds to wait for the request to be accepted; None: for ever.

        Raises:
            InputRefused: the name is too long. Nothing has changed.
            RunFailed: generation is gone, or has not come within `timeout`.
        """
        request = SetCondition(id=self._request_id("condition"), name=name, speech_only=speech_only, by=by)
        outcome = await self._ask(keys.CONDITION, request, timeout)
        assert isinstance(outcome, ConditionSet)

    def conditions(self) -> Feed[StudyCondition]:
        """Follow the condition: the one in force now, and each that begins."""
        return self._feed((StudyCondition,), keys.STUDY_CONDITION)

    async def condition(self, timeout: Seconds | None = None) -> StudyCondition:
        """Return the condition that is in force now; waits for generation.

        timeout: seconds to wait; None: for ever.

        Raises:
            NoReply: none within `timeout`.
        """
        return await first_of(self.conditions(), "condition of a study", timeout)

    async def _ask(self, key: str, request: Request, timeout: Seconds | None) -> Outcome:
        taken(timeout, Seconds | None, "timeout")
        return await self._finished(self._requests.send(key, checked(key, request)), timeout)

    async def _finished(self, pending: Pending, timeout: Seconds | None) -> Outcome:
        try:
            if timeout is not None:
                await self._answer_of(pending, pending.accepted, timeout)
            return await self._answer_of(pending, pending.outcome, None)  # type: ignore[no-any-return]
        except (asyncio.CancelledError, RunFailed):
            self._requests.cancel(pending.request.id, "requester gave up")
            raise

    async def _answer_of(self, pending: Pending, answer: Awaitable[Any], timeout: Seconds | None) -> Any:
        try:
            return await asyncio.wait_for(answer, timeout)
        except TimeoutError as error:
            reason, advice = f"no answer within {timeout} s", f"is {pending.server} running?"
            fault = Fault(reason=reason, where=pending.request.id, advice=advice, service=pending.server)
            raise RunFailed(fault) from error
        except RequestRefused as error:
            raise InputRefused(error.fault) from error

    def _request_id(self, subject: str) -> str:
        return f"{self._bus.name}/{subject}#{next(self._numbers)}"

    def _feed(self, kinds: tuple[type, ...], *patterns: str, keep: Keep = Keep.EVERY) -> Feed[Any]:
        self._requests.check()
        return Feed(self._bus.subscribe(*patterns, keep=keep), kinds, self._bus.now)


def _still_held(block: str, behavior: str, held_with: Literal["block", "robot"]) -> Fault:
    where = f"{block}: {behavior}" if behavior else block
    if held_with == "robot":
        advice = "let the robot go on: `engage steer continue`, or `resume()`"
        return Fault(reason="still held, because the whole robot is", where=where, advice=advice)
    advice = f"let the block go on: `engage steer continue {block}`, or `resume({block!r})`"
    return Fault(reason=f"still held, because all of block {block} is", where=where, advice=advice)
