"""Forecast of the instants of a running block: a new fact costs what it changes, not the whole net.

Longest paths from what was measured, through phases at the pace measured so far and through bounds. What stretches
(a phase within the body's shortest and longest time) gives way where a bound could not be kept otherwise.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import inf

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.foresee.longest_paths import FINEST, Arc, Circle, LongestPaths
from engage_hri.services.realizer.net.petri_net import order
from engage_hri.services.realizer.plan.known import is_foreign
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.points import EPSILON, Point

REPAIRS = 200
"""Most bounds that are made way for in one `update`; those that cannot be kept then are given up for this time."""


class Forecast(LongestPaths):
    """Expected times of the transitions: those that were measured, that are required, or that those depend on.

    factor: how many times longer than estimated a behavior takes, by its id. foreseen: expected times of points of
    other blocks.
    """

    def __init__(
        self, plan: Plan, began: Seconds, factor: Callable[[str], float], foreseen: Mapping[Point, Seconds]
    ) -> None:
        net, planned = plan.net, plan.schedule
        size = len(net.transitions)
        super().__init__(size, began)
        self._there: list[Seconds] = [began] * size
        """Time at which the latest of those behaviors came that are at the instant."""
        self._factor = factor
        self._phase_to: dict[tuple[str, int], int] = {}
        self._phase_from: dict[tuple[str, int], int] = {}
        self._after: dict[tuple[str, int], tuple[int, ...]] = {}
        """Arcs from where a behavior passes a transition, apart from its phases."""
        self._moved: dict[tuple[int, int], list[int]] = {}
        """Those of them that count from the behavior's own time, by the transitions at their ends."""
        self._of_behavior: dict[str, list[int]] = {}
        self._stopped: dict[int, Seconds] = {}
        """Seconds by which arcs are longer than planned; see `prolong`."""
        self._given_way: set[int] = set()
        self._broken: set[int] = set()
        self._unkept: set[int] = set()
        """Bounds that the plan does not keep."""
        self._as_others: set[int] = set()
        """Bounds that keep who is left of an instant no later than the others have passed it."""
        self._bent: set[int] = set()
        """Phases that the plan makes shorter, and the bounds of those that it makes longer, than is natural."""
        for rank, transition in enumerate(order(net) or range(size)):
            self._rank[transition] = rank
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
        """For each instant with points of other blocks, the arc that keeps it no earlier than those blocks expect."""
        self._awaited: dict[int, list[str]] = {}
        """For each instant, the behaviors of other blocks that have yet to pass it."""
        for point in plan.foreign:
            self._awaited.setdefault(transition := plan.at[point], []).append(point.behavior)
            if transition not in self._elsewhere:
                node = self._new_node()
                self.times[node] = began
                self._elsewhere[transition] = self._add(node, transition, 0.0, 0.0, "")
        self._drop_idle_bounds()
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
        arc = Arc(source, target, asked * factor, least * factor, behavior, is_bound, natural=asked, shortest=least)
        arc.seconds = arc.asked
        self._arcs.append(arc)
        self._out[source].append(number)
        self._in[target].append(number)
        return number

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
        expected, was_kept = self.times[transition], self.is_kept[transition]
        self._is_fact[transition] = self.is_kept[transition] = True
        for number in self._in[transition]:
            if self._arcs[number].is_bound and not self._arcs[number].behavior:
                self.require(self._arcs[number].source)
        if was_kept and abs(at - expected) <= FINEST:
            self._uncause(transition)
            self._see_reasons_again(transition)
            return
        self._set(transition, at, -1)
        if at < expected:
            for effect in list(self._effects[transition]):
                self._invalidate(effect)
            for number in self._in[transition]:
                self._touch(self._arcs[number].source)

    def passed(self, behavior: str, transition: int, at: Seconds) -> None:
        """Note that the behavior has passed its point there; the others of the instant perhaps not yet."""
        self.come(behavior, transition, at)
        if behavior in (awaited := self._awaited.get(transition, [])):
            awaited.remove(behavior)
            if not awaited:
                self.foresee(transition, self._there[transition])  # All have come: it is no more what was expected.
        for each in self._after.pop((behavior, transition), ()):
            self._moved.setdefault((transition, self._arcs[each].target), []).append(each)
            self._start_from(self._new_node(), each, at)
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
        self._start_from(node := self._whereabouts(behavior), number, at)
        for other in self._of_behavior[behavior]:
            if self._arcs[other].target == transition:
                self._end_at(node, other)

    def _stay_with(self, behavior: str, transition: int, at: Seconds) -> None:
        """Let no bound make the others of an instant later than this one has passed it; who is late is late.

        Where one of another block has passed it, the plan says how much later the others come.
        """
        bounds = [self._arcs[each] for each in self._in[transition] if self._arcs[each].is_on or each in self._broken]
        is_kept = self._is_fact[transition] or not self._as_others.isdisjoint(self._out[transition])
        if not (is_kept or is_foreign(behavior)) and any(arc.is_bound and arc.behavior != behavior for arc in bounds):
            node = self._new_node()
            self.times[node] = at
            self._as_others.add(self._add(transition, node, 0.0, 0.0, "", is_bound=True))
            self.require(transition)
            self._touch(transition)

    def _start_from(self, node: int, number: int, at: Seconds) -> None:
        """Let an arc count from `at`, the time of a node of its own."""
        arc = self._arcs[number]
        is_cause = self._cause[arc.target] == number
        as_expected = is_cause and abs(at + arc.seconds - self.times[arc.target]) <= FINEST
        if is_cause:
            self._effects[arc.source].discard(arc.target)
            self._effects[node].add(arc.target)
        self._out[arc.source].remove(number)
        arc.source, self.times[node] = node, at
        self._out[node] = [number]
        if not as_expected:
            self._loosen(number)
            self._touch(node)

    def _end_at(self, node: int, number: int) -> None:
        """Let an upper bound count from the time of a node: the phase has begun, its beginning waits for nothing.

        What cannot be slower from there on does not wait: who is to meet it at its end has to hurry.
        """
        arc = self._arcs[number]
        if not arc.is_bound or not (arc.is_on or number in self._broken):
            self._switch_off(number)
            return
        self._in[before := arc.target].remove(number)
        self._in[node].append(number)
        arc.target = node
        if self._cause[before] == number:
            self._invalidate(before)
        self.require(arc.source)
        self._touch(arc.source)

    def _see_reasons_again(self, node: int) -> None:
        """Let `update` see anew what has to give way, if anything does: a fact that moves nothing may free it."""
        if self._given_way or self._broken:
            self._touch(node)

    def _whereabouts(self, behavior: str) -> int:
        """The node for the time at which the behavior passed its latest point; it belongs to no instant."""
        if (node := self._node_of.get(behavior)) is None:
            node = self._node_of[behavior] = self._new_node()
        return node

    def come(self, behavior: str, transition: int, at: Seconds) -> None:
        """Note that the behavior is at its point there, or past it."""
        self._there[transition] = max(self._there[transition], at)
        self._see_reasons_again(transition)
        number = self._phase_to.get((behavior, transition))
        if number is None or not self._arcs[number].is_on:
            self._raise_base(transition, at)
            return
        self._base[transition] = self._there[transition]
        if self._cause[transition] == number and abs(at - self.times[transition]) <= FINEST:
            self._uncause(transition)
        self._switch_off(number)
        if self._is_fact[transition]:
            return
        if self._cause[transition] < 0 and self.times[transition] > self._base[transition] + FINEST:
            self._invalidate(transition)
        elif self._base[transition] > self.times[transition]:
            self._set(transition, self._base[transition], -1)

    def overdue(self, transition: int, at: Seconds) -> None:
        """Expect the instant no earlier than `at`: it has not come yet."""
        if not self._is_fact[transition]:
            self._raise_base(transition, at)

    def foresee(self, transition: int, at: Seconds) -> None:
        """Expect the points of other blocks at this instant at `at`."""
        number = self._elsewhere[transition]
        node = self._arcs[number].source
        before, self.times[node] = self.times[node], at
        if at < before:
            self._loosen(number)
        self._touch(node)

    def prolong(self, source: int, target: int, seconds: Seconds) -> None:
        """Let the delay from one instant to another take so much longer than planned: its clock was stopped."""
        delays = [n for n in self._out[source] if self._arcs[n].target == target and not self._arcs[n].is_bound]
        bounds = [n for n in self._out[target] if self._arcs[n].target == source and self._arcs[n].is_bound]
        for number in (*delays, *self._moved.get((source, target), ()), *bounds):
            arc = self._arcs[number]
            longer = -seconds if arc.is_bound else seconds
            more = longer - self._stopped.get(number, 0.0)
            if not arc.behavior and more:
                self._stopped[number] = longer
                arc.asked, arc.least = arc.asked + more, arc.least + more
                if arc.is_on:
                    self._set_seconds(number, arc.asked)
                self._see_reasons_again(source)

    def relearn(self, behaviors: Iterable[str]) -> None:
        """Take over the changed factors of these behaviors."""
        for behavior in behaviors:
            factor = self._factor(behavior)
            for number in self._of_behavior.get(behavior, ()):
                arc = self._arcs[number]
                arc.asked, arc.least = arc.natural * factor, arc.shortest * factor
                if arc.is_on and number not in self._given_way:
                    self._set_seconds(number, arc.asked)
                self._see_reasons_again(arc.source)

    # -- questions -----------------------------------------------------------------------------------------------

    def phase(self, behavior: str, target: int) -> Seconds:
        """Expected seconds of the behavior's phase that ends at `target`."""
        number = self._phase_to.get((behavior, target))
        return 0.0 if number is None else self._arcs[number].seconds

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

    def update(self) -> set[int]:
        """Draw the conclusions of all facts since the last time; returns the transitions that have moved."""
        if not self._todo and not self._old:
            return set()
        if self._given_way or self._broken:
            for number in sorted(self._given_way | self._broken):
                self._restore(number)
            self._given_way.clear()
            self._broken.clear()
        for _ in range(REPAIRS):
            try:
                excess = self._relax()
            except Circle as cycle:
                self._make_way(cycle.arcs, sum(self._arcs[each].seconds for each in cycle.arcs))
                continue
            if excess is None:
                break
            arc = self._arcs[excess]
            missed_by = self.times[arc.source] + arc.seconds - self.times[arc.target]
            self._make_way([*self._reasons(arc.source), excess], missed_by)
        else:
            self._give_up()
        changed = {each for each, old in self._old.items() if abs(self.times[each] - old) > FINEST}
        self._old.clear()
        return changed

    def _switch_off(self, number: int) -> None:
        self._given_way.discard(number)
        self._broken.discard(number)
        super()._switch_off(number)

    # -- making way ----------------------------------------------------------------------------------------------

    def _make_way(self, numbers: Sequence[int], excess: Seconds) -> None:
        """Let the phases along the way take less, or bear more, by `excess` in all; if they cannot, break a bound.

        As the plan does: what it does not keep is not hurried for; what it makes slower or faster gives way first.
        """
        if (unkept := next((each for each in numbers if each in self._unkept), None)) is not None:
            self._break(unkept)
            return
        room = {each: self._arcs[each].seconds - self._arcs[each].least for each in numbers}
        elastic = [each for each in numbers if room[each] > FINEST and self._arcs[each].behavior]
        if (as_others := next((each for each in numbers if each in self._as_others), None)) is not None:
            elastic = [each for each in elastic if self._arcs[each].is_bound or each in self._bent]
        boundless = [each for each in elastic if room[each] == inf]
        if boundless:
            elastic = [min(boundless, key=lambda each: (each not in self._bent, self._rank[self._arcs[each].target]))]
            room[elastic[0]] = excess
        enough = bool(elastic) and sum(room[each] for each in elastic) >= excess - EPSILON
        # What can be slower gives way before what has to hurry.
        for is_bound, is_bent in ((True, True), (True, False), (False, True), (False, False)):
            giving = [
                each for each in elastic if self._arcs[each].is_bound == is_bound and (each in self._bent) == is_bent
            ]
            total = sum(room[each] for each in giving)
            share = min(1.0, excess / total) if total > 0.0 and excess > 0.0 else 0.0
            excess -= share * total
            for each in giving if share else ():
                self._given_way.add(each)
                self._set_seconds(each, self._arcs[each].seconds - share * room[each])
        if not enough and as_others is not None:
            self._given_way.add(as_others)
            self._set_seconds(as_others, self._arcs[as_others].seconds - excess)
        elif not enough:
            bounds = [each for each in numbers if self._arcs[each].is_bound]
            self._break(next((each for each in bounds if self._arcs[each].behavior), bounds[-1]))

    def _break(self, number: int) -> None:
        self._broken.add(number)
        self._arcs[number].is_on = False
        self._loosen(number)

    def _restore(self, number: int) -> None:
        arc = self._arcs[number]
        if number in self._broken:
            arc.is_on = True
            self._touch(arc.source)
        self._set_seconds(number, arc.asked)

    def _give_up(self) -> None:
        for number, arc in enumerate(self._arcs):
            if arc.is_on and arc.is_bound and not self._is_fact[arc.source]:
                self._break(number)
        self._relax()
