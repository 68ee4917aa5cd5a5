"""From a block and what the body expects of its behaviors to a plan: the net and its earliest schedule.

Refused here, before anything moves: references to nothing, contradictions, and circles of waiting. Dropped here,
each with a warning: what the body cannot do, and what cannot be on time. Document order decides only between
equals; any other permutation of a block gives the same net.
"""

from collections.abc import Iterable, Mapping
from typing import get_args

from msgspec import Struct

from schemas.behaviors import BlockBehavior, Event, Unknown
from schemas.blocks import Block
from schemas.body import BodyPose, Estimate, Estimates
from schemas.faults import Fault
from schemas.feedback import WarningKind
from schemas.units import Seconds
from services.realizer.assembly import Assembler, Assembly, Chain, Member, equal_by_order, same_part
from services.realizer.classes import Classes
from services.realizer.net import Bound, PetriNet, Place
from services.realizer.points import Point, segments, sync_points
from services.realizer.relations import BlockRefused, Equal, Problem, Relations, Term, relations
from services.realizer.schedule import EPSILON, Lag, PositiveCycle, earliest


class Plan(Struct, frozen=True, kw_only=True):
    """schedule: of each transition of the net, seconds from the block's start, if all goes as estimated.

    behaviors: those that will be performed, in document order. dropped: those that will not, with `problems`.
    loose: bounds of the net that cannot be kept even if all goes as estimated; what they bound will be late.
    natural: behaviors that end when something takes their place, or with the block.
    waited_for: behaviors that the end of the block waits for.
    """

    block: Block
    behaviors: tuple[BlockBehavior, ...]
    net: PetriNet
    at: Mapping[Point, int]
    members: tuple[tuple[Member, ...], ...]
    schedule: tuple[Seconds, ...]
    chains: Mapping[str, Chain]
    estimates: Mapping[str, Estimate]
    natural: frozenset[str]
    required: frozenset[str]
    waited_for: frozenset[str]
    loose: frozenset[int] = frozenset()
    dropped: tuple[str, ...] = ()
    problems: tuple[Problem, ...] = ()

    def predicted(self, point: Point) -> Seconds:
        return self.schedule[self.at[point]]

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """Those to be kept."""
        return tuple(bound for number, bound in enumerate(self.net.bounds) if number not in self.loose)


class _Unreachable(Exception):
    """A behavior that cannot be on time."""

    def __init__(self, behavior: str, reason: str) -> None:
        self.behavior = behavior
        super().__init__(reason)


def plan_block(
    block: Block,
    estimates: Estimates | Iterable[Estimate] = (),
    *,
    dropped: Iterable[str] = (),
    elsewhere: Iterable[Point] = (),
) -> Plan:
    """Plan `block`; durations that no estimate gives are nominal. Raises BlockRefused, with place and line.

    dropped: behaviors to leave out as if never written. elsewhere: points of other live blocks.
    """
    items = estimates.items if isinstance(estimates, Estimates) else tuple(estimates)
    return _Planner(block, {each.behavior: each for each in items}, dropped, frozenset(elsewhere)).plan()


class _Planner:
    def __init__(
        self, block: Block, estimates: Mapping[str, Estimate], dropped: Iterable[str], elsewhere: frozenset[Point]
    ) -> None:
        self.block = block
        self.estimates = estimates
        self._check_ids()
        self.relations = relations(block, elsewhere)
        self.problems = list(self.relations.problems)
        self.dropped = list(dropped)
        for behavior in block.behaviors:
            if behavior.id in self.dropped:
                continue
            if behavior.id in self.relations.unusable:
                self._refuse_if_required(
                    behavior.id, "its timing names a sync point it does not have", "PARSING_FAILURE"
                )
                self.dropped.append(behavior.id)
            elif isinstance(behavior, Unknown):
                self._drop(behavior.id, "BEHAVIOR_TYPE_NOT_SUPPORTED", f"unknown element <{behavior.element}>")
            elif (estimate := estimates.get(behavior.id)) and not estimate.feasible:
                self._drop(behavior.id, _kind(estimate.warning), str(estimate.fault or "the body cannot do it"))

    def _check_ids(self) -> None:
        if not self.block.id:
            raise BlockRefused(Fault(reason="a block needs an id", where="block"))
        seen: set[str] = set()
        for behavior in self.block.behaviors:
            if not behavior.id or behavior.id == "bml" or ":" in behavior.id or behavior.id in seen:
                why = "is used twice" if behavior.id in seen else "is not a usable id"
                raise BlockRefused(Fault(reason=f"{behavior.id!r} {why}", where=self.block.id, line=behavior.line))
            seen.add(behavior.id)

    def _refuse_if_required(self, id: str, reason: str, kind: WarningKind) -> None:
        if id in self.relations.required:
            line = next(behavior.line for behavior in self.block.behaviors if behavior.id == id)
            advice = "it is required; without `required` it would be dropped"
            raise BlockRefused(Fault(reason=reason, where=f"{self.block.id}: {id}", line=line, advice=advice), kind)

    def _drop(self, id: str, kind: WarningKind, reason: str) -> None:
        self._refuse_if_required(id, reason, kind)
        self.dropped.append(id)
        self.problems.append(Problem(kind, reason, id))

    def plan(self) -> Plan:
        while True:
            try:
                return self._plan()
            except _Unreachable as error:
                self._drop(error.behavior, "IMPOSSIBLE_TO_SCHEDULE", str(error))

    def _plan(self) -> Plan:
        kept = tuple(behavior for behavior in self.block.behaviors if behavior.id not in self.dropped)
        chains = {behavior.id: self._chain(behavior) for behavior in kept}
        present = _without(self.relations, frozenset(self.dropped))
        classes = Classes()
        for equal in self.relations.equals:
            # With the points of what was dropped: what it tied together stays tied.
            classes.tie(equal, self.block.id)
        waited_for = frozenset(chains) - _unawaited_events(kept, present)
        successors: dict[str, str] = {}
        cut: frozenset[str] = frozenset()
        for _ in range(3):
            assembler = Assembler(self.block.id, chains, present, classes, successors, cut, waited_for)
            assembly = assembler.assemble()
            while self._merge_circles(assembly, classes):
                assembly = Assembler(self.block.id, chains, present, classes, successors, cut, waited_for).assemble()
            loose = self._check(assembly, chains)
            schedule, loose = _predict(assembly, loose)
            new_successors, new_cut = _handovers(chains, assembly, schedule, assembler.natural)
            if (new_successors, new_cut) == (successors, cut):
                break
            successors, cut = new_successors, new_cut
        return Plan(
            block=self.block,
            behaviors=kept,
            net=assembly.net,
            at=assembly.at,
            members=assembly.members,
            schedule=tuple(schedule),
            chains=chains,
            estimates=self.estimates,
            natural=frozenset(assembler.natural),
            required=present.required,
            waited_for=waited_for,
            loose=loose,
            dropped=tuple(self.dropped),
            problems=tuple(self.problems),
        )

    def _chain(self, behavior: BlockBehavior) -> Chain:
        estimate = self.estimates.get(behavior.id)
        longest = {(phase.since, phase.to): phase.longest for phase in estimate.phases} if estimate else {}
        parts = segments(behavior, estimate)
        limits = (longest.get((part.since, part.to)) for part in parts)
        return Chain(behavior, parts, tuple(limits))

    def _merge_circles(self, assembly: Assembly, classes: Classes) -> bool:
        """Make one instant of transitions that wait for each other without delay; whether there were any."""
        groups = equal_by_order(assembly.net)
        for group in groups:
            points = [
                assembly.net.transitions[each].points[0] for each in group if assembly.net.transitions[each].points
            ]
            classes.tie(Equal(tuple(Term(point, 0.0, str(point)) for point in points)), self.block.id)
        return bool(groups)

    def _check(self, assembly: Assembly, chains: Mapping[str, Chain]) -> frozenset[int]:
        """Is there a schedule at all, with every phase as short or long as can be? The bounds to give up if so.

        Raises _Unreachable for a behavior that misses an absolute time, BlockRefused for a deadlock.
        """
        net = assembly.net
        loose: set[int] = {number for number, bound in enumerate(net.bounds) if bound.stretch is None}
        while True:
            lags = [
                Lag(place.source, place.target, place.shortest, number)
                for number, place in enumerate(net.places)
                if place.kind != "idle"
            ]
            lags += [
                Lag(bound.source, bound.target, bound.lag - (bound.stretch or 0.0), -1 - number)
                for number, bound in enumerate(net.bounds)
                if number not in loose
            ]
            try:
                earliest([0.0] * len(net.transitions), (), lags)
            except PositiveCycle as cycle:
                loose.add(self._verdict(cycle, assembly, chains))
            else:
                return frozenset(loose - {n for n, bound in enumerate(net.bounds) if bound.stretch is None})

    def _verdict(self, cycle: PositiveCycle, assembly: Assembly, chains: Mapping[str, Chain]) -> int:
        """The bound to give up; raises if the cycle is worse than that."""
        net = assembly.net
        transitions = [lag.source for lag in cycle.lags]
        phases = {_reason(net, lag).behavior for lag in cycle.lags if _reason(net, lag).kind == "phase"}
        touched = {point.behavior for each in transitions for point in net.transitions[each].points}
        involved = [id for id in chains if id in (phases or touched)]
        names = _route(net, cycle)
        if 0 in transitions or len(involved) == 1:
            candidates = [id for id in involved if id not in self.relations.required] or involved
            if candidates:
                raise _Unreachable(candidates[-1], f"cannot be on time: {names}")
        bounded = [-1 - lag.reason for lag in cycle.lags if lag.reason < 0]
        for number in bounded:
            if net.bounds[number].kind == "phase":
                return number
        lines = sorted({line for lag in cycle.lags for line in _reason(net, lag).lines})
        advice = f"see lines {', '.join(map(str, lines))}" if len(lines) > 1 else ""
        fault = Fault(
            reason=f"these points wait for each other in a circle: {names}",
            where=self.block.id,
            line=lines[0] if lines else 0,
            advice=advice,
        )
        raise BlockRefused(fault, "IMPOSSIBLE_TO_SCHEDULE")


def _kind(warning: str) -> WarningKind:
    return warning if warning in get_args(WarningKind) else "CANNOT_CREATE_BEHAVIOR"  # type: ignore[return-value]


def _reason(net: PetriNet, lag: Lag) -> Place | Bound:
    return net.places[lag.reason] if lag.reason >= 0 else net.bounds[-1 - lag.reason]


def _route(net: PetriNet, cycle: PositiveCycle) -> str:
    steps = [f"{net.transitions[lag.source].name} ({lag.seconds:+g} s)" for lag in cycle.lags]
    return " -> ".join((*steps, net.transitions[cycle.lags[0].source].name))


def _without(relations: Relations, dropped: frozenset[str]) -> Relations:
    def there(term: Term) -> bool:
        return term.point.behavior not in dropped

    return Relations(
        tuple(Equal(kept) for equal in relations.equals if len(kept := tuple(filter(there, equal.terms))) > 1),
        tuple(order for order in relations.orders if there(order.earlier) and there(order.later)),
        relations.required - dropped,
    )


def _unawaited_events(behaviors: tuple[BlockBehavior, ...], present: Relations) -> frozenset[str]:
    """Events whose decision nothing in the block waits for."""
    events = {behavior.id for behavior in behaviors if isinstance(behavior, Event)}
    awaited = {point.behavior for point in present.named if point.sync == "end"}
    return frozenset(events - awaited)


def _predict(assembly: Assembly, loose: frozenset[int]) -> tuple[list[Seconds], frozenset[int]]:
    """The earliest schedule with natural durations, and the bounds it had to break."""
    net = assembly.net
    broken = set(loose)
    while True:
        lags = [
            Lag(place.source, place.target, place.lag, number)
            for number, place in enumerate(net.places)
            if place.kind != "idle"
        ]
        lags += [
            Lag(bound.source, bound.target, bound.lag, -1 - number)
            for number, bound in enumerate(net.bounds)
            if number not in broken
        ]
        try:
            return earliest([0.0] * len(net.transitions), (), lags), frozenset(broken)
        except PositiveCycle as cycle:
            bounded = [-1 - lag.reason for lag in cycle.lags if lag.reason < 0]
            broken.add(next((each for each in bounded if net.bounds[each].kind == "phase"), bounded[0]))


def _handovers(
    chains: Mapping[str, Chain], assembly: Assembly, schedule: list[Seconds], natural: set[str]
) -> tuple[dict[str, str], frozenset[str]]:
    """Who takes whose place, and who is therefore not given the time to go home."""
    documents = {id: number for number, id in enumerate(chains)}

    def start(id: str) -> tuple[Seconds, int]:
        return schedule[assembly.at[Point(id, "start")]], documents[id]

    successors: dict[str, str] = {}
    cut = set()
    for id, chain in chains.items():
        if "relax" not in sync_points(chain.behavior):
            continue
        later = [
            other
            for other in chains
            if other != id and same_part(chain.behavior, chains[other].behavior) and start(other) > start(id)
        ]
        if not later:
            continue
        successor = min(later, key=start)
        relax = schedule[assembly.at[Point(id, "relax")]]
        if id in natural:
            successors[id] = successor
            cut.add(id)
        elif abs(start(successor)[0] - relax) <= EPSILON:
            cut.add(id)
    return successors, frozenset(cut)


def poses_before(plan: Plan) -> dict[str, BodyPose]:
    """Where the body will be when a behavior takes another's place, by the id of the later: on the earlier's target.

    How long a look takes depends on what was looked at before it, not on where the head is as the block comes in.
    """
    poses = {}
    for id, chain in plan.chains.items():
        start = plan.predicted(Point(id, "start"))
        before = [
            (began, number, estimate.pose_after)
            for number, (other, earlier) in enumerate(plan.chains.items())
            if same_part(chain.behavior, earlier.behavior)
            and "relax" in sync_points(earlier.behavior)
            and (began := plan.predicted(Point(other, "start"))) < start
            and (estimate := plan.estimates.get(other)) is not None
        ]
        if before and (pose := max(before, key=lambda it: it[:2])[2]) is not None:
            poses[id] = pose
    return poses
