"""Performance of one live block on the event loop: for each behavior a task, and one timer.

It decides nothing: what was measured goes to the `Decisions`, and their effects are carried out here. What a report
releases is commanded first; predictions, feedback and news for other blocks come after that.
"""

import asyncio
from collections.abc import Callable, Collection, Iterable, Mapping, MutableMapping, Set
from functools import partial

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.blocks import BlockOutcome, WarningKind
from engage_hri.schemas.body import Estimate, SyncPointArrived, SyncPointReached
from engage_hri.schemas.faults import Cause, Fault, InputRefused
from engage_hri.schemas.references import BLOCK_ITSELF
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus, Containing
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.decide.decisions import Begin, Decisions, Effect, Extend, Late, Stalled
from engage_hri.services.realizer.net.running import Observer, RunningNet
from engage_hri.services.realizer.perform.behavior_run import (
    BehaviorRun,
    ControlLink,
    PointPassed,
    Presence,
    RecognitionLink,
    Stage,
    SyncPointFutures,
    all_ended,
)
from engage_hri.services.realizer.perform.net_stream import NetStream
from engage_hri.services.realizer.plan.known import Known, is_named_in
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import planned_again, reestimated
from engage_hri.services.realizer.plan.remaining import events_needing, without
from engage_hri.services.realizer.plan.words import Spelling
from engage_hri.services.realizer.points import FINISH, Point, frozen
from engage_hri.services.realizer.report import News, Reporter, Spoken, completed, reasons
from engage_hri.services.realizer.together.live import Ending, Live
from engage_hri.services.realizer.together.live_blocks import LiveBlocks, Neighbor
from engage_hri.services.realizer.together.planning import Ask, Rehearsing, is_crowd, parts_moved
from engage_hri.services.realizer.together.ties import Ties
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.loop import Afterwards, Alarm, Timer


class SharedContext(Struct, frozen=True):
    """Context that all performances of one realizer share.

    routes: for the id of each request to the body, the performance that sent it. others: all performances, in the
    order in which they began. live_blocks: for ties between blocks. over: told of each block and behavior of it that
    is held and has ended. ask: asks the body about behaviors of a block.
    """

    bus: Bus
    requests: Requester
    config: RealizerConfig
    peers: Presence
    routes: "MutableMapping[str, BlockPerformance]"
    others: "Callable[[], list[BlockPerformance]]"
    live_blocks: LiveBlocks
    over: Callable[[str, str], None]
    ask: Ask

    def performed(self) -> list[Decisions]:
        """Decisions of all blocks that are performed, in the order in which they began."""
        return [each.decisions for each in self.others()]

    def rehearse(self, plan: Plan, but: object = None) -> None:
        """Let blocks rehearse what is to come, since a plan is new. but: a performance that need not."""
        others, parts = self.others(), parts_moved(plan, plan.chains)
        for each in () if is_crowd(self.performed()) else others:
            if each is not but:
                each.rehearsing.look_again(parts)


class BlockPerformance(Neighbor):
    """A block being performed. id: the manager's for it; its name among other blocks is that of its plan's block.

    plan: the one that it began with. interrupted: behaviors that are ended on request, each with the reason if one
    was given.
    """

    def __init__(
        self,
        live: Live,
        plan: Plan,
        shared: SharedContext,
        held: Collection[str] | None = (),
        *,
        is_held: bool = False,
    ) -> None:
        """held: behaviors that are held as it begins; None: all. is_held: whether anything is, perhaps elsewhere."""
        self._live, self.id = live, live.id
        self.plan, self._shared = plan, shared
        self.bus, self._config, self._ending = shared.bus, shared.config, live.ending
        self.futures = SyncPointFutures()
        spelling = Spelling(plan.block, live.elsewhere)
        self._net = NetStream(shared.bus, live.id, spelling, live.request.follows)
        self.report = Reporter(shared.bus, live.id, spelling)
        self.spoken = Spoken(plan.block.behaviors)
        self.body = ControlLink(shared.bus, shared.requests, live.request.id, live.id, shared.config.held_after)
        self.decisions = Decisions(
            plan, self.bus.now(), shared.config, self._observers, self._is_free, self.bus.sight, self._ending.done
        )
        recognition = RecognitionLink(
            shared.bus, shared.requests, shared.peers, lambda: (each.last_deed for each in shared.others())
        )
        stage = Stage(
            live.id, plan, self.decisions, self.bus, self.body, recognition, self.futures, self.spoken,
            self._arrive, self._reach, self.lose, self._lose_body,
        )  # fmt: skip
        self._runs = {id: BehaviorRun(stage, id) for id in plan.chains}
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._dropped = reasons(plan)
        """Behaviors that were dropped, each with the reason."""
        self._loss = Fault(reason="")
        """The fault of the last one that was lost."""
        self.interrupted: dict[str, str] = {}
        self._ties = Ties(plan, shared.live_blocks, live.elsewhere)
        self._held, self._is_held = held, is_held
        """What of it is held, and whether anything is."""
        self._stuck: tuple[Set[Point], Set[Point]] = frozen(), frozen()
        """Points of other blocks that do not come before what is held goes on; those that come no nearer either."""
        self._timer = Timer(self.take_in)
        self._afterwards = Afterwards(self.take_in)
        self._soon = Alarm(self.take_in)
        self.rehearsing = Rehearsing(
            self.decisions,
            shared.performed,
            self._known,
            self.bus.now,
            shared.ask,
            lambda estimates: self.take_in(partial(self._go_on_with_estimates, estimates)),
            self.containing,
        )
        self._untold: list[News] = []
        self._needs_replan = False
        self._is_informed = False
        """True once it knows what has become by now of all that it is tied to. What it is told one by one before that
        is no reason to begin: the next word may be that another tie is lost."""

    def containing(self) -> Containing:
        """Contain exceptions in the body of `with`: they end this block, and no other."""
        return self.bus.containing(self._live, self._live.fail)

    def abandon(self) -> None:
        """Cancel all that the block has asked for and take its parts home: its regular end has failed."""
        for id, run in self._runs.items():
            if run.pending is not None:
                self.body.cancel(id, "its block broke")
        self._go_home(self.parts_used)

    async def run(self) -> BlockOutcome:
        """Perform the block to its end, whatever that is. Ends everything it began."""
        began, block = self.decisions.began, self.plan.block.id
        if self._is_held:
            self.decisions.hold_up(True, self.bus.now())
            self._hold_still()
        self.report.started(self.plan, began)
        self.report.unkept(self.plan)
        for behavior in self.plan.dropped:
            self._shared.live_blocks.lose(block, behavior)
        self._shared.live_blocks.reach(block, Point(BLOCK_ITSELF, "start"), began)
        self.futures.fired(FINISH).add_done_callback(self._finish)
        try:
            async with asyncio.TaskGroup() as tasks:
                self._tasks = {
                    id: tasks.create_task(self._runs[id].perform(), name=f"{block}/{id}")
                    for id in self.plan.begun_in_order(self._runs)  # Those that begin with the block do so in order.
                }
                self._shared.live_blocks.perform(block, self, self._live.elsewhere)
                with self._shared.live_blocks.followed(self, set(self._ties.foreign)):
                    self._begin_among_others()
                    self.tell_stuck()
                    self._take_out(self._live.taken_out)
                    self._is_informed = True
                    self.take_in()
                    self._shared.rehearse(self.plan, but=self)
                    ending = await asyncio.shield(self._ending)  # others wait for it, too
                    await self._end_behaviors(ending)
                for task in self._tasks.values():
                    task.cancel()
        finally:
            self._close()
        outcome = self._outcome
        self.report.ended(outcome.status, began)
        self._shared.live_blocks.reach(block, Point(BLOCK_ITSELF, "end"), self.bus.now())
        return outcome

    @property
    def _outcome(self) -> BlockOutcome:
        return completed(
            self._live.outcome, self.plan.block, self.spoken.texts, self._dropped, self.interrupted, self._loss
        )  # fmt: skip

    def _observers(self, plan: Plan, net: RunningNet, began: Seconds) -> tuple[Observer, ...]:
        self._net.planned(plan, net, began)
        return (self.futures.adopt(net), self._net)

    def _finish(self, fired: "asyncio.Future[Seconds]") -> None:
        if not fired.cancelled():
            self._live.stop(Ending("done"))

    def is_going_on(self, behavior: str) -> bool:
        """True if the behavior is of this block and has neither ended nor been dropped."""
        is_left = behavior in self._tasks and behavior not in self._dropped
        return is_left and not self._ending.done() and not self.decisions.facts.has_ended(behavior)

    async def interrupt(self, behavior: str, reason: str = "") -> bool:
        """End one behavior on request; the others go on. Returns once it has ended: True if it came to its end."""
        if (run := self._runs[behavior]).pending is not None and run.is_by_body:
            self.interrupted[behavior] = reason
            self.body.cancel(behavior, reason or "interrupted")
            await asyncio.wait([self._tasks[behavior]])
        else:
            self._take_out({behavior: reason})
            self.take_in()
        return behavior not in self._dropped and self.decisions.facts.has_ended(behavior)

    def _take_out(self, behaviors: Mapping[str, str]) -> None:
        for behavior in sorted(behaviors.keys() & self._tasks.keys()):  # Others were dropped before.
            self.interrupted[behavior] = behaviors[behavior]
            self._tasks[behavior].cancel()
            self.body.cancel(behavior, "interrupted")
            self.lose(behavior, Fault(reason="interrupted", cause="cancelled"))

    def feed(self, message: SyncPointArrived | SyncPointReached) -> None:
        """Take a report of the body about a behavior of this block."""
        if (run := self._runs.get(message.behavior)) is not None:
            run.feed(message)

    # -- other blocks (see `Neighbor`) -------------------------------------------------------------------------------

    @property
    def newest_plan(self) -> Plan:
        return self.decisions.plan

    def times(self) -> Mapping[Point, Seconds]:
        return self.decisions.foresight.times(self.bus.now())

    def follow(self, points: Iterable[Point]) -> None:
        if points:
            self.take_in(partial(self.decisions.follow, points))
            if self._ties.name(points):
                self._replan_for_parts()

    def hear(self, point: Point, at: Seconds) -> None:
        if point in self._ties.foreign:
            self.take_in(partial(self._hear, point, at))

    def _hear(self, point: Point, at: Seconds) -> None:
        facts = self.decisions.facts
        if point not in facts.reached:
            facts.hear(point, at)
            if point in facts.reached:  # else it was named by an earlier plan only
                self.report.compare(self.decisions, point)

    def foresee(self, point: Point, at: Seconds) -> None:
        if point in self._ties.foreign:
            self.take_in(partial(self.decisions.foresight.foresee, point, at))

    def miss(self, behaviors: Iterable[str]) -> None:
        if missed := self._ties.miss(behaviors, self.decisions):
            self.take_in(partial(self._go_on_without, missed))

    def _go_on_without(self, missed: Collection[Point]) -> None:
        """Plan without points of other blocks; fail if a required behavior or constraint was tied to one of them."""
        for id, point in self._ties.needed(missed, self.decisions):
            if id not in self.interrupted:
                reason = f"{self.report.spelling(point)}, which it is tied to, does not come, and the tie is required"
                fault = Fault(reason=reason)
                self._tell()
                self.report.warn("EXECUTION_FAILURE", fault.within(self.id, id), id)
                self._live.fail(fault.at(f"{self.id}: {id}"))
                return
        self.replan()

    def _is_free(self, behavior: str) -> bool:
        is_free = self._ties.is_free(behavior, self.decisions, self._shared.performed(), self.bus.now())
        if not is_free:
            self.plan_again()
        return is_free

    def _known(self) -> Known:
        return self._ties.known(self.decisions, self._shared.performed(), self.bus.now())

    def _begin_among_others(self) -> None:
        """Tell other blocks that this one has begun: those that are tied to it can be planned now."""
        for each in self._shared.others():
            if each is not self and is_named_in(self.plan.block.id, each._ties.foreign_ties):
                each.take_in(each.replan)
        self._take_over()

    def _take_over(self) -> None:
        """Tell other blocks which of their behaviors this one takes a part from by plan."""
        plan = self.decisions.plan
        for other in self._shared.others():
            takes = ((name.partition(":"), taker) for name, taker in plan.takes.items())
            taken = {id: taker for (of, _, id), taker in takes if of == other.plan.block.id}
            if other._ties.keep(plan.block.id, taken):
                other._replan_for_parts()
            for behavior, taker in taken.items():
                start = Point(f"{plan.block.id}:{taker}", "start")
                if other._ties.give(behavior, start, other.decisions.plan):
                    other._replan_for_parts()

    def _replan_for_parts(self) -> None:
        """Plan again at once, with the parts that it hands over."""
        if self._ties.may_replan(self.bus.now()):
            self.take_in(self.replan)

    # -- holds -------------------------------------------------------------------------------------------------------

    def hold_up(self, is_held: bool) -> None:
        """Note that something is held from now on, perhaps of another block, or nothing any more."""
        if is_held != self._is_held:
            self._is_held = is_held
            self.decisions.hold_up(is_held, self.bus.now())
            if not is_held:  # All comes at another time beside the others than was rehearsed.
                self._shared.rehearse(self.decisions.plan)

    def hold(self, behaviors: Collection[str] | None) -> None:
        """Hold these behaviors, and no others, from now on. None: all of them."""
        if behaviors != self._held:
            self._held = behaviors
            self.take_in(self._hold_still)

    def stick(self, elsewhere: Set[Point], standing: Set[Point]) -> None:
        named = self._ties.foreign
        if (elsewhere & named, standing & named) != self._stuck:
            self._stuck = elsewhere & named, standing & named
            self.take_in(self._hold_still)

    def stuck(self, elsewhere: Set[Point], standing: Set[Point]) -> Set[Point]:
        return self._found(lambda: self.decisions.stuck(elsewhere, standing))

    def running(self, elsewhere: Set[Point], running: Set[Point]) -> Set[Point]:
        return self._found(lambda: self.decisions.running(elsewhere, running))

    def _found(self, points: Callable[[], Set[Point]]) -> Set[Point]:
        found = set[Point]()
        if not self._ending.done():
            with self.containing():
                found.update(points())
        return found

    def tell_stuck(self) -> None:
        """Tell other blocks what is stuck, if anything is held."""
        if self._is_held:
            self._shared.live_blocks.tell_stuck()

    def _hold_still(self) -> None:
        for effect in self.decisions.hold(self._held, self.bus.now(), *self._stuck):
            self.apply(effect)

    # -- the end -----------------------------------------------------------------------------------------------------

    async def _end_behaviors(self, ending: Ending) -> None:
        """Abort what still runs, and wait until all has ended, or for as long as the body is given."""
        self._tell()
        await all_ended(self._runs, self._tasks, self.body, ending, self.bus)
        if self._outcome.status == "done":
            self.decisions.net.let_go()
        else:
            self.decisions.net.clear()
        self._net.end()
        if ending.status == "failed":
            self._go_home(self.parts_used)

    def _close(self) -> None:
        self._timer.set(None)
        self._soon.stop()
        self.rehearsing.stop()
        self._net.close()
        self._afterwards.stop()
        self._tell()
        for id in self._runs:
            self._shared.routes.pop(self.body.id(id), None)
        self.futures.cancel()

    # -- what is decided, carried out --------------------------------------------------------------------------------

    def take_in(self, news: Callable[[], object] = lambda: None) -> None:
        """Take in `news`, and do what follows from it, unless the block is ending."""
        if not self._ending.done():
            with self.containing():
                news()
                self._tell()
                if self._is_informed:
                    self._advance()

    def _advance(self) -> None:
        self._afterwards.stop()
        if self._needs_replan:
            self.replan()
        again = True
        while again and not self._ending.done():
            made_news = [self.apply(effect) for effect in self.decisions.advance(self.bus.now())]
            again = any(made_news)
        foresight = self.decisions.foresight
        if foresight.is_surprised and self.bus.now() >= self.report.not_before and not self._ending.done():
            self.report.expect(self.decisions.plan, self.decisions.began, foresight.expected(self.bus.now()))
        self._shared.live_blocks.foresee(self.plan.block.id, foresight.ahead)
        self.tell_stuck()
        untold = self.report.not_before if foresight.is_surprised else None
        deadlines = [each for each in (self.decisions.deadline, untold) if each is not None]
        self._timer.set(min(deadlines) if deadlines and not self._ending.done() else None)
        self._net.tell_soon()

    def apply(self, effect: Effect) -> bool:
        """Carry out one decision; True if there is more to be decided then."""
        match effect:
            case Begin(behavior=id):
                self._shared.routes[self.body.id(id)] = self
                self._runs[id].command(effect)
            case Extend(behavior=id):
                self._runs[id].command(effect)
            case Late():
                if not self._shared.peers.has_left("control"):
                    self.report.overdue(self.decisions, effect)
                self.decisions.foresight.is_surprised = True
            case Stalled(behavior=id, sync=sync, overdue=overdue):
                sync = self.report.spelling.sync(Point(id, sync))
                fault = self._stalled(f"stalled before {sync}, {overdue:.1f} s overdue", overdue)
                self.body.cancel(id, fault)
                self._runs[id].lose(fault)
                return True
        return False

    def _stalled(self, what: str, overdue: Seconds) -> Fault:
        cause: Cause = "gone" if self._shared.peers.has_left("control") else "late"
        return self.bus.sight.fault(what, "", cause, "control", "", self.bus.now() - overdue)

    def _tell(self) -> None:
        """Tell what was reached, in feedback and to other blocks."""
        while self._untold:  # one by one: others may have it planned again when they hear, and that tells the rest
            point, at, arrived, by_body = self._untold.pop(0)
            self.spoken.reach(point)
            came = self.decisions.facts.arrived.get(point, arrived)
            self.report.reached(self.decisions, point, arrived=came, by_body=by_body)
            self._shared.live_blocks.reach(self.plan.block.id, point, at)
            self._let_go(point.behavior)

    def _let_go(self, behavior: str) -> None:
        """Hold a behavior no more once it has ended: nothing else is to be late for it."""
        if self._held is not None and behavior in self._held and not self.is_going_on(behavior):
            self._shared.over(self.id, behavior)

    # -- what behaviors tell -----------------------------------------------------------------------------------------

    def _arrive(self, point: Point, at: Seconds) -> None:
        if not self._ending.done():
            self.decisions.arrive(point, at)
            self._hurry()

    def _reach(self, told: PointPassed) -> None:
        point, at = told.point, told.at
        if news := self.decisions.reach(point, at):
            self._untold += [News(each, at, told.arrived if each == point else None, told.by_body) for each in news]
            for each in news:
                self.futures.reach(each, at)
            self._hurry()

    def _hurry(self) -> None:
        """Command at once what measured events alone release; all else follows soon."""
        if not self._ending.done() and not self._needs_replan:
            for effect in self.decisions.urgent(self.bus.now()):
                self.apply(effect)
        self._afterwards.set()

    def lose(self, id: str, fault: Fault, kind: WarningKind = "EXECUTION_FAILURE", at_rest: bool = False) -> None:
        """Drop a behavior that cannot be finished; if it is required, the block fails. at_rest: its parts rest."""
        if id in self._dropped or self._ending.done():
            return
        self._tell()
        self._dropped[id] = why = fault.within(self.id, id)
        self._loss = fault
        if id in self.interrupted:
            # Its parts go home by themselves: the body does not need to be told, nor to forget what it looked at.
            self.report.interrupted(id, self.spoken.of(id), self.interrupted[id])
        else:
            self.report.warn(kind, why, id)
            if id in self.decisions.facts.begun and not at_rest:
                self._go_home(self.plan.parts(id), id)
            if id in self.plan.required:
                self._live.stop(Ending("failed", fault.at(f"{self.id}: {id}")))
        self._let_go(id)
        for event in events_needing(id, self.plan.block):
            if self.is_going_on(event.id):  # what else needs it falls by the next plan
                self._tasks[event.id].cancel()
                self.body.cancel(event.id, f"{id} was dropped")
                fallen = replace(fault, reason=without(id), where="", line=event.line, advice="")
                self.lose(event.id, fallen, kind, at_rest=True)
        self.plan_again()

    def plan_again(self) -> None:
        """Plan again, later and once, for all that happens in one go."""
        self._needs_replan = True
        self._soon.set(self.bus.now())

    def _lose_body(self, fault: Fault) -> None:
        """End the block: what performs it is gone."""
        if not self._ending.done():
            self._tell()
            self.report.warn("EXECUTION_FAILURE", fault.within(self.id))
        self._live.stop(Ending("failed", fault))

    def replan(self) -> None:
        """Go on as if what was dropped, or vanished elsewhere, had never been written."""
        self._tell()  # A behavior of which something is to be told may not be in the new plan.
        self._needs_replan = False
        try:
            self._go_on_with(planned_again(self.decisions.plan, self._known(), self._gone))
        except InputRefused as error:
            self._live.fail(error.fault)

    def _go_on_with_estimates(self, estimates: Iterable[Estimate]) -> None:
        """Go on with other estimates, if that costs nothing."""
        self._tell()
        plan = reestimated(self.decisions.plan, self._known(), self._gone, estimates)
        if plan is not None and not self._needs_replan:
            self._go_on_with(plan)

    @property
    def _gone(self) -> tuple[str, ...]:
        return (*self._dropped, *self._ties.gone(self.decisions))

    def _go_on_with(self, plan: Plan) -> None:
        gone = self._gone
        self.decisions.replan(plan)
        self._shared.live_blocks.follow(self, self._ties.renew(self.decisions))
        self._take_over()
        self._shared.rehearse(plan)
        # Told only now that the block goes on: its followers would end with it. What they do may drop more of it.
        for id in tuple(self._dropped):
            self._shared.live_blocks.lose(self.plan.block.id, id)
        if self.decisions.plan is not plan:
            return  # What others did then had it planned again.
        if not self.decisions.facts.has_held:  # else it is told when it comes, without what holds account for
            self.report.unkept(plan)
        self.report.given_up(plan)
        for problem in plan.problems:
            # Without the dropped ones, others may be too late now.
            if problem.behavior in plan.dropped and problem.behavior not in gone:
                if self._runs[problem.behavior].pending is not None:
                    self.body.cancel(problem.behavior, problem.message)
                self.lose(problem.behavior, Fault(reason=problem.message), problem.kind)

    # -- parts of the body -------------------------------------------------------------------------------------------

    def _go_home(self, parts: set[str], name: str = "") -> None:
        """Send parts home, except those that another behavior moves by now. name: the behavior that used them."""
        others = (other for other in self._shared.others() if name or other is not self)
        if parts := parts.difference(*(other.parts_moving for other in others)):
            self.body.go_home(parts, name)

    @property
    def parts_used(self) -> set[str]:
        """Parts of the body used by behaviors that have begun so far."""
        return {part for id in self.decisions.facts.begun for part in self.plan.parts(id)}

    @property
    def parts_moving(self) -> set[str]:
        """Parts of the body used by behaviors that have begun and not ended."""
        moving = {id for id, run in self._runs.items() if run.behavior is not None} - self._dropped.keys()
        return {part for id in moving if not self.decisions.facts.has_ended(id) for part in self.plan.parts(id)}

    @property
    def last_deed(self) -> Seconds:
        """Time when the robot last did something of the block: now, while it speaks.

        A look goes on until the block ends, and that may wait for the decision of an event: it is no deed.
        """
        facts = self.decisions.facts
        return self.bus.now() if "voice" in self.parts_moving else max(facts.reached.values(), default=facts.began)
