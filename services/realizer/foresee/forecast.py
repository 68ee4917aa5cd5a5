"""Forecast of the instants of a running block: when each will be, by all that was measured so far.

A stroke that is to meet a word cannot wait for it. Its arm has to set out before the word is there, so somebody has
to say when the word will be. The plan said so once; since then the voice was slow, and the arm was held. So the
schedule of the plan is computed again, with what was measured in the place of what was planned.

The nodes are the transitions of the net, and one more for each place and time at which a behavior has been
measured. An arc says that one node comes no earlier than so many seconds after another: a phase, a delay, an order.
An upper bound is an arc back: `late` comes no later than 2 s after `early`, so `early` comes no earlier than 2 s
before `late`. A node that was measured is a fact, and does not move. Then:

1. *Longest paths.* Each node is as early as its arcs allow. Passes forward over arcs and back over bounds take
   turns until nothing moves (`_relax`). Nothing is kept from the time before, so nothing can be out of date: up to
   a thousand transitions such a pass takes no longer than to find out what has changed.
2. *Making way.* A bound may ask for what is past, or a circle of arcs for more time than there is. Then phases
   along the way take less, or bear more, as far as the body can (`_make_way`): first what the plan has bent, and
   what can be slower before what has to hurry. Where that is not enough, a bound is given up for this time. Each
   such step shortens an arc or takes one away, and after `REPAIRS` steps all bounds go. So it ends.

An instant that is overdue is expected no earlier than now. This is the body's news by silence, and not a fact.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from itertools import compress
from math import inf
from operator import ne

from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import order
from engage_hri.services.realizer.plan.known import is_foreign
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.points import EPSILON, Point

FINEST: Seconds = 1e-8
"""Seconds; smaller changes are rounding."""
FORGETTING = 8
"""Number of instants after which what is past is taken out of the sweeps."""
REPAIRS = 200
"""Most bounds that are made way for in one `update`; those that cannot be kept then are given up for this time."""


class Arc(Struct, gc=False):
    """Lower bound: `target` comes no earlier than some seconds after `source`.

    least: what these may give way to. behavior: set if it is a phase. is_bound: may be given up if nothing else gives
    way. is_on: False once it has no effect any more. natural, shortest: of a phase, what it asks for and `least`, as
    estimated. stopped: seconds by which it is longer than planned, since its clock was stopped.
    """

    source: int
    target: int
    least: Seconds
    behavior: str = ""
    is_bound: bool = False
    is_on: bool = True
    natural: Seconds = 0.0
    shortest: Seconds = 0.0
    stopped: Seconds = 0.0


class Circle(Exception):
    """A cycle of arcs that takes more than no time: no times satisfy all of them."""

    def __init__(self, arcs: Sequence[int]) -> None:
        self.arcs = tuple(arcs)


class Forecast:
    """Expected times of the transitions, and of what was measured. times: as of the last `update`.

    factor: how many times longer than estimated a behavior takes, by its id. foreseen: expected times of points of
    other blocks.
    """

    def __init__(
        self, plan: Plan, began: Seconds, factor: Callable[[str], float], foreseen: Mapping[Point, Seconds]
    ) -> None:
        net, planned = plan.net, plan.schedule
        size = self._size = len(net.transitions)
        self._factor = factor
        self._arcs: list[Arc] = []
        self._asked: list[Seconds] = []
        """Seconds of each arc, as long as nothing gives way."""
        self._seconds: list[Seconds] = []
        """Of each arc, once phases have given way."""
        self._source: list[int] = []
        self._moves: list[int] = []
        """Source of each arc, and its target if it may move that, for sweeps; else `_nowhere`."""
        self._forward: list[int] = []
        self._back: list[int] = []
        """Arcs in the order in which one sweep over them is enough."""
        self._on_facts: set[int] = set()
        """Bounds on what is past already, by what is not."""
        self._there: list[Seconds] = [began] * size
        """Time at which the latest of those behaviors came that are at the instant; it is no earlier."""
        self._floor: list[Seconds] = [began] * size
        """Time of each node that is a fact, else the least that it may have."""
        self._is_fact = [False] * size
        self._out: list[list[int]] = [[] for _ in range(size)]
        self._in: list[list[int]] = [[] for _ in range(size)]
        self._nowhere = self._new_node(inf)
        self.times = list(self._floor)
        self._given_way: set[int] = set()
        self._is_new = True
        self._past = 0
        """Number of instants that are facts."""
        self._node_of: dict[str, int] = {}
        """For each behavior under way, the node for the time at which it passed its latest point."""
        self._phase_to: dict[tuple[str, int], int] = {}
        self._phase_from: dict[tuple[str, int], int] = {}
        self._after: dict[tuple[str, int], tuple[int, ...]] = {}
        """Arcs from where a behavior passes a transition, apart from its phases."""
        self._moved: dict[tuple[int, int], list[int]] = {}
        """Those of them that count from the behavior's own time, by the transitions at their ends."""
        self._of_behavior: dict[str, list[int]] = {}
        self._unkept: set[int] = set()
        """Bounds that the plan does not keep."""
        self._as_others: set[int] = set()
        """Bounds that keep who is left of an instant no later than the others have passed it."""
        self._bent: set[int] = set()
        """Phases that the plan makes shorter, and the bounds of those that it makes longer, than is natural."""
        self._rank = {transition: rank for rank, transition in enumerate(order(net) or range(size))}
        for place in net.places:
            # Other places from the block's start say nothing: no instant is earlier than that.
            if place.kind != "idle" and (place.source or place.lag > 0.0 or place.after):
                behavior = place.behavior if place.kind == "phase" else ""
                arc = self._add(place.source, place.target, place.lag, min(place.shortest, place.lag), behavior)
                if place.after:
                    key = (place.after, place.source)
                    self._after[key] = (*self._after.get(key, ()), arc)
                if behavior:
                    if planned[place.target] - planned[place.source] < place.lag + place.stopped - EPSILON:
                        self._bent.add(arc)
                    self._phase_to[behavior, place.target] = self._phase_from[behavior, place.source] = arc
        self._longest = {
            (bound.behavior, bound.source): inf if bound.stretch is None else bound.stretch - bound.lag
            for bound in net.bounds
            if bound.kind == "phase"
        }
        unkept = {(plan.at.get(each.late), plan.at.get(each.early)): each.seconds for each in plan.broken}
        # What is tied to a point of another block keeps its distances: all of it is as late for that point.
        abroad = {plan.at.get(each.early): each.seconds for each in plan.broken if is_foreign(each.early.behavior)}
        for bound in net.bounds:
            behavior = bound.behavior if bound.kind == "phase" else ""
            least = bound.lag if not behavior else -inf if bound.stretch is None else bound.lag - bound.stretch
            arc = self._add(bound.source, bound.target, bound.lag, least, behavior, is_bound=True)
            ends = (bound.source, bound.target)
            missed_by = 0.0 if ends in plan.late else unkept.get(ends) or abroad.get(bound.target, 0.0)
            if missed_by > bound.stopped + EPSILON:
                self._unkept.add(arc)
            if behavior and planned[bound.source] - planned[bound.target] > EPSILON - bound.lag + bound.stopped:
                self._bent.add(arc)
        self._elsewhere: dict[int, int] = {}
        """For each instant with points of other blocks, the node for the time at which those blocks expect it."""
        self._awaited: dict[int, list[str]] = {}
        """For each instant, the behaviors of other blocks that have yet to pass it."""
        for point in plan.foreign:
            self._awaited.setdefault(transition := plan.at[point], []).append(point.behavior)
            if transition not in self._elsewhere:
                node = self._elsewhere[transition] = self._new_node(began)
                self._add(node, transition, 0.0, 0.0, "")
        self._drop_idle_bounds()
        self._sort()
        self.fix(0, began)
        for point, at in foreseen.items():
            if point in plan.at:
                self.foresee(plan.at[point], at)

    def _add(
        self, source: int, target: int, asked: Seconds, least: Seconds, behavior: str, *, is_bound: bool = False
    ) -> int:
        number = len(self._arcs)
        factor = 1.0
        if behavior:
            self._of_behavior.setdefault(behavior, []).append(number)
            factor = self._factor(behavior)
        arc = Arc(source, target, least * factor, behavior, is_bound, natural=asked, shortest=least)
        self._arcs.append(arc)
        self._asked.append(asked * factor)
        self._seconds.append(asked * factor)
        self._source.append(source)
        self._moves.append(target)
        self._out[source].append(number)
        self._in[target].append(number)
        return number

    def _new_node(self, at: Seconds) -> int:
        """Add a node that is a fact, without arcs; returns its number."""
        self._out.append([])
        self._in.append([])
        self._floor.append(at)
        self._is_fact.append(True)
        return len(self._floor) - 1

    def _sort(self) -> None:
        """Put the arcs into the order of sweeps. What counts from a fact later on may stay where it is."""
        rank, arcs = self._rank, self._arcs
        numbers = sorted(
            (each for each, arc in enumerate(arcs) if arc.is_on), key=lambda each: rank.get(arcs[each].source, -1)
        )
        is_forward = [rank[arc.target] > rank.get(arc.source, -1) for arc in arcs]
        self._forward = [each for each in numbers if is_forward[each]]
        self._back = [each for each in reversed(numbers) if not is_forward[each]]

    def _forget(self) -> None:
        """Take the arcs out of the sweeps that move nothing any more: what is past costs nothing."""
        self._forward = [each for each in self._forward if self._moves[each] != self._nowhere]
        self._back = [each for each in self._back if self._moves[each] != self._nowhere]

    def _switch_off(self, number: int) -> None:
        self._arcs[number].is_on, self._moves[number] = False, self._nowhere
        self._on_facts.discard(number)

    def _drop_idle_bounds(self) -> None:
        """Switch off upper bounds of phases that nothing but the phase itself can make end late."""
        pending = {arc.source for arc in self._arcs if arc.is_bound and arc.behavior}
        while pending:
            here = pending.pop()
            into = [self._arcs[number] for number in self._in[here] if self._arcs[number].is_on]
            if len(into) != 1:
                continue
            for number in self._out[here]:
                bound = self._arcs[number]
                if bound.is_on and bound.is_bound and bound.behavior == into[0].behavior != "":
                    bound.is_on = False
                    pending.add(bound.target)

    # -- facts ---------------------------------------------------------------------------------------------------

    def fix(self, transition: int, at: Seconds) -> None:
        """Set the instant: all of it has happened, at `at`."""
        self._floor[transition], self._is_new = at, True
        if self._is_fact[transition]:
            return
        self._is_fact[transition] = True
        for number in self._in[transition]:
            self._end_on_fact(number)
        self._on_facts.difference_update(self._out[transition])  # a fact that is late moves no other
        self._past += 1
        if self._past % FORGETTING == 0:
            self._forget()

    def _end_on_fact(self, number: int) -> None:
        arc = self._arcs[number]
        self._moves[number] = self._nowhere
        if arc.is_on and arc.is_bound and not self._is_fact[arc.source]:
            self._on_facts.add(number)

    def passed(self, behavior: str, transition: int, at: Seconds) -> None:
        """Note that the behavior has passed its point there; the others of the instant perhaps not yet."""
        self.come(behavior, transition, at)
        if behavior in (awaited := self._awaited.get(transition, [])):
            awaited.remove(behavior)
            if not awaited:
                self.foresee(transition, self._there[transition])  # All have come: it is no more what was expected.
        for each in self._after.pop((behavior, transition), ()):
            self._moved.setdefault((transition, self._arcs[each].target), []).append(each)
            self._start_from(self._new_node(at), each)
        number = self._phase_from.get((behavior, transition))
        self._stay_with(behavior, transition, at)
        if (node := self._node_of.get(behavior)) is not None:
            if number is not None and self._arcs[number].source == node:
                return
            for bound in self._in[node]:
                self._switch_off(bound)  # that phase is over
            self._in[node].clear()
        if number is None:
            return
        if node is None:
            node = self._node_of[behavior] = self._new_node(at)
        self._floor[node] = at
        self._start_from(node, number)
        for other in self._of_behavior[behavior]:
            if self._arcs[other].target == transition:
                self._end_at(node, other)

    def _stay_with(self, behavior: str, transition: int, at: Seconds) -> None:
        """Let no bound make the others of an instant later than this one has passed it; who is late is late.

        Where one of another block has passed it, the plan says how much later the others come.
        """
        bounds = [self._arcs[each] for each in self._in[transition] if self._arcs[each].is_on]
        is_kept = self._is_fact[transition] or not self._as_others.isdisjoint(self._out[transition])
        if not (is_kept or is_foreign(behavior)) and any(arc.is_bound and arc.behavior != behavior for arc in bounds):
            number = self._add(transition, self._new_node(at), 0.0, 0.0, "", is_bound=True)
            self._as_others.add(number)
            self._end_on_fact(number)

    def _start_from(self, node: int, number: int) -> None:
        """Let an arc count from the time of a node of its own."""
        arc = self._arcs[number]
        self._out[arc.source].remove(number)
        arc.source = node
        self._source[number] = node
        self._out[node] = [number]
        self._on_facts.discard(number)

    def _end_at(self, node: int, number: int) -> None:
        """Let an upper bound count from the time of a node: the phase has begun, its beginning waits for nothing.

        What cannot be slower from there on does not wait: who is to meet it at its end has to hurry.
        """
        arc = self._arcs[number]
        if not arc.is_bound or not arc.is_on:
            self._switch_off(number)
            return
        self._in[arc.target].remove(number)
        self._in[node].append(number)
        arc.target = node
        self._end_on_fact(number)

    def come(self, behavior: str, transition: int, at: Seconds) -> None:
        """Note that the behavior is at its point there, or past it."""
        there = self._there[transition] = max(self._there[transition], at)
        self._is_new = True
        number = self._phase_to.get((behavior, transition))
        is_first = number is not None and self._arcs[number].is_on
        if number is not None and is_first:
            self._switch_off(number)
        if not self._is_fact[transition]:  # Who was overdue has come.
            self._floor[transition] = there if is_first else max(there, self._floor[transition])

    def overdue(self, transition: int, at: Seconds) -> None:
        """Expect the instant no earlier than `at`: it has not come yet."""
        if not self._is_fact[transition] and at > self._floor[transition]:
            self._floor[transition], self._is_new = at, True

    def foresee(self, transition: int, at: Seconds) -> None:
        """Expect the points of other blocks at this instant at `at`."""
        self._floor[self._elsewhere[transition]], self._is_new = at, True

    def shift(self, behavior: str, at: Seconds) -> None:
        """Let what comes after the latest point of a behavior count as if it had passed that at `at`."""
        if (node := self._node_of.get(behavior)) is not None:
            self._floor[node], self._is_new = at, True

    def prolong(self, source: int, target: int, seconds: Seconds) -> None:
        """Let the delay from one instant to another take so much longer than planned: its clock was stopped."""
        delays = [n for n in self._out[source] if self._arcs[n].target == target and not self._arcs[n].is_bound]
        bounds = [n for n in self._out[target] if self._arcs[n].target == source and self._arcs[n].is_bound]
        for number in (*delays, *self._moved.get((source, target), ()), *bounds):
            arc = self._arcs[number]
            if not arc.behavior:
                longer = -seconds if arc.is_bound else seconds
                more, arc.stopped = longer - arc.stopped, longer
                self._ask(number, self._asked[number] + more, arc.least + more)

    def relearn(self, behaviors: Iterable[str]) -> None:
        """Take over the changed factors of these behaviors."""
        for behavior in behaviors:
            factor = self._factor(behavior)
            for number in self._of_behavior.get(behavior, ()):
                arc = self._arcs[number]
                self._ask(number, arc.natural * factor, arc.shortest * factor)

    def _ask(self, number: int, asked: Seconds, least: Seconds) -> None:
        self._asked[number], self._arcs[number].least, self._is_new = asked, least, True
        if number not in self._given_way:
            self._seconds[number] = asked

    # -- questions -----------------------------------------------------------------------------------------------

    def phase(self, behavior: str, target: int) -> Seconds:
        """Expected seconds of the behavior's phase that ends at `target`."""
        number = self._phase_to.get((behavior, target))
        return 0.0 if number is None else self._seconds[number]

    def longest(self, behavior: str, target: int) -> Seconds:
        """Most seconds that the phase may take that ends at `target`; inf where the body can wait."""
        return self._longest.get((behavior, target), inf) * self._factor(behavior)

    def is_hurried(self, behavior: str, target: int | None = None) -> bool:
        """True if a phase of the behavior is to be faster than is natural. target: where it ends; None: anywhere."""
        if target is not None:
            return self._phase_to.get((behavior, target)) in self._given_way
        hurried = (number for number in self._given_way if not self._arcs[number].is_bound)
        return any(self._arcs[number].behavior == behavior for number in hurried)

    @property
    def bounded(self) -> set[int]:
        """Instants that an upper bound can hold back, or that make one do so."""
        bounds = [arc for arc in self._arcs if arc.is_on and arc.is_bound]
        return {arc.source for arc in bounds} | {arc.target for arc in bounds}

    def as_of(self, now: Seconds, overdue: Iterable[tuple[int, Seconds]]) -> "Forecast":
        """Another forecast of the same facts, in which nothing that has not come is expected before `now`.

        overdue: instants that are expected no earlier than even later. What was said by `overdue` so far is left out.
        """
        other = copy(self)
        here = zip(self._is_fact, self._floor, self._there, strict=False)
        least = [floor if is_fact else max(there, now) for is_fact, floor, there in here]
        other._floor = [*least, *self._floor[self._size :]]
        for transition, at in overdue:
            if not self._is_fact[transition]:
                other._floor[transition] = max(at, other._floor[transition])
        other._is_new = True
        other.update()
        return other

    def update(self) -> set[int]:
        """Draw the conclusions of all facts; returns the transitions that have moved since the last time."""
        if not self._is_new:
            return set()
        self._is_new = False
        before = self.times
        self._seconds = self._asked[:]
        self._given_way = set()
        for _ in range(REPAIRS):
            try:
                excess, missed_by, reasons = self._relax()
            except Circle as circle:
                self._make_way(circle.arcs, sum(self._seconds[each] for each in circle.arcs))
                continue
            if excess is None:
                break
            self._make_way([*reasons, excess], missed_by)
        else:
            for number, arc in enumerate(self._arcs):
                if arc.is_bound and not self._is_fact[arc.source]:
                    self._give_up(number)
            self._relax()
        others = compress(range(self._size), map(ne, self.times, before))
        return {each for each in others if abs(self.times[each] - before[each]) > FINEST}

    # -- longest paths -------------------------------------------------------------------------------------------

    def _relax(self) -> tuple[int | None, Seconds, list[int]]:
        """Set the times. Returns a bound on a fact that cannot be kept, by how much, and the arcs that ask for that.

        Raises Circle.
        """
        seconds, sources, targets = self._seconds, self._source, self._moves
        times = self.times = self._floor[:]
        causes: dict[int, int] = {}
        sweeps = 0
        while True:
            moved = -1
            for number in self._back if sweeps % 2 else self._forward:
                at, target = times[sources[number]] + seconds[number], targets[number]
                if at > times[target] + FINEST:
                    times[target], causes[target], moved = at, number, target
            sweeps += 1
            if moved < 0 and sweeps > 1:
                break  # One sweep in this order finds all that follows from arcs of one kind.
            if moved >= 0 and sweeps > 2 and (circle := self._chain(causes, moved)[1]):
                raise Circle(circle)
        broken = [
            number
            for number in self._on_facts
            if times[(arc := self._arcs[number]).source] + seconds[number] > times[arc.target] + EPSILON
        ]
        if not broken:
            return None, 0.0, []
        number = max(broken, key=lambda each: (self._rank[self._arcs[each].source], each))
        arc = self._arcs[number]
        missed_by = times[arc.source] + seconds[number] - times[arc.target]
        return number, missed_by, self._chain(causes, arc.source)[0]

    def _chain(self, causes: Mapping[int, int], node: int) -> tuple[list[int], list[int]]:
        """The arcs that make a node as late as it is, from the last on; and those of a circle among them, if any."""
        path: list[int] = []
        seen: dict[int, int] = {}
        while (number := causes.get(node)) is not None:
            if node in seen:
                return path, path[seen[node] :]
            seen[node] = len(path)
            path.append(number)
            node = self._arcs[number].source
        return path, []

    # -- making way ----------------------------------------------------------------------------------------------

    def _make_way(self, numbers: Sequence[int], excess: Seconds) -> None:
        """Let the phases along the way take less, or bear more, by `excess` in all; if they cannot, give up a bound.

        As the plan does: what it does not keep is not hurried for; what it makes slower or faster gives way first.
        """
        if (unkept := next((each for each in numbers if each in self._unkept), None)) is not None:
            self._give_up(unkept)
            return
        arcs, seconds = self._arcs, self._seconds
        room = {each: seconds[each] - arcs[each].least for each in numbers}
        elastic = [each for each in numbers if room[each] > FINEST and arcs[each].behavior]
        if (as_others := next((each for each in numbers if each in self._as_others), None)) is not None:
            elastic = [each for each in elastic if arcs[each].is_bound or each in self._bent]
        boundless = [each for each in elastic if room[each] == inf]
        if boundless:
            elastic = [
                min(boundless, key=lambda each: (each not in self._bent, self._rank.get(arcs[each].target, -1)))
            ]
            room[elastic[0]] = excess
        enough = bool(elastic) and sum(room[each] for each in elastic) >= excess - EPSILON
        # What can be slower gives way before what has to hurry.
        for is_bound, is_bent in ((True, True), (True, False), (False, True), (False, False)):
            giving = [each for each in elastic if arcs[each].is_bound == is_bound and (each in self._bent) == is_bent]
            total = sum(room[each] for each in giving)
            share = min(1.0, excess / total) if total > 0.0 and excess > 0.0 else 0.0
            excess -= share * total
            for each in giving if share else ():
                self._given_way.add(each)
                seconds[each] -= share * room[each]
        if not enough and as_others is not None:
            self._given_way.add(as_others)
            seconds[as_others] -= excess
        elif not enough:
            bounds = [each for each in numbers if arcs[each].is_bound]
            self._give_up(next((each for each in bounds if arcs[each].behavior), bounds[-1]))

    def _give_up(self, number: int) -> None:
        self._seconds[number] = -inf


def full_forecast(
    plan: Plan,
    began: Seconds,
    factor: Callable[[str], float],
    foreseen: Mapping[Point, Seconds],
    reached: Mapping[Point, Seconds],
    arrived: Mapping[Point, Seconds],
    instants: Mapping[int, Seconds],
    prolonged: Iterable[tuple[int, int, Seconds]] = (),
    heard: Mapping[str, Seconds] = {},
) -> Forecast:
    """Forecast of a block that keeps none, which has yet to be asked (`update`, `as_of`).

    instants: those that are over. prolonged, heard: see `prolong` and `shift` of `Forecast`.
    """
    forecast = Forecast(plan, began, factor, foreseen)
    for source, target, seconds in prolonged:
        forecast.prolong(source, target, seconds)
    for point, at in reached.items():
        if point in plan.at:
            forecast.passed(point.behavior, plan.at[point], at)
    for point in arrived.keys() - reached.keys():
        if point in plan.at:
            forecast.come(point.behavior, plan.at[point], arrived[point])
    for behavior, at in heard.items():
        forecast.shift(behavior, at)
    for transition, at in instants.items():
        forecast.fix(transition, at)
    return forecast


def is_predictive(plan: Plan) -> bool:
    """True if a time is bounded from above, or a point that cannot or should not wait is tied to another."""
    if any(bound.kind != "phase" for bound in plan.net.bounds):
        return True
    constrained = {place.target for place in plan.net.places if place.kind in ("order", "delay", "series")}
    return any(
        any(member.kind in ("passive", "prompt") for member in members)
        and (len(members) > 1 or transition in constrained)
        for transition, members in enumerate(plan.members)
    )
