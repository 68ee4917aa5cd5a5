"""Planning of a block on the bus: the body is asked what its behaviors take, and asked again about the plan."""

import asyncio
from collections.abc import Callable, Collection, Iterable, Mapping

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Hand
from engage_hri.schemas.blocks import Block, PerformBlock
from engage_hri.schemas.body import Estimate, EstimateBehaviors, Estimates
from engage_hri.schemas.check import validated
from engage_hri.schemas.faults import EngageError, Fault, NoReply
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.realizer.decide.decisions import Decisions
from engage_hri.services.realizer.inputs import BodyAnswered, behaviors_asked
from engage_hri.services.realizer.plan.agreement import Rounds, planned_times, poses_before
from engage_hri.services.realizer.plan.handover import hands_refused
from engage_hri.services.realizer.plan.known import Known, is_foreign, is_named_in
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_tries
from engage_hri.services.realizer.plan.relations import BlockRefused, extent, relations_of
from engage_hri.services.realizer.points import Point
from engage_hri.services.realizer.together.knowledge import Asker, knowledge, may_share, parts_of
from engage_hri.services.realizer.together.live import Live
from engage_hri.services.realizer.together.live_blocks import LiveBlocks, Past
from engage_hri.services.realizer.together.rehearsal import is_crowd, meanwhile, parts_moved, question_about
from engage_hri.services.runtime.loop import unhurried

ESTIMATE: Seconds = 2.0
"""Time that the body may take to answer what it expects of a block; one that is planning itself needs it. Ours."""


MOST_BEHAVIORS = 200
"""Behaviors of a block. People's blocks have 36 at most. Each report costs in proportion to what is left of its
block: 0.3 ms with 200 behaviors (decision 0142), and all other blocks wait meanwhile."""
MOST = 2000
"""Behaviors, marks and sync references of a block: planning takes 0.1 ms each."""


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
