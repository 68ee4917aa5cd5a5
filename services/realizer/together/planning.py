"""Planning of a block with the body: it is asked what behaviors take, before the block is performed and again after.

How long a behavior takes depends on where its parts are as it begins, so on the behaviors before it, of whatever
block. So a block is planned in rounds: the body is asked, the block is planned, and the body is asked about that
plan, with all that moves it meanwhile (`Planning`). Another block comes, something is dropped, parts change hands in
another order: then the phases that a plan was made with are no longer true. So a block that is being performed is
rehearsed once more (`Rehearsing`). Nothing waits for the answer.
"""

import asyncio
from collections.abc import Awaitable, Callable, Collection, Iterable, Mapping

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Hand
from engage_hri.schemas.blocks import Block, PerformBlock
from engage_hri.schemas.body import BodyPose, Estimate, EstimateBehaviors, EstimateItem, Estimates, PlannedTime
from engage_hri.schemas.check import validated
from engage_hri.schemas.faults import EngageError, Fault, NoReply
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus, Containing
from engage_hri.services.realizer.decide.decisions import Decisions
from engage_hri.services.realizer.plan.agreement import (
    NOTICEABLE,
    STRAIGHT,
    Rounds,
    behavior_times,
    between,
    difference,
    planned_times,
    poses_before,
)
from engage_hri.services.realizer.plan.handover import hands_refused
from engage_hri.services.realizer.plan.known import Known, is_foreign, is_named_in
from engage_hri.services.realizer.plan.phases import with_planned_hand
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_tries
from engage_hri.services.realizer.plan.relations import BlockRefused, extent, relations_of
from engage_hri.services.realizer.points import Point, frozen, performer
from engage_hri.services.realizer.together.knowledge import Asker, knowledge, may_share, parts_of
from engage_hri.services.realizer.together.live import Live
from engage_hri.services.realizer.together.live_blocks import LiveBlocks, Past
from engage_hri.services.runtime.intake import fingerprint
from engage_hri.services.runtime.loop import unhurried

ESTIMATE: Seconds = 2.0
"""Time that the body may take to answer what it expects of a block; one that is planning itself needs it. Ours."""


MOST_BEHAVIORS = 200
"""Behaviors of a block. People's blocks have 36 at most. Each report costs in proportion to what is left of its
block: 0.3 ms with 200 behaviors (decision 0142), and all other blocks wait meanwhile."""
MOST = 2000
"""Behaviors, marks and sync references of a block: planning takes 0.1 ms each."""


class BodyAnswered(Struct, frozen=True, kw_only=True, tag="body_answered", omit_defaults=True):
    """The body answered a question for estimates: the input of the realizer that comes by no message.

    asked: fingerprint of the behaviors. refused: fault with which it was answered, in place of estimates.
    """

    asked: str
    answer: Estimates | None = None
    refused: Fault | None = None


RealizerInput = Message | BodyAnswered


def behaviors_asked(question: EstimateBehaviors) -> str:
    """Fingerprint of the behaviors that a question is about, whatever the times at which they are to come."""
    return fingerprint([item.behavior for item in question.items])


class Planning:
    """Planning of blocks with the body and with what is known of the other live blocks."""

    def __init__(
        self,
        bus: Bus,
        live_blocks: LiveBlocks,
        performing: Callable[[], Iterable[Decisions]],
        note: Callable[[BodyAnswered], None] = lambda answer: None,
    ) -> None:
        """note: called with each answer of the body."""
        self._bus = bus
        self._note = note
        self._live_blocks = live_blocks
        self._performing = performing

    async def plan(self, live: Live) -> Plan:
        """Plan a block. Of the blocks that it may refer to (`elsewhere`), those stay that it does refer to."""
        block = live.block
        if (count := len(block.behaviors)) > MOST_BEHAVIORS:
            raise _too_large(block, f"{count} behaviors; a block has {MOST_BEHAVIORS} at most")
        if (held := extent(block)) > MOST:
            raise _too_large(
                block, f"{held} behaviors, marks and sync references; at most {MOST} are planned in time"
            )
        # Bad references are refused before the body is asked.
        relations = relations_of(block, live.elsewhere)
        elsewhere = live.elsewhere = {name: live.elsewhere[name] for name in sorted(relations.blocks)}
        named = frozenset(point for point in relations.named if is_foreign(point.behavior))
        block = validated(block)
        question = question_about(block)
        estimates = await self.estimates(block, question)
        await self._earlier(live, named)
        live.is_planning = True
        waits = bool(live.earlier) and block.composition != "MERGE"
        return await self._agreed(block, question, estimates, elsewhere, named, is_to_wait=waits)

    async def again(self, plan: Plan, elsewhere: Mapping[str, Block]) -> Plan:
        """Plan a block that had to wait: by now the body and the other blocks are elsewhere."""
        named = {*plan.foreign, *plan.untied}  # What could not be waited for then has come by now, perhaps.
        known = self._known(plan.block, elsewhere, named, plan.estimates.values())
        question = self._question(plan, known)
        estimates = await self.estimates(plan.block, question)
        return await self._agreed(plan.block, question, estimates, elsewhere, named)

    async def _agreed(
        self,
        block: Block,
        question: EstimateBehaviors,
        first: tuple[Estimate, ...],
        elsewhere: Mapping[str, Block],
        named: Collection[Point],
        *,
        is_to_wait: bool = False,
    ) -> Plan:
        """Plan with `first`, and ask the body about the plan and the hands it has chosen, until the answer is
        what the plan was made with; if it never is, the plan that comes nearest.

        question: the one that `first` answers. is_to_wait: whoever has parts of the body now has ended by then.
        """
        barred: set[tuple[str, Hand]] = set()
        chosen, rounds = block, Rounds(question, first)
        while True:
            known = self._known(block, elsewhere, named, rounds.estimates)
            if is_to_wait:
                known = replace(known, holders={})
            try:
                tries = plan_tries(
                    chosen, rounds.estimates, known=known, barred=barred, turns=rounds.turns, manner=rounds.manner
                )
                plan = await unhurried(tries)
            except BlockRefused:
                if rounds.turns:
                    rounds.let_go()
                    continue
                if not rounds.can_give_way:
                    raise
                if (agreed := rounds.give_way()) is not None:
                    return agreed
                continue
            about_plan = self._question(plan, known)
            if plan.block is chosen:
                told = rounds.answer(about_plan) or await self.estimates(chosen, about_plan)
                if (agreed := rounds.close(plan, about_plan, told)) is not None:
                    return agreed
            else:
                chosen, rounds = plan.block, Rounds(about_plan, await self.estimates(plan.block, about_plan))
            if refused := hands_refused(block, chosen, rounds.estimates):
                barred |= refused
                chosen, rounds = block, Rounds(question, first)

    def _question(self, plan: Plan, known: Known) -> EstimateBehaviors:
        """The question to the body about a plan, beside what it does for the other blocks."""
        times = planned_times(plan, known)
        question = question_about(plan.block, poses_before(plan, known), times)
        performed = list(self._performing()) if known.holders else []
        if is_crowd(performed):
            return question
        return replace(question, others=meanwhile(performed, parts_moved(plan, times), self._bus.now()))

    async def _earlier(self, live: Live, named: Iterable[Point]) -> None:
        """Wait until those of the earlier blocks are planned that this one is to be planned with in mind."""
        block = live.block
        while awaited := [
            other
            for other in reversed(live.earlier)  # The last one waits for the others itself: one wait for all, mostly.
            if not other.settled.done() and (is_named_in(other.block.id, named) or may_share(block, other.block))
        ]:
            await asyncio.wait([awaited[0].settled])

    async def planned(self, block: Block, rivals: Iterable[Live]) -> None:
        """Wait until those are planned that are being planned now, and that a block may share parts with."""
        while awaited := [each for each in rivals if each.is_planning and may_share(block, each.block)]:
            await asyncio.wait([awaited[0].settled])

    def _known(
        self, block: Block, elsewhere: Mapping[str, Block], named: Collection[Point], estimates: Iterable[Estimate]
    ) -> Known:
        now = self._bus.now()
        parts, performed = parts_of(block.behaviors, estimates), list(self._performing())
        performing = {each.plan.block.id for each in performed}
        asker = Asker(block.id, now, now, named, parts, elsewhere, performing=performing)
        return knowledge(asker, performed, self._live_blocks)

    async def estimates(self, block: Block, question: EstimateBehaviors) -> tuple[Estimate, ...]:
        """Estimates of the body for behaviors of a block. Raises BlockRefused."""
        if not question.items:
            return ()
        name = behaviors_asked(question)
        try:
            answer = await self._bus.query(keys.ESTIMATE, question, timeout=ESTIMATE)
        except NoReply as error:
            unable = error.fault.following("no body performs it", block.id)
            raise BlockRefused(unable, "CANNOT_CREATE_BEHAVIOR") from error
        except EngageError as error:
            self._note(BodyAnswered(asked=name, refused=error.fault))
            raise BlockRefused(error.fault, "CANNOT_CREATE_BEHAVIOR") from error
        if not isinstance(answer, Estimates):
            fault = Fault(
                reason=f"control answered with a {type(answer).__name__}, not with estimates", where=block.id
            )
            raise BlockRefused(fault, "CANNOT_CREATE_BEHAVIOR")
        self._note(BodyAnswered(asked=name, answer=answer))
        asked = {item.behavior.id for item in question.items}
        return tuple([each for each in answer.items if each.behavior in asked])  # bodies err


async def planned_alone(bus: Bus, block: Block) -> Plan:
    """Plan a block with the body on this bus, beside no other block. Raises BlockRefused."""
    live = Live(PerformBlock(id="plan", block=block), (), Past(bus.now))
    return await Planning(bus, LiveBlocks(bus.now), list).plan(live)


def _too_large(block: Block, reason: str) -> BlockRefused:
    advice = "cut it into several: blocks with APPEND, or fragments of one turn"
    return BlockRefused(Fault(reason=reason, where=block.id, advice=advice))


CROWD = 48
"""Behaviors of all live blocks from which on the body is asked about each block by itself: each question is about all
of them, and each new plan calls for one of each block."""


def is_crowd(performed: Iterable[Decisions]) -> bool:
    """True if these blocks have so many behaviors that they are not rehearsed beside each other."""
    return sum(len(each.plan.chains) for each in performed) > CROWD


def question_about(
    block: Block, before: Mapping[str, BodyPose] = {}, times: Mapping[str, tuple[PlannedTime, ...]] = {}
) -> EstimateBehaviors:
    """The question to the body about the behaviors of a block that it performs.

    before: poses in which behaviors start; without one, from where the body is now. times: when they are planned to
    begin and to wait, in the order in which they begin.
    """
    behaviors = [behavior for behavior in block.behaviors if performer(behavior) == "body"]
    rank = {id: number for number, id in enumerate(times)}
    behaviors.sort(key=lambda behavior: rank.get(behavior.id, len(rank)))
    items = [
        EstimateItem(behavior=behavior, pose=before.get(behavior.id), times=times.get(behavior.id, ()))
        for behavior in behaviors
    ]
    return EstimateBehaviors(items=tuple(items))


def question_about_rest(
    performed: Decisions, before: Mapping[str, BodyPose], times: Mapping[str, tuple[PlannedTime, ...]]
) -> EstimateBehaviors:
    """The same about behaviors of a block that is being performed: those with `times`."""
    plan, facts = performed.plan, performed.facts
    items = [
        EstimateItem(
            behavior=with_planned_hand(plan.chains[id]),
            pose=before.get(id),
            times=each,
            reached=facts.next_number(id),
        )
        for id, each in times.items()
    ]
    return EstimateBehaviors(items=tuple(items))


def meanwhile(
    performed: Iterable[Decisions],
    parts: Collection[str],
    now: Seconds,
    is_meant: Callable[[Decisions, str], bool] = lambda performed, behavior: True,
) -> tuple[EstimateItem, ...]:
    """Behaviors of these blocks that move the body from now on, as the body is asked about them.

    parts: those that matter; head and arms aim for where the torso is, so with one, the other does. is_meant: False
    for a behavior of a block that is to be left out.
    """
    matters = {*parts, "torso"}
    return tuple([
        EstimateItem(
            behavior=with_planned_hand(each.plan.chains[id]),
            times=times,
            reached=each.facts.next_number(id),
        )
        for each in performed
        if not each.is_ending
        for id, times in times_ahead(each, now).items()
        if "torso" in parts or not matters.isdisjoint(each.plan.estimates[id].parts)
        if is_meant(each, id)
    ])  # fmt: skip


def times_ahead(decisions: Decisions, now: Seconds) -> dict[str, tuple[PlannedTime, ...]]:
    """Seconds from now at which behaviors began or begin, wait, hurry and dawdle, in the order in which they begin.

    Of those that move the body and have not ended.
    """
    plan, facts, expected = decisions.plan, decisions.facts, decisions.foresight.times(now)
    others = Known(points={point: at - now for point, at in expected.items() if is_foreign(point.behavior)})
    moving = [id for id in plan.chains if _moves(plan, id) and not facts.has_ended(id)]
    moving.sort(key=lambda id: round(expected[plan.chains[id].points[0]], 6))
    return {
        id: behavior_times(plan, id, others, lambda point: expected[point] - now, facts.next_number(id))
        for id in plan.begun_in_order(moving)
    }


def parts_moved(plan: Plan, behaviors: Iterable[str]) -> set[str]:
    """Parts of the body that behaviors move."""
    return {part for id in behaviors if _moves(plan, id) for part in plan.estimates[id].parts}


def _moves(plan: Plan, behavior: str) -> bool:
    estimate = plan.estimates.get(behavior)
    return estimate is not None and bool(estimate.parts) and estimate.parts != ("voice",)


MOST_QUESTIONS = 6
"""Most questions in a row, each because of the answer to the one before."""
PAUSE: Seconds = 0.1
LONGEST_PAUSE: Seconds = 3.2
"""Seconds from the end of such a row to the next one, twice as many each time: blocks may never agree with each
other, and a body may say something else each time."""
Ask = Callable[[Block, EstimateBehaviors], Awaitable[tuple[Estimate, ...]]]
"""A question to the body about behaviors of a block. Raises EngageError."""


class Rehearsing:
    """The questions about one block. Most blocks need none, so there is no task before there is news."""

    __slots__ = ("_answered", "_ask", "_containing", "_decisions", "_known", "_now", "_others", "_parts", "_task")

    def __init__(
        self,
        decisions: Decisions,
        others: Callable[[], Iterable[Decisions]],
        known: Callable[[], Known],
        now: Callable[[], Seconds],
        ask: Ask,
        answered: Callable[[Iterable[Estimate]], None],
        containing: Callable[[], Containing],
    ) -> None:
        """others: of all blocks that are performed, in the order in which they began. known: of other blocks, now.

        answered: told of estimates that say something else than those of the plan. containing: what goes wrong in
        the `with` of it ends this block, and no other.
        """
        self._decisions = decisions
        self._others = others
        self._known = known
        self._now = now
        self._ask = ask
        self._answered = answered
        self._containing = containing
        self._parts: frozenset[str] = frozen()
        """Parts that move in another way than when the body was asked last."""
        self._task: asyncio.Task[None] | None = None

    def look_again(self, parts: Collection[str]) -> None:
        """Ask the body soon, and once, about all that has changed by then. parts: that move otherwise than before."""
        self._parts = self._parts.union(parts)
        if self._task is None:
            self._task = asyncio.get_running_loop().create_task(self._run(), name="rehearsal")

    def stop(self) -> None:
        """Ask no more."""
        if self._task is not None:
            self._task.cancel()

    async def _run(self) -> None:
        """Ask until nothing has changed since."""
        try:
            with self._containing():
                pause = PAUSE
                while not self._decisions.is_ending and self._parts:
                    for number in range(MOST_QUESTIONS):
                        if self._parts:
                            await self._look(1.0 if number < STRAIGHT else 0.5)
                    if self._parts:
                        await asyncio.sleep(pause)
                        pause = min(2 * pause, LONGEST_PAUSE)
        finally:
            self._task = None

    async def _look(self, weight: float) -> None:
        """Ask, and plan with the answer if it says something else. weight: of the answer."""
        plan = self._decisions.plan
        question = self._question(plan)
        if not question.items:
            return
        try:
            told = await self._ask(plan.block, question)
        except EngageError:
            return  # Nobody knows better.
        if self._decisions.plan is plan:
            before = tuple(plan.estimates.values())
            told = tuple([self._ahead(plan, each) for each in told if each.feasible])
            if max(difference(before, told)) > NOTICEABLE:
                better = {each.behavior: each for each in between(before, told, weight)}
                self._answered({**plan.estimates, **better}.values())

    def _ahead(self, plan: Plan, told: Estimate) -> Estimate:
        """The estimate that a behavior has in the plan, with the phases to the points that it has yet to reach."""
        facts, id = self._decisions.facts, told.behavior
        known = plan.estimates[id]
        reached = {point.sync for point in plan.chains[id].points[: facts.next_number(id)]}
        if id not in facts.begun or [each.to for each in known.phases] != [each.to for each in told.phases]:
            return told if id not in facts.begun else known
        pairs = zip(known.phases, told.phases, strict=True)
        return replace(known, phases=tuple([old if new.to in reached else new for old, new in pairs]))

    def _question(self, plan: Plan) -> EstimateBehaviors:
        """The question about the behaviors that have yet to end; without any, there is nothing to ask.

        Those that are told when to be where are not asked about: they take the time that they are told to take.
        """
        now, decisions = self._now(), self._decisions
        facts, paces = decisions.facts, decisions.foresight.paces
        times = {
            id: each
            for id, each in times_ahead(decisions, now).items()
            if id not in facts.begun or (facts.next_number(id) and not paces.get(id) and not facts.is_held(id))
        }
        parts, changed = parts_moved(plan, times), self._parts
        self._parts = frozen()
        if not times or not (parts & changed or "torso" in parts | changed):
            return EstimateBehaviors(items=())
        poses = poses_before(plan, self._known())
        asked = question_about_rest(decisions, poses, times)
        moving = meanwhile(self._others(), parts, now, lambda each, id: each is not decisions or id not in times)
        return replace(asked, others=moving)
