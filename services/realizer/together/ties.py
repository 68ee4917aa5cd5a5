"""Ties between a block that is performed and other live blocks: points of theirs, and parts that change hands.

Each block is planned with what was known of the others. Then others come late, lose behaviors, or are planned anew
themselves, so what a plan took for granted of them is followed here. A block never changes another: it is told, and
plans again itself. It does so with all that it knows by then (`Ties.known`), never with news alone.
"""

from collections.abc import Collection, Container, Iterable, Mapping, Set
from math import inf

from msgspec.structs import replace

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.decide.decisions import Decisions
from engage_hri.services.realizer.plan.handover import is_overlaid
from engage_hri.services.realizer.plan.known import Known, at_home, block_of, is_foreign, is_named_in
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.relations import needing
from engage_hri.services.realizer.points import EPSILON, Point, frozen
from engage_hri.services.realizer.together.knowledge import Asker, knowledge, parts_of
from engage_hri.services.realizer.together.live_blocks import LiveBlocks

MOST_PLANS = 20
"""Most plans of one block, at one time, because of parts that it hands over to others: blocks that hand parts to each
other may never agree on who is first. Who meets another when it is to begin waits all the same."""


class Ties:
    """Ties of one block, as state: nothing here acts.

    foreign: points of other blocks that are followed, also where there is no time to wait for them. foreign_ties:
    those that the block itself names. vanished: behaviors of other blocks of which some point will never be reached.
    given: behaviors whose parts another block takes by its plan, and the start of the one there.
    """

    def __init__(self, plan: Plan, live_blocks: LiveBlocks, blocks: Mapping[str, Block]) -> None:
        """plan: the first one of the block. blocks: those that it refers to, by name."""
        self._live_blocks = live_blocks
        self._blocks = blocks
        self.foreign = {*plan.foreign, *plan.untied}
        self.foreign_ties = frozen(point for point in plan.foreign if point in plan.constrained)
        self.vanished: frozenset[str] = frozen()
        self.given: dict[str, Point] = {}
        self._met: dict[tuple[str, str], Seconds] = {}
        """When a behavior of this block was to begin, and one of another block had a part of it."""
        self._replanned: tuple[Seconds, int] = (-inf, 0)
        """When it was last planned again for parts that it hands over, and how often at that time."""
        self._named: set[Point] = set()
        """Points of this block that others are tied to."""

    # -- points of other blocks ------------------------------------------------------------------------------------

    def miss(self, behaviors: Iterable[str], decisions: Decisions) -> Collection[Point]:
        """Points that the block has to go on without, since no more of these behaviors of others will come."""
        points = {point for point in self.foreign if point not in decisions.facts.reached}
        lost = {point.behavior for point in points}.intersection(behaviors) - self.vanished
        self.vanished |= lost
        self.given = {id: taker for id, taker in self.given.items() if taker.behavior not in lost}
        return {point for point in points if point.behavior in lost}

    def needed(self, missed: Collection[Point], decisions: Decisions) -> Iterable[tuple[str, Point]]:
        """Behaviors that have yet to end and are required to be tied to one of these points, each with the point."""
        chains, has_ended = decisions.plan.chains, decisions.facts.has_ended
        needed = needing(decisions.plan.block, self._blocks, missed)
        return [(id, point) for id, point in needed if id in chains and not has_ended(id)]

    def gone(self, decisions: Decisions) -> frozenset[str]:
        """Behaviors that have vanished and of which no point has come that the block names."""
        reached = decisions.facts.reached
        return self.vanished - {point.behavior for point in self.foreign_ties if point in reached}

    def renew(self, decisions: Decisions) -> Set[Point]:
        """Follow what a new plan names of other blocks. Returns the points that are new."""
        fresh = {*decisions.plan.foreign, *decisions.plan.untied} - decisions.facts.reached.keys()
        self.foreign |= fresh
        return fresh

    # -- parts that change hands -----------------------------------------------------------------------------------

    def is_free(self, behavior: str, decisions: Decisions, others: Iterable[Decisions], now: Seconds) -> bool:
        """False if another block has a part of a behavior that is to begin, and the plan does not say what then.

        So it is where one comes sooner or later than was planned. The block is to be planned again then, with what
        is in the way; once at one time for two behaviors: it begins then if the new plan does not let it wait.
        """
        chain, met = decisions.plan.chains[behavior], set[tuple[str, str]]()
        parts = set(chain.parts)
        performances = {each.plan.block.id: each for each in others} if parts else {}
        for block, other in performances.items():
            if other is decisions or other.is_ending:
                continue
            chains = other.plan.chains
            for id in other.facts.under_way:
                is_shared = not parts.isdisjoint(chains[id].parts)
                if is_shared and not (is_overlaid(chains[id], chain) or is_overlaid(chain, chains[id])):
                    met.add((behavior, f"{block}:{id}"))
        met = {
            each
            for each in met
            if self._met.get(each, -inf) < now - EPSILON and not self._may_take(each[1], decisions.plan, performances)
        }
        self._met |= dict.fromkeys(met, now)
        return not met

    def _may_take(self, name: str, plan: Plan, performances: Mapping[str, Decisions]) -> bool:
        """True if the part of this behavior of another block is taken by plan, and it has made what it has to.

        A look to whose way home somebody has been tied since is not taken: it lasts.
        """
        block, _, id = name.partition(":")
        if name not in plan.takes or (other := performances.get(block)) is None:
            return False
        reached, named = other.facts.reached, self._live_blocks.named(block)
        if id in other.plan.natural and any(each.behavior == id and each not in reached for each in named):
            return False
        needed = other.plan.kept.get(id)
        return needed is None or needed in reached

    def keep(self, block: str, taken: Container[str]) -> bool:
        """Keep the parts that another block does not take any more: all but those of these behaviors.

        True if there are any.
        """
        kept = {id for id, taker in self.given.items() if block_of(taker) == block and id not in taken}
        self.given = {id: taker for id, taker in self.given.items() if id not in kept}
        return bool(kept)

    def give(self, behavior: str, taker: Point, plan: Plan) -> bool:
        """Plan to hand over the part of a behavior at `taker`, a point of another block. True if that is news."""
        is_news = self.given.get(behavior) != taker and behavior in plan.chains
        if is_news:
            self.given[behavior] = taker
        return is_news

    def name(self, points: Iterable[Point]) -> bool:
        """Note that other blocks are tied to these points; True if the block has to be planned again for that.

        Who hands its part over by plan may have to keep it up to there: else it waits for who takes the part, and
        that one for the point.
        """
        fresh = {point for point in points if point not in self._named}
        self._named |= fresh
        return any(point.behavior in self.given for point in fresh)

    def may_replan(self, now: Seconds) -> bool:
        """True if the block may be planned again at once for parts that it hands over, and not too often by now."""
        self._replanned = (now, self._replanned[1] + 1 if self._replanned[0] == now else 1)
        return self._replanned[1] <= MOST_PLANS

    # -- all of it -------------------------------------------------------------------------------------------------

    def known(self, decisions: Decisions, performed: Collection[Decisions], now: Seconds) -> Known:
        """Other blocks, and what of this one has begun, as known now. Times from this block's start.

        Blocks that began earlier count, and those that this one names; of others only what was in its way.
        performed: all blocks that are performed, in the order in which they began.
        """
        plan = decisions.plan
        others, later, is_later = [], set[str](), False
        for each in performed:
            is_later = is_later or each is decisions
            block = each.plan.block.id
            if each is decisions:
                continue
            if is_later and not is_named_in(block, self.foreign_ties):
                later.add(block)
                if not any(name.startswith(f"{block}:") for _, name in self._met):
                    continue
            others.append(each)
        met = frozenset(name for _, name in self._met)
        parts = parts_of(plan.block.behaviors, plan.estimates.values())
        unnamed = [each for each in plan.relations.named if is_foreign(each.behavior) and each not in plan.at]
        performances = {each.plan.block.id: each for each in performed}
        asker = Asker(
            plan.block.id, decisions.began, now, self.foreign, parts, self._blocks,
            met=met, later=later, unnamed=unnamed, performing=performances,
        )  # fmt: skip
        found = knowledge(asker, others, self._live_blocks)
        points = dict(found.points)
        for taker in self.given.values():
            if (other := performances.get(block_of(taker))) is not None:
                points[taker] = other.foresight.times(now).get(at_home(taker), now) - decisions.began
        begun, reached = decisions.facts.begun, decisions.facts.reached
        points |= {Point(id, "start"): begun.get(id, now) - decisions.began for id in {*plan.chains, *begun}}
        return replace(
            found,
            points=points,
            holders={id: each for id, each in found.holders.items() if id not in self.vanished},
            given={id: point for id, point in self.given.items() if point not in reached},
            kept=frozenset(self._live_blocks.named(plan.block.id)),
            begun=frozenset(begun),
            stops=decisions.stops(now),
            untied=found.untied | self._missed(decisions),
            due={behavior for (behavior, _), at in self._met.items() if at >= now - EPSILON},
        )

    def _missed(self, decisions: Decisions) -> Set[Point]:
        """Points that will not come, of behaviors that have vanished after others of their points had come."""
        some = self.vanished - self.gone(decisions)
        reached = decisions.facts.reached
        return {point for point in self.foreign if point.behavior in some and point not in reached}
