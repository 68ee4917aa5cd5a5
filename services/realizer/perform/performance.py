"""Performance of one live block on the event loop: for each behavior a task and a future (its beginning); one timer.

It decides nothing: what was measured goes to the `Decisions`, and their effects are carried out here.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping
from functools import partial

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Event, TurnSignal, Wait
from engage_hri.schemas.blocks import Block, BlockOutcome
from engage_hri.schemas.body import BehaviorOutcome, SyncPointArrived, SyncPointReached
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.feedback import WarningKind
from engage_hri.schemas.syncref import BLOCK_ITSELF
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Containing
from engage_hri.services.realizer.decide.decisions import Decisions
from engage_hri.services.realizer.decide.effects import Begin, Effect, Extend
from engage_hri.services.realizer.decide.lateness import Late, Stalled
from engage_hri.services.realizer.perform.control_link import ControlLink
from engage_hri.services.realizer.perform.feedback import Reporter
from engage_hri.services.realizer.perform.live import Ending, Live
from engage_hri.services.realizer.perform.recognition_link import RecognitionLink
from engage_hri.services.realizer.perform.shared_context import SharedContext
from engage_hri.services.realizer.perform.spoken import Spoken
from engage_hri.services.realizer.plan.planner import Plan, plan_block
from engage_hri.services.realizer.plan.relations import DROPPED
from engage_hri.services.realizer.points import Point, performer
from engage_hri.services.requests.ends import NeverEnded, Pending, RequestRefused
from engage_hri.services.runtime.alarm import Timer


class BlockPerformance:
    """A block being performed."""

    def __init__(self, live: Live, plan: Plan, shared: SharedContext, elsewhere: Mapping[str, Block]) -> None:
        """elsewhere: other blocks, which the plan may name points of."""
        loop = asyncio.get_running_loop()
        self._live = live
        self.plan = plan
        self._shared = shared
        self._bus = shared.bus
        self._requests = shared.requests
        self._config = shared.config
        self._recognition = RecognitionLink(shared.bus, shared.requests, shared.config, shared.peers)
        self._body = ControlLink(shared.bus, shared.requests, live.request.id, plan.block.id)
        self._report = Reporter(shared.bus, plan.block.id, shared.config.skew)
        self._begun: dict[str, asyncio.Future[None]] = {id: loop.create_future() for id in plan.chains}
        self._asked: dict[str, Begin | Extend] = {}
        """The last command to each behavior."""
        self._pending: dict[str, Pending] = {}
        self._running: dict[str, asyncio.Task[None]] = {}
        why = {each.behavior: each.message.removesuffix(DROPPED) for each in reversed(plan.problems)}
        self._dropped = {id: why.get(id, "") for id in plan.dropped}
        """Behaviors that were dropped, each with the reason."""
        self._interrupted: set[str] = set()
        """Behaviors that are ended on request."""
        self._elsewhere = elsewhere
        self._foreign = frozenset(plan.foreign)
        self._vanished: set[str] = set()
        """Behaviors of other blocks of which some point will never be reached."""
        self._performed: dict[str, BlockBehavior] = {}
        """Behaviors as they were begun: a later plan may have chosen another hand."""
        self.spoken = Spoken(plan.block.behaviors)
        self._ending = live.ending
        self._timer = Timer(self._take_in)
        self._needs_replan = False

    def containing(self) -> Containing:
        """Contain exceptions in the body of `with`: they end this block, and no other."""
        return self._bus.containing(self._live, self._live.fail)

    def abandon(self) -> None:
        """Cancel all that the block has asked for and take its parts home: its regular end has failed."""
        for behavior in self._pending:
            self._requests.cancel(self._body.id(behavior), "its block broke")
        self._go_home(self.parts_used)

    async def run(self) -> BlockOutcome:
        """Perform the block to its end, whatever that is. Ends everything it began."""
        began = self._bus.now()
        self.decisions = Decisions(self.plan, began, self._config)
        self._report.started(self.plan, began)
        for problem in self.plan.problems:
            self._report.warn(problem.kind, problem.message, problem.behavior)
        for behavior in self.plan.dropped:
            self._shared.live_blocks.lose(self.plan.block.id, behavior)
        self._shared.live_blocks.reach(self.plan.block.id, Point(BLOCK_ITSELF, "start"), began)
        rank = {id: number for number, id in enumerate(self.plan.entering)}
        try:
            async with asyncio.TaskGroup() as tasks:
                # Those that begin with the block do so in this order.
                self._running = {
                    behavior.id: tasks.create_task(
                        self._perform(behavior), name=f"{self.plan.block.id}/{behavior.id}"
                    )
                    for behavior in sorted(self.plan.behaviors, key=lambda each: rank.get(each.id, len(rank)))
                }
                self._shared.live_blocks.perform(self.plan.block.id, self)
                with self._shared.live_blocks.followed(self, self._foreign, self._elsewhere):
                    self._advance()
                    ending = await asyncio.shield(self._ending)  # others wait for it, too
                    await self._end_behaviors(ending)
                for task in self._running.values():
                    task.cancel()
        finally:
            self._close()
        self._report.ended(ending.status, began)
        self._shared.live_blocks.reach(self.plan.block.id, Point(BLOCK_ITSELF, "end"), self._bus.now())
        return replace(
            self._live.outcome,
            spoken=self.spoken.texts,
            dropped=tuple(id for id in self._dropped if id not in self._interrupted),
            reasons=tuple(why for id, why in self._dropped.items() if id not in self._interrupted),
            interrupted=tuple(id for id in self._dropped if id in self._interrupted),
        )

    def is_going_on(self, behavior: str) -> bool:
        """True if the behavior is of this block and has neither ended nor been dropped."""
        return not self._ending.done() and behavior in self._running and not self.decisions.has_ended(behavior)

    async def interrupt(self, behavior: str) -> bool:
        """End one behavior on request; the others go on. Returns once it has ended: True if it came to its end."""
        task = self._running[behavior]
        self._interrupted.add(behavior)
        if behavior in self._pending and performer(self._performed[behavior]) == "body":
            self._body.abort(behavior)
            await asyncio.wait([task])
        else:
            task.cancel()
            self._requests.cancel(self._body.id(behavior), "interrupted")
            self._lose(behavior, Fault(reason="interrupted"))
            self._advance()
        return behavior not in self._dropped and self.decisions.has_ended(behavior)

    def feed(self, message: SyncPointArrived | SyncPointReached) -> None:
        """Take a report of the body about a behavior of this block."""
        pending = self._pending.get(message.behavior)
        if pending is None or pending.request.id != message.id or pending.outcome.done():
            return
        point = Point(message.behavior, message.sync)
        at = self.decisions.plausible(point, self._bus.local(message.at), self._bus.now())
        if isinstance(message, SyncPointArrived):
            self.decisions.arrive(point, at)
        else:
            arrived = self.decisions.plausible(point, self._bus.local(message.arrived), at)
            self._reach(point, at, arrived=arrived, by_body=True)
        self._advance()

    # -- other blocks ------------------------------------------------------------------------------------------------

    def hear(self, point: Point, at: Seconds) -> None:
        """Note that a point of another block is reached."""
        if point in self._foreign:
            self._take_in(partial(self.decisions.reach, point, at))

    def foresee(self, point: Point, at: Seconds) -> None:
        """Note that a point of another block is expected at `at` now."""
        if point in self._foreign:
            self._take_in(partial(self.decisions.foresee, point, at))

    def follow(self, points: Iterable[Point]) -> None:
        """Tell from now on when these points are expected: other blocks are tied to them."""
        if points:
            self._take_in(partial(self.decisions.follow, points))

    def miss(self, behaviors: Iterable[str]) -> None:
        """Plan without these behaviors of other blocks if a point of them is needed that is not reached."""
        lost = {point.behavior for point in self._foreign - self.decisions.reached.keys()}.intersection(behaviors)
        lost -= self._vanished
        if lost:
            self._vanished |= lost
            self._take_in(self._replan)

    def _take_in(self, news: Callable[[], object] = lambda: None) -> None:
        """Take in `news`, and do what follows from it, unless the block is ending."""
        if not self._ending.done():
            with self.containing():
                news()
                self._advance()

    async def _end_behaviors(self, ending: Ending) -> None:
        """Abort what still runs, and wait until all has ended, or for as long as the body is given."""
        moving, running = dict[asyncio.Task[None], str](), self._running
        for behavior in self.plan.block.behaviors:
            pending = self._pending.get(behavior.id)
            if pending is None or running[behavior.id].done():
                continue
            if performer(behavior) == "body":
                moving[running[behavior.id]] = behavior.id
                if ending.status != "done" and not pending.outcome.done():
                    self._body.abort(behavior.id)
            elif ending.status != "done":
                self._requests.cancel(self._body.id(behavior.id), f"block {ending.status}")
        if moving:
            _, stuck = await asyncio.wait(moving, timeout=self._config.abort)
            for task in stuck:  # Its request is not to be kept alive: it is over, though the body does not say so.
                self._requests.cancel(self._body.id(moving[task]), "its block has ended")
        if ending.status == "failed":
            self._go_home(self.parts_used)

    def _close(self) -> None:
        self._timer.set(None)
        for behavior in self.plan.block.behaviors:
            self._shared.routes.pop(self._body.id(behavior.id), None)
        for future in self._begun.values():
            future.cancel()

    # -- what is decided, carried out --------------------------------------------------------------------------------

    def _advance(self) -> None:
        if self._needs_replan and not self._ending.done():
            self._replan()
        again = True
        while again and not self._ending.done():
            made_facts = [self._apply(effect) for effect in self.decisions.advance(self._bus.now())]
            again = any(made_facts)
        if self.decisions.is_surprised and self._report.may_expect() and not self._ending.done():
            self._report.expect(self.decisions.plan, self.decisions.began, self.decisions.expected(self._bus.now()))
        self._shared.live_blocks.foresee(self.plan.block.id, self.decisions.ahead)
        if self.decisions.is_over:
            self._live.stop(Ending("done"))
        self._timer.set(None if self._ending.done() else self.decisions.deadline)

    def _apply(self, effect: Effect) -> bool:
        """Carry out one decision; True if that made a new fact at once."""
        match effect:
            case Extend(behavior=id):
                self._asked[id] = effect
                behavior, end = self._performed.get(id), Point(id, "end")
                if isinstance(behavior, Wait) and end in self.decisions.arrived:
                    self._reach(end, self._bus.now(), arrived=self.decisions.arrived[end])
                    return True
                if behavior is not None and id in self._pending and performer(behavior) == "body":
                    self._send(behavior)
            case Begin(behavior=id) if not self._begun[id].done():  # done: its task was cancelled
                self._asked[id] = effect
                self._begun[id].set_result(None)
            case Late(behavior=id, sync=sync, overdue=overdue):
                if not self._shared.peers.has_left("control"):
                    instant = self.decisions.member(Point(id, sync)).point
                    self._report.late(instant, f"{sync} is {overdue:.1f} s overdue")
                self.decisions.is_surprised = True
            case Stalled(behavior=id, sync=sync, overdue=overdue):
                self._body.abort(id)
                self._lose(id, Fault(reason=f"stalled before {sync}, {overdue:.1f} s overdue"))
                return True
        return False

    def _reach(self, point: Point, at: Seconds, *, arrived: Seconds | None = None, by_body: bool = False) -> None:
        for each in self.decisions.reach(point, at):
            came = self.decisions.arrived.get(each, arrived if each == point else None)
            self._report.reached(self.plan, self.decisions, each, arrived=came, by_body=by_body)
            self.spoken.reach(each)
            self._shared.live_blocks.reach(self.plan.block.id, each, at)

    def _lose(self, id: str, fault: Fault, kind: WarningKind = "EXECUTION_FAILURE", *, at_rest: bool = False) -> None:
        """Drop a behavior that cannot be finished; if it is required, the block fails. at_rest: its parts rest."""
        if id in self._dropped or self._ending.done():
            return
        self._dropped[id] = str(fault)
        if id in self._interrupted:
            # Its parts go home by themselves: the body does not need to be told, nor to forget what it looked at.
            self._report.interrupted(id, self.spoken.of(id))
        else:
            self._report.warn(kind, str(fault), id)
            if id in self.decisions.begun and not at_rest:
                self._go_home(self._parts(id), id)
            if id in self.plan.required:
                self._live.stop(Ending("failed", Fault(reason=fault.reason, where=f"{self.plan.block.id}: {id}")))
        self._needs_replan = True  # later and once, for all that is lost in one go
        asyncio.get_running_loop().call_soon(self._take_in)

    def _replan(self) -> None:
        """Go on as if what was dropped, or vanished elsewhere, had never been written."""
        self._needs_replan = False
        gone = (*self._dropped, *self._vanished)
        try:
            plan = plan_block(self.plan.block, self.plan.estimates.values(), dropped=gone, elsewhere=self._elsewhere)
        except InputRefused as error:
            self._live.stop(Ending("failed", error.fault))
            return
        self.decisions.replan(plan)
        for id in self._dropped:  # Told only now that the block goes on: its followers would end with it.
            self._shared.live_blocks.lose(self.plan.block.id, id)
        for problem in plan.problems:
            # Without the dropped ones, others may be too late now.
            if problem.behavior in plan.dropped and problem.behavior not in gone:
                if problem.behavior in self._pending:
                    self._body.abort(problem.behavior)
                self._lose(problem.behavior, Fault(reason=problem.message), problem.kind)

    # -- performers --------------------------------------------------------------------------------------------------

    async def _perform(self, behavior: BlockBehavior) -> None:
        await self._begun[behavior.id]
        behavior = self._performed[behavior.id] = self.decisions.plan.chains[behavior.id].behavior
        match behavior:
            case Wait(duration=duration):
                await self._wait(behavior.id, duration or 0.0)
            case Event():
                await self._event(behavior)
            case TurnSignal():
                self._recognition.signal(self._body.id(behavior.id), self.plan.block.id, behavior)
                self._at_once(behavior.id)
            case _ if performer(behavior) == "clock":
                self._at_once(behavior.id)
            case _:
                await self._by_body(behavior)

    async def _by_body(self, behavior: BlockBehavior) -> None:
        self._shared.routes[self._body.id(behavior.id)] = self
        try:
            outcome = await self._send(behavior).outcome
        except (RequestRefused, NeverEnded) as error:
            refused = isinstance(error, RequestRefused)
            self._lose(behavior.id, error.fault, "CANNOT_CREATE_BEHAVIOR" if refused else "EXECUTION_FAILURE")
            return
        except EngageError as error:
            self._pending.pop(behavior.id)
            fault = Fault(reason=error.fault.reason, where=self.plan.block.id)
            if not self._ending.done():
                self._report.warn("EXECUTION_FAILURE", str(fault))
            self._live.stop(Ending("failed", fault))
            return
        if not isinstance(outcome, BehaviorOutcome):
            self._lose(behavior.id, Fault(reason=f"control ended it with a {type(outcome).__name__}"))
            return
        is_done = outcome.status == "done"
        self.spoken.end(outcome)
        if is_done:
            end = Point(behavior.id, sync_points(behavior)[-1])
            at = self.decisions.plausible(end, self._bus.local(outcome.at), self._bus.now())
            self._reach(end, at, by_body=True)
            self._advance()
        else:
            fault = outcome.fault or Fault(reason=f"the body {outcome.status} it")
            self._lose(behavior.id, fault, at_rest=outcome.status == "aborted")

    def _send(self, behavior: BlockBehavior) -> Pending:
        pending = self._pending[behavior.id] = self._body.perform(behavior, self._asked[behavior.id])
        return pending

    def _go_home(self, parts: set[str], name: str = "") -> None:
        """Send parts home, except those that another behavior moves by now. name: the behavior that used them."""
        others = (other for other in self._shared.others() if name or other is not self)
        if parts := parts.difference(*(other.parts_moving for other in others)):
            self._body.go_home(parts, name)

    @property
    def parts_used(self) -> set[str]:
        """Parts of the body used by behaviors that have begun so far."""
        return {part for id in self.decisions.begun for part in self._parts(id)}

    @property
    def parts_moving(self) -> set[str]:
        """Parts of the body used by behaviors that have begun and not ended."""
        moving = self._performed.keys() - set(self._dropped)
        return {part for id in moving if not self.decisions.has_ended(id) for part in self._parts(id)}

    def _parts(self, id: str) -> set[str]:
        estimate = self.plan.estimates.get(id)
        return set(estimate.parts) if estimate else set()

    async def _wait(self, id: str, duration: Seconds) -> None:
        began = self._bus.now()
        self._reach(Point(id, "start"), began)
        self._advance()
        if duration:
            await asyncio.sleep(began + duration - self._bus.now())
        if self._asked[id].through == "end":
            self._reach(Point(id, "end"), self._bus.now())
        else:
            self.decisions.arrive(Point(id, "end"), self._bus.now())
        self._advance()

    def _at_once(self, id: str) -> None:
        now = self._bus.now()
        for sync in ("start", "end"):
            self._reach(Point(id, sync), now)
        self._advance()

    async def _event(self, event: Event) -> None:
        began = self._bus.now()
        self._reach(Point(event.id, "start"), began)
        pending = self._recognition.ask(self._body.id(event.id), self.plan.block.id, event, began)
        if pending is not None:
            self._pending[event.id] = pending
        self._advance()
        try:
            decision = await self._recognition.decision(event, self.plan.block, pending, self.decisions.reached)
        except RequestRefused as error:
            self._lose(event.id, error.fault, kind="CANNOT_CREATE_BEHAVIOR")
        else:
            self._reach(Point(event.id, "end"), max(began, decision.at), by_body=decision.by_recognition)
        self._advance()
