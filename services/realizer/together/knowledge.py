"""Knowledge about other live blocks, gathered for the planning of one: points, parts, and who depends on whom.

Blocks wait for each other in many ways: a point is tied to a point, a part is free from some point on, an end comes
when all has come, a turn when others have ended. What waits is a point, so it is followed from point to point
(`waiting_for`). Who is not followed so may be told to wait for what waits for it, and neither ever begins.
"""

from collections import defaultdict, deque
from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Set
from math import inf

from msgspec import Struct

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.decide.decisions import Decisions
from engage_hri.services.realizer.net.petri_net import Bound, Place
from engage_hri.services.realizer.plan.known import (
    BLOCK_END,
    BLOCK_START,
    Holder,
    Known,
    at_home,
    block_of,
    holders_of,
    is_foreign,
    is_named_in,
    qualified,
)
from engage_hri.services.realizer.plan.phases import ARMS, chain
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.relations import Elsewhere
from engage_hri.services.realizer.points import EPSILON, Point, performer
from engage_hri.services.realizer.together.live_blocks import LiveBlocks

Here = tuple[str, int]
"""A transition of the net of a block."""
UNAWAITED = ("idle", "handover")
"""Kinds of places that nothing waits for."""
DAWDLING: Seconds = 1.0
"""Seconds: a motion that can be slower by so much can wait for something on its way."""
_ROUNDS = 8
"""How often a transition may be found to come later: blocks that wait for each other already are not gone round."""


def waiting_for(block: str, live_blocks: LiveBlocks) -> Mapping[Point, Mapping[Point, Seconds]]:
    """Points of other live blocks, named as these do, that come only after points of this one: each with those, and
    the seconds from there at least. The end of the block is its `BLOCK_END`.
    """
    plans = [each for each in live_blocks.plans if each[0].block.id != block]
    if any(is_named_in(block, plan.foreign) or block in leaders for plan, leaders in plans):
        return _Followed(block, live_blocks, plans).all()
    return {}


class _Followed:
    """All live blocks but one, as far as they wait for that one."""

    def __init__(self, block: str, live_blocks: LiveBlocks, others: Iterable[tuple[Plan, Collection[str]]]) -> None:
        """others: their plans, and the blocks that have to end before each begins."""
        self.block = block
        self.live_blocks = live_blocks
        self.plans, self.behind = dict[str, Plan](), dict[str, Collection[str]]()
        for plan, leaders in others:
            self.plans[plan.block.id], self.behind[plan.block.id] = plan, leaders
        self.tied: dict[Point, list[Here]] = defaultdict(list)
        """For each point that other blocks name, where it stands in their nets."""
        for name, plan in self.plans.items():
            for point in plan.foreign:
                self.tied[self._at_least(point)].append((name, plan.at[point]))
        self.out: dict[str, Mapping[int, list[tuple[int, Seconds]]]] = {}
        self.waiting: dict[str, Set[Point]] = {}
        """Points of each block that come later if what they wait for does."""

    def _at_least(self, point: Point) -> Point:
        """The point, or the start of its block if that has dropped it so far: then it is known what comes of it."""
        plan = self.plans.get(block_of(point))
        is_planned = plan is None or plan.transition(at_home(point)) is not None
        return point if is_planned else qualified(block_of(point), BLOCK_START)

    def all(self) -> Mapping[Point, Mapping[Point, Seconds]]:
        found: dict[Point, dict[Point, Seconds]] = defaultdict(dict)
        named = {point for point in self.tied if block_of(point) == self.block}
        followed = [point for point in sorted(named) if not self.live_blocks.is_past(point)]
        end = qualified(self.block, BLOCK_END)
        for point in dict.fromkeys((*followed, end)):
            own = at_home(point)
            starts = dict.fromkeys(self.tied.get(point, ()), 0.0)
            if point == end:
                starts |= {(name, 0): 0.0 for name, leaders in self.behind.items() if self.block in leaders}
            for here, seconds in self._after(starts).items():
                for each in self._points(here):
                    found[each][own] = max(seconds, found[each].get(own, -inf))
        return found

    def _after(self, starts: Mapping[Here, Seconds]) -> Mapping[Here, Seconds]:
        """Transitions that come after these, and these, with the seconds from there at least."""
        found = dict(starts)
        todo = deque(starts)
        rounds: dict[Here, int] = defaultdict(int)
        while todo:
            here = todo.popleft()
            for there, seconds in self._next(here):
                at = found[here] + seconds
                if at > found.get(there, -inf) + EPSILON and rounds[there] < _ROUNDS:
                    rounds[there] += 1
                    found[there] = at
                    todo.append(there)
        return found

    def _next(self, here: Here) -> Iterator[tuple[Here, Seconds]]:
        name, transition = here
        for target, seconds in self._ties(name).get(transition, ()):
            yield (name, target), seconds
        for point in self._points(here):
            yield from ((there, 0.0) for there in self.tied.get(point, ()))
        if transition == len(self.plans[name].net.transitions) - 1:
            yield from (((other, 0), 0.0) for other, leaders in self.behind.items() if name in leaders)

    def _points(self, here: Here) -> Iterator[Point]:
        """Points of the block itself that wait for a transition of its net, named as other blocks name them."""
        name, transition = here
        net, waiting = self.plans[name].net, self._waiting(name)
        own = [each for each in net.transitions[transition].points if each in waiting]
        if transition == 0:
            own.append(BLOCK_START)
        elif transition == len(net.transitions) - 1:
            own.append(BLOCK_END)
        yield from (qualified(name, each) for each in own)

    def _waiting(self, name: str) -> Set[Point]:
        """Points of a block that come later if what they wait for does.

        What has been does not; nor does what cannot wait any more: the end of words that are being said.
        """
        if name not in self.waiting:
            plan, reached = self.plans[name], self.live_blocks.reached(name)
            kinds = {(each.behavior, at): each.kind for at, members in enumerate(plan.members) for each in members}
            found = set()
            for id, chain in plan.chains.items():
                left = [point for point in chain.points if point not in reached]
                phases = zip(chain.points[1:], chain.segments, chain.longest, strict=True)
                slow = {to for to, each, limit in phases if limit is None or limit > each.natural + DAWDLING}
                slow = slow if chain.type != "speech" else set()  # Words cannot be said slower.
                gates = (n for n, each in enumerate(left) if each in slow or kinds[id, plan.at[each]] != "passive")
                found.update(left[next(gates, len(left)) :])
            self.waiting[name] = found
        return self.waiting[name]

    def _ties(self, name: str) -> Mapping[int, list[tuple[int, Seconds]]]:
        """For each transition of a block, those that come after it, and the seconds from there at least.

        What has no room to wait comes later if what follows it does. Who hands a part over waits for nothing: it goes
        home by itself. Who cannot wait at an instant passes it alone; what else is tied to the instant waits.
        """
        if name not in self.out:
            plan, waiting = self.plans[name], self._waiting(name)
            net = plan.net
            is_open = [not waiting.isdisjoint(transition.points) for transition in net.transitions]
            out: dict[int, list[tuple[int, Seconds]]] = defaultdict(list)
            ties: tuple[Place | Bound, ...] = (*net.places, *net.bounds)
            for number in range(len(net.transitions) - 1):
                out[number].append((len(net.transitions) - 1, 0.0))  # the end waits for all that is tied, too
            for tie in ties:
                if tie.kind in UNAWAITED or not tie.target:
                    continue
                if isinstance(tie, Place):
                    is_awaited = is_open[tie.source] or not (tie.kind == "phase" or tie.after in plan.chains)
                else:
                    is_awaited = is_open[tie.target]
                if is_awaited and (seconds := _least(tie, plan)) > -inf:
                    out[tie.source].append((tie.target, seconds))
            self.out[name] = out
        return self.out[name]


def _least(tie: Place | Bound, plan: Plan) -> Seconds:
    """The least seconds from the source to the target of a tie; minus infinity: any.

    Who sets out late enough not to wait on its target waits before it sets out, unless it waits there by plan.
    """
    if isinstance(tie, Place):
        return tie.shortest
    if tie.stretch is not None:
        return tie.lag - tie.stretch
    if plan.schedule[tie.source] + tie.lag > plan.schedule[tie.target] + EPSILON:
        return -inf
    is_prompt = any(each.behavior == tie.behavior and each.kind == "prompt" for each in plan.members[tie.source])
    return tie.lag if is_prompt else -inf


def needed_by(points: Iterable[Point], among: Mapping[str, tuple[Plan, Collection[str]]]) -> Mapping[str, set[str]]:
    """Behaviors of blocks that wait for their turn which have to come before some points; by block.

    points: named as other blocks name them. among: plan of each of these blocks, and those that have to end first.
    """
    found: dict[str, set[str]] = defaultdict(set)
    todo = list(points)
    seen = set(todo)
    while todo:
        point = todo.pop()
        if (name := block_of(point)) not in among:
            continue
        plan, leaders = among[name]
        last = plan.transition(at_home(point))
        before = plan.net.earlier([last]) if last is not None else {0}
        there = [each for each, transition in plan.at.items() if transition in before]
        found[name] |= {each.behavior for each in there if not is_foreign(each.behavior)}
        ends = [qualified(leader, BLOCK_END) for leader in leaders]
        fresh = [each for each in (*there, *ends) if is_foreign(each.behavior) and each not in seen]
        seen.update(fresh)
        todo += fresh
    return found


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
