"""Dependence of live blocks on each other: points that come only after those of a block, and what comes before.

Blocks wait for each other in many ways: a point is tied to a point, a part is free from some point on, an end comes
when all has come, a turn when others have ended. What waits is a point, so it is followed from point to point.
"""

from collections import defaultdict, deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Set
from math import inf

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, Place
from engage_hri.services.realizer.plan.known import (
    BLOCK_END,
    BLOCK_START,
    at_home,
    block_of,
    is_foreign,
    is_named_in,
    qualified,
)
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.points import EPSILON, Point
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
