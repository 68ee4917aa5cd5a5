"""Ties between a block that is performed and other live blocks: points of theirs, and parts that change hands."""

from collections.abc import Callable, Collection, Container, Iterable, Mapping, Set
from functools import partial
from math import inf
from typing import Protocol

from msgspec.structs import replace

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.decide.decisions import Decisions
from engage_hri.services.realizer.plan.handover import is_overlaid
from engage_hri.services.realizer.plan.known import Known, at_home, block_of, is_foreign, is_named_in
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.relations import needing
from engage_hri.services.realizer.points import EPSILON, Point, frozen
from engage_hri.services.realizer.report.feedback import Reporter
from engage_hri.services.realizer.together.knowledge import Asker, Performed, knowledge, parts_of
from engage_hri.services.realizer.together.live_blocks import LiveBlocks

MOST_PLANS = 20
"""Most plans of one block, at one time, because of parts that it hands over to others."""


class Tied(Performed, Protocol):
    """A performance, as its ties need it. plan: the one that it began with. interrupted: ended on request."""

    plan: Plan
    interrupted: dict[str, str]
    decisions: Decisions
    report: Reporter
    ties: "Ties"

    def take_in(self, news: Callable[[], object]) -> None:
        """Take in news and do what follows from it, unless the block is ending."""

    def replan(self) -> None:
        """Plan again what is left, with what is known now."""

    def plan_again(self) -> None:
        """Plan again soon, and once, for all that happens in one go."""

    def fail(self, behavior: str, fault: Fault) -> None:
        """End the block as failed, and say that it is because of this behavior."""


class Ties:
    """Ties of one performance.

    foreign: points of other blocks that are followed, also where there is no time to wait for them. foreign_ties:
    those that the block itself names. vanished: behaviors of other blocks of which some point will never be reached.
    given: behaviors whose parts another block takes by its plan, and the start of the one there.
    """

    def __init__(
        self,
        owner: Tied,
        others: Callable[[], Iterable[Tied]],
        live_blocks: LiveBlocks,
        blocks: Mapping[str, Block],
    ) -> None:
        """others: all performances, in the order in which they began. blocks: those that the block refers to."""
        self._owner = owner
        self._others = others
        self._live_blocks = live_blocks
        self._blocks = blocks
        self.foreign = {*owner.plan.foreign, *owner.plan.untied}
        self.foreign_ties = frozen(point for point in owner.plan.foreign if point in owner.plan.constrained)
        self.vanished: frozenset[str] = frozen()
        self.given: dict[str, Point] = {}
        self._met: dict[tuple[str, str], Seconds] = {}
        """When a behavior of this block was to begin, and one of another block had a part of it."""
        self._replanned: tuple[Seconds, int] = (-inf, 0)
        """When it was last planned again for parts that it hands over, and how often at that time."""
        self._named: set[Point] = set()
        """Points of this block that others are tied to."""

    # -- news of other blocks --------------------------------------------------------------------------------------

    def hear(self, point: Point, at: Seconds) -> None:
        """Note that a point of another block is reached."""
        if point in self.foreign:
            self._owner.take_in(partial(self._hear, point, at))

    def _hear(self, point: Point, at: Seconds) -> None:
        decisions = self._owner.decisions
        if point not in decisions.facts.reached:
            decisions.facts.hear(point, at)
            if point in decisions.facts.reached:  # else it was named by an earlier plan only
                self._owner.report.compare(decisions, point)

    def foresee(self, point: Point, at: Seconds) -> None:
        """Note that a point of another block is expected at `at` now."""
        if point in self.foreign:
            self._owner.take_in(partial(self._owner.decisions.foresight.foresee, point, at))

    def miss(self, behaviors: Iterable[str]) -> None:
        """Plan without these behaviors of other blocks if a point of them is needed that is not reached."""
        decisions = self._owner.decisions
        points = {point for point in self.foreign if point not in decisions.facts.reached}
        lost = {point.behavior for point in points}.intersection(behaviors) - self.vanished
        if not lost:
            return
        self.vanished |= lost
        for id in [id for id, taker in self.given.items() if taker.behavior in lost]:
            del self.given[id]
        missed = {point for point in points if point.behavior in lost}
        self._owner.take_in(partial(self._go_on_without, missed))

    @property
    def gone(self) -> frozenset[str]:
        """Behaviors that have vanished and of which no point has come that the block names."""
        reached = self._owner.decisions.facts.reached
        return self.vanished - {point.behavior for point in self.foreign_ties if point in reached}

    def _go_on_without(self, missed: Collection[Point]) -> None:
        """Plan without points of other blocks; fail if a required behavior or constraint was tied to one of them."""
        owner = self._owner
        needed = needing(owner.plan.block, self._blocks, missed)
        for id, point in needed:
            is_needed = id in owner.decisions.plan.chains and id not in owner.interrupted
            if is_needed and not owner.decisions.facts.has_ended(id):
                tied = owner.report.spelling(point)
                owner.fail(id, Fault(reason=f"{tied}, which it is tied to, does not come, and the tie is required"))
                return
        owner.replan()

    # -- parts that change hands -----------------------------------------------------------------------------------

    def is_free(self, behavior: str) -> bool:
        """False if another block has a part of a behavior that is to begin, and the plan does not say what then.

        So it is where one comes sooner or later than was planned. The block is planned again with what is in the way,
        once at one time for two behaviors: it begins then if the new plan does not let it wait.
        """
        plan, now = self._owner.decisions.plan, self._owner.report.now()
        chain, met = plan.chains[behavior], set[tuple[str, str]]()
        parts = set(chain.parts)
        for other in self._others() if parts else ():
            if other is self._owner or other.is_ending:
                continue
            chains, block = other.decisions.plan.chains, other.decisions.plan.block.id
            for id in other.decisions.facts.under_way:
                is_shared = not parts.isdisjoint(chains[id].parts)
                if is_shared and not (is_overlaid(chains[id], chain) or is_overlaid(chain, chains[id])):
                    met.add((behavior, f"{block}:{id}"))
        met = {each for each in met if not self._may_take(each[1]) and self._met.get(each, -inf) < now - EPSILON}
        if met:
            self._met |= dict.fromkeys(met, now)
            self._owner.plan_again()
        return not met

    def _may_take(self, name: str) -> bool:
        """True if the part of this behavior of another block is taken by plan, and it has made what it has to.

        A look to whose way home somebody has been tied since is not taken: it lasts.
        """
        block, _, id = name.partition(":")
        if name not in self._owner.decisions.plan.takes or (other := self._performances.get(block)) is None:
            return False
        plan, reached = other.decisions.plan, other.decisions.facts.reached
        named = self._live_blocks.named(block)
        if id in plan.natural and any(each.behavior == id and each not in reached for each in named):
            return False
        needed = plan.kept.get(id)
        return needed is None or needed in reached

    def known(self) -> Known:
        """Other blocks, and what of this one has begun, as known now. Times from this block's start.

        Blocks that began earlier count, and those that this one names; of others only what was in its way.
        """
        owner, decisions = self._owner, self._owner.decisions
        plan = decisions.plan
        others, later, is_later = [], set[str](), False
        for each in self._others():
            is_later = is_later or each is owner
            block = each.decisions.plan.block.id
            if each is owner:
                continue
            if is_later and not is_named_in(block, self.foreign_ties):
                later.add(block)
                if not any(name.startswith(f"{block}:") for _, name in self._met):
                    continue
            others.append(each)
        met = frozenset(name for _, name in self._met)
        parts = parts_of(plan.block.behaviors, plan.estimates.values())
        now = owner.report.now()
        unnamed = [each for each in plan.relations.named if is_foreign(each.behavior) and each not in plan.at]
        asker = Asker(
            plan.block.id, decisions.began, now, self.foreign, parts, self._blocks,
            met=met, later=later, unnamed=unnamed, performing=self._performances,
        )  # fmt: skip
        found = knowledge(asker, others, self._live_blocks)
        points = dict(found.points)
        performances = self._performances
        for taker in self.given.values():
            if (other := performances.get(block_of(taker))) is not None:
                points[taker] = other.decisions.foresight.times(now).get(at_home(taker), now) - decisions.began
        begun = decisions.facts.begun
        points |= {Point(id, "start"): begun.get(id, now) - decisions.began for id in {*plan.chains, *begun}}
        return replace(
            found,
            points=points,
            holders={id: each for id, each in found.holders.items() if id not in self.vanished},
            given={id: point for id, point in self.given.items() if point not in decisions.facts.reached},
            kept=frozenset(self._live_blocks.named(plan.block.id)),
            begun=frozenset(begun),
            stops=decisions.stops(now),
            untied=found.untied | self._missed,
            due={behavior for (behavior, _), at in self._met.items() if at >= now - EPSILON},
        )

    @property
    def _missed(self) -> Set[Point]:
        """Points that will not come, of behaviors that have vanished after others of their points had come."""
        some = self.vanished - self.gone
        return {
            point
            for point in self.foreign
            if point.behavior in some and point not in self._owner.decisions.facts.reached
        }

    @property
    def _performances(self) -> Mapping[str, Tied]:
        return {each.decisions.plan.block.id: each for each in self._others()}

    def begin(self) -> None:
        """Tell other blocks that this one has begun: those that are tied to it can be planned now."""
        for each in self._others():
            if each is not self._owner and is_named_in(self._owner.plan.block.id, each.ties.foreign_ties):
                each.take_in(each.replan)
        self.take_over()

    def take_over(self) -> None:
        """Tell other blocks which of their behaviors this one takes a part from by plan."""
        plan, performances = self._owner.decisions.plan, self._performances
        for block, other in performances.items():
            taken = {
                id: taker for name, taker in plan.takes.items() for of, _, id in (name.partition(":"),) if of == block
            }
            other.ties.keep(plan.block.id, taken)
            for behavior, taker in taken.items():
                other.ties.give(behavior, Point(f"{plan.block.id}:{taker}", "start"))

    def keep(self, block: str, taken: Container[str]) -> None:
        """Keep the parts that another block does not take any more: all but those of these behaviors."""
        kept = [id for id, taker in self.given.items() if block_of(taker) == block and id not in taken]
        for id in kept:
            del self.given[id]
        if kept:
            self._replan()

    def give(self, behavior: str, taker: Point) -> None:
        """Plan to hand over the part of a behavior at `taker`, a point of another block."""
        owner = self._owner
        if self.given.get(behavior) != taker and behavior in owner.decisions.plan.chains:
            self.given[behavior] = taker
            self._replan()

    def _replan(self) -> None:
        """Plan again at once, but not for ever: blocks that hand parts to each other may never agree on who is first.

        Who meets another when it is to begin waits all the same.
        """
        now = self._owner.report.now()
        self._replanned = (now, self._replanned[1] + 1 if self._replanned[0] == now else 1)
        if self._replanned[1] <= MOST_PLANS:
            self._owner.take_in(self._owner.replan)

    def name(self, points: Iterable[Point]) -> None:
        """Take the news that other blocks are tied to these points.

        Who hands its part over by plan may have to keep it up to there: else it waits for who takes the part, and
        that one for the point.
        """
        fresh = {point for point in points if point not in self._named}
        self._named |= fresh
        if any(point.behavior in self.given for point in fresh):
            self._replan()

    def renew(self) -> None:
        """Follow the points of other blocks that a new plan names, and tell whose parts it takes."""
        decisions = self._owner.decisions
        fresh = {*decisions.plan.foreign, *decisions.plan.untied} - decisions.facts.reached.keys()
        self.foreign |= fresh
        self._live_blocks.follow(self, fresh)
        self.take_over()
