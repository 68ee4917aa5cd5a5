"""Knowledge about other live blocks, gathered for the planning of one: points, parts, and who depends on whom."""

from collections.abc import Collection, Container, Iterable, Iterator, Mapping

from msgspec import Struct

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.decide.decisions import Decisions
from engage_hri.services.realizer.plan.known import (
    Holder,
    Known,
    block_of,
    holders_of,
    is_foreign,
    is_named_in,
    qualified,
)
from engage_hri.services.realizer.plan.phases import ARMS, chain
from engage_hri.services.realizer.plan.relations import Elsewhere
from engage_hri.services.realizer.points import Point, performer
from engage_hri.services.realizer.together.dependence import needed_by, waiting_for
from engage_hri.services.realizer.together.live_blocks import LiveBlocks

MOMENT: Seconds = 0.001
"""Least time that a behavior is expected to keep a part after now, if it has not let go of it yet."""


class Asker(Struct, frozen=True):
    """The block that is planned. since: loop time from which its plan counts.

    named: points of other blocks that it names. parts: those that it may use. blocks: see `Known`. met: behaviors
    of others, by `block:behavior`, that have a part that one of its behaviors was to take. later: blocks of which
    only these count, since they have begun after it. unnamed: points of others that the block names, but its plan
    does not, so far. performing: all blocks that are being performed.
    """

    block: str
    since: Seconds
    now: Seconds
    named: Collection[Point]
    parts: Collection[str]
    blocks: Elsewhere
    met: Container[str] = ()
    later: Container[str] = ()
    unnamed: Collection[Point] = ()
    performing: Container[str] = ()


def knowledge(asker: Asker, others: Iterable[Decisions], live_blocks: LiveBlocks) -> Known:
    """Other live blocks, as known now. others: those that are given, in the order in which they began."""
    concerned = [each for each in others if concerns(asker.named, asker.parts, each)]
    there = {each.plan.block.id for each in concerned}
    points: dict[Point, Seconds] = {}
    holders: dict[str, Holder] = {}
    coming = dict(_coming(asker, live_blocks))
    named = {block_of(each) for each in (*asker.named, *(each.chain.points[0] for each in coming.values()))}
    for block in sorted(named - there):
        for point, at in {**live_blocks.times(block), **live_blocks.reached(block)}.items():
            points[qualified(block, point)] = at - asker.since
    awaiting = waiting_for(asker.block, live_blocks)
    for each in concerned:
        plan, block = each.plan, each.plan.block.id
        names = {id: f"{block}:{id}" for id in plan.chains}
        under_way, begun = set(each.facts.under_way), each.facts.begun
        for point, at in each.foresight.times(asker.now).items():
            behavior = point.behavior
            if is_foreign(behavior):
                continue
            if behavior in under_way and point.sync == "start":
                at = begun[behavior]
            elif point not in each.facts.reached and (
                names.get(behavior) in asker.met or behavior in under_way or each.facts.is_held(behavior)
            ):
                at = max(at, asker.now + MOMENT)
            points[qualified(block, point)] = at - asker.since
        for point, at in live_blocks.reached(block).items():  # of what was dropped since, too
            points.setdefault(qualified(block, point), at - asker.since)
        if not each.is_ending:
            over = {id for id, name in names.items() if each.facts.has_ended(id)}
            over |= {id for id, name in names.items() if block in asker.later and name not in asker.met}
            if is_named_in(asker.block, plan.constrained):
                # It is planned with the asker in mind: two blocks that make way for each other never agree.
                over |= plan.chains.keys() - each.facts.under_way
            kept = plan.constrained | live_blocks.named(block)
            reached = each.facts.next_number
            after = {id: taker.partition(":") for id, (taker, _) in plan.successors.items()}
            takers = {id: taker for id, (of, _, taker) in after.items() if taker and of == asker.block}
            holders |= holders_of(block, plan.chains, plan.estimates, plan.natural, kept, over, reached, takers)
    # What had no tie could be waited for. It has none from then on, or two blocks would wait for each other.
    untied = frozenset(point for point in asker.unnamed if point in awaiting)
    return Known(
        blocks=asker.blocks,
        points=points,
        holders={**coming, **holders},
        untied=untied,
        awaiting=awaiting,
        lost={each for each in asker.named if live_blocks.is_lost(each)},
    )


def concerns(named: Iterable[Point], parts: Collection[str], other: Decisions) -> bool:
    """True if a block has to be planned with the other in mind: it names it, or uses a part that the other has."""
    if is_named_in(other.plan.block.id, named):
        return True
    has_ended, chains = other.facts.has_ended, other.plan.chains
    return any(part in parts and not has_ended(id) for id, each in chains.items() for part in each.parts)


def _coming(asker: Asker, live_blocks: LiveBlocks) -> Iterator[tuple[str, Holder]]:
    """Behaviors of blocks that have yet to begin, if the asker is tied to what comes after them.

    They cannot wait for it, so it is planned with them in mind.
    """
    waiting = {
        plan.block.id: (plan, leaders)
        for plan, leaders in live_blocks.plans
        if leaders and plan.block.id not in asker.performing and plan.block.id != asker.block
    }
    for name, needed in needed_by(asker.named, waiting).items():
        plan, _ = waiting[name]
        kept = plan.constrained | live_blocks.named(name)
        over = plan.chains.keys() - needed
        yield from holders_of(name, plan.chains, plan.estimates, plan.natural, kept, over, lambda _: 0, {})


def parts_of(behaviors: Iterable[BlockBehavior], estimates: Iterable[Estimate]) -> set[str]:
    """Parts of the body that behaviors may use; with one arm, the other, too."""
    known = {each.behavior: each for each in estimates}
    moving = [each for each in behaviors if performer(each) == "body"]
    parts = {part for each in moving for part in chain(each, known.get(each.id)).parts}
    arms = ARMS["BOTH_HANDS"]
    return parts.union(arms) if parts.intersection(arms) else parts


def may_share(one: Block, other: Block) -> bool:
    """True if two blocks may use a part of the body both, as far as can be told before the body is asked."""
    return bool(_kinds(one) & _kinds(other))


def _kinds(block: Block) -> set[str]:
    kinds: Mapping[str, str] = {"gesture": "arm", "pointing": "arm"}
    rows = [(type_name(each), TYPES[type_name(each)]) for each in block.behaviors]
    return {kinds.get(name, row.family or name) for name, row in rows if row.takes_over and row.performer == "body"}
