"""When each instant of a running block will be, as far as is known: a fact costs what it changes, not the whole net.

Longest paths from what was measured, through phases at the pace measured so far and through bounds. What stretches
(a phase within the body's shortest and longest time) gives way where a bound could not be kept otherwise.
"""

import heapq
from collections.abc import Callable, Iterable, Sequence
from math import inf

from msgspec import Struct

from schemas.units import Seconds
from services.realizer.net import order
from services.realizer.planner import Plan
from services.realizer.schedule import EPSILON

FINEST: Seconds = 1e-8
"""Changes below are rounding."""
REPAIRS = 200
"""Bounds that are made way for in one go, before those that are left are given up for this time."""


class _Arc(Struct):
    """`target` is no earlier than `source` + `seconds`.

    asked: what `seconds` is when nothing gives way. least: what it may give way to. behavior: whose phase it is.
    is_bound: may be broken if nothing else gives way. is_on: False once it says nothing any more.
    """

    source: int
    target: int
    asked: Seconds
    least: Seconds
    behavior: str = ""
    is_bound: bool = False
    seconds: Seconds = 0.0
    is_on: bool = True


class _Cycle(Exception):
    def __init__(self, arcs: Sequence[int]) -> None:
        self.arcs = tuple(arcs)


class Forecast:
    """times: of each transition that was measured, that is required, or that those depend on.

    factor: how much longer than estimated a behavior takes, by its id.
    """

    def __init__(self, plan: Plan, began: Seconds, factor: Callable[[str], float]) -> None:
        net = plan.net
        size = len(net.transitions)
        self.times: list[Seconds] = [began] * size
        self._there: list[Seconds] = [began] * size
        """When the last of those was there who are there."""
        self._base: list[Seconds] = [began] * size
        self._is_fact = [False] * size
        self._is_known = [False] * size
        """Is its time kept? What no decision depends on yet need not be known."""
        self._cause: list[int] = [-1] * size
        self._effects: list[set[int]] = [set() for _ in range(size)]
        self._factor = factor
        self._arcs: list[_Arc] = []
        self._out: list[list[int]] = [[] for _ in range(size)]
        self._in: list[list[int]] = [[] for _ in range(size)]
        self._phase_to: dict[tuple[str, int], int] = {}
        self._phase_from: dict[tuple[str, int], int] = {}
        self._natural: dict[int, tuple[Seconds, Seconds]] = {}
        """Of arcs of phases: asked and least as estimated."""
        self._of_behavior: dict[str, list[int]] = {}
        self._node_of: dict[str, int] = {}
        self._given_way: set[int] = set()
        self._old: dict[int, Seconds] = {}
        self._todo: list[tuple[int, int]] = []
        self._broken: set[int] = set()
        self._rank = [0] * size
        for rank, transition in enumerate(order(net) or range(size)):
            self._rank[transition] = rank
        for place in net.places:
            if place.kind != "idle":
                behavior = place.behavior if place.kind == "phase" else ""
                arc = self._add(place.source, place.target, place.lag, min(place.shortest, place.lag), behavior)
                if behavior:
                    self._phase_to[behavior, place.target] = self._phase_from[behavior, place.source] = arc
        self._longest = {
            (bound.behavior, bound.source): inf if bound.stretch is None else bound.stretch - bound.lag
            for bound in net.bounds
            if bound.kind == "phase"
        }
        for bound in plan.bounds:
            behavior = bound.behavior if bound.kind == "phase" else ""
            least = bound.lag if not behavior else -inf if bound.stretch is None else bound.lag - bound.stretch
            self._add(bound.source, bound.target, bound.lag, least, behavior, is_bound=True)
        self._drop_idle_bounds()
        self.fix(0, began)

    def _add(
        self, source: int, target: int, asked: Seconds, least: Seconds, behavior: str, *, is_bound: bool = False
    ) -> int:
        number = len(self._arcs)
        factor = 1.0
        if behavior:
            self._natural[number] = (asked, least)
            self._of_behavior.setdefault(behavior, []).append(number)
            factor = self._factor(behavior)
        arc = _Arc(source, target, asked * factor, least * factor, behavior, is_bound)
        arc.seconds = arc.asked
        self._arcs.append(arc)
        self._out[source].append(number)
        self._in[target].append(number)
        return number

    def _drop_idle_bounds(self) -> None:
        """A phase need not be bounded from above where nothing but the phase itself makes its end come late."""
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

    def require(self, transition: int) -> None:
        """Keep its time from now on, and all that it depends on."""
        stack, found = [transition], []
        while stack:
            here = stack.pop()
            if not self._is_known[here] and not self._is_fact[here]:
                self._is_known[here] = True
                found.append(here)
                stack += [self._arcs[number].source for number in self._in[here] if self._arcs[number].is_on]
        for here in sorted(found, key=self._rank.__getitem__):
            self._recompute(here)

    # -- facts ---------------------------------------------------------------------------------------------------

    def fix(self, transition: int, at: Seconds) -> None:
        """The instant was at `at`."""
        expected, was_known = self.times[transition], self._is_known[transition]
        self._is_fact[transition] = self._is_known[transition] = True
        for number in self._in[transition]:
            if self._arcs[number].is_bound and not self._arcs[number].behavior:
                self.require(self._arcs[number].source)
        if was_known and abs(at - expected) <= FINEST:
            self._uncause(transition)
            return
        self._set(transition, at, -1)
        if was_known and at < expected:
            for effect in list(self._effects[transition]):
                self._invalidate(effect)
            for number in self._in[transition]:
                self._touch(self._arcs[number].source)

    def passed(self, behavior: str, transition: int, at: Seconds) -> None:
        """The behavior has passed its point there; the others of the instant perhaps not yet."""
        self.come(behavior, transition, at)
        if (number := self._phase_from.get((behavior, transition))) is None:
            return
        arc = self._arcs[number]
        if arc.source == (node := self._whereabouts(behavior)):
            return
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
        for other in self._of_behavior[behavior]:
            # What has begun to run no longer keeps its beginning back.
            if self._arcs[other].is_bound and self._arcs[other].target == transition:
                self._switch_off(other)

    def _whereabouts(self, behavior: str) -> int:
        """An instant of its own: when the behavior passed its latest point."""
        if (node := self._node_of.get(behavior)) is None:
            node = self._node_of[behavior] = len(self.times)
            self.times.append(0.0)
            self._base.append(0.0)
            self._is_fact.append(True)
            self._is_known.append(True)
            self._cause.append(-1)
            self._effects.append(set())
            self._out.append([])
            self._in.append([])
            self._rank.append(-1)
        return node

    def come(self, behavior: str, transition: int, at: Seconds) -> None:
        """The behavior is at its point there, or past it."""
        self._there[transition] = max(self._there[transition], at)
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
        """What was to come there has not; it is not expected before `at`."""
        if not self._is_fact[transition]:
            self._raise_base(transition, at)

    def relearn(self, behaviors: Iterable[str]) -> None:
        """The factors of these have changed."""
        for behavior in behaviors:
            factor = self._factor(behavior)
            for number in self._of_behavior.get(behavior, ()):
                arc, (asked, least) = self._arcs[number], self._natural[number]
                arc.asked, arc.least = asked * factor, least * factor
                if arc.is_on and number not in self._given_way:
                    self._set_seconds(number, arc.asked)

    # -- questions -----------------------------------------------------------------------------------------------

    def phase(self, behavior: str, target: int) -> Seconds:
        """How long the phase that ends there is to take."""
        number = self._phase_to.get((behavior, target))
        return 0.0 if number is None else self._arcs[number].seconds

    def longest(self, behavior: str, target: int) -> Seconds:
        """How long the phase that ends there may take; inf where the body can wait."""
        return self._longest.get((behavior, target), inf) * self._factor(behavior)

    def gives_way(self, behavior: str) -> bool:
        """Is it to be faster or slower than is natural?"""
        return any(number in self._given_way for number in self._of_behavior.get(behavior, ()))

    def update(self) -> set[int]:
        """Draw the conclusions of all facts since the last time; the transitions whose time has changed."""
        if not self._todo and not self._old:
            return set()
        for number in sorted(self._given_way | self._broken):
            self._restore(number)
        self._given_way.clear()
        self._broken.clear()
        for _ in range(REPAIRS):
            try:
                excess = self._relax()
            except _Cycle as cycle:
                self._make_way(cycle.arcs, sum(self._arcs[each].seconds for each in cycle.arcs))
                continue
            if excess is None:
                break
            arc = self._arcs[excess]
            self._make_way([*self._reasons(arc.source), excess], self._violation(arc))
        else:
            self._give_up()
        changed = {each for each, old in self._old.items() if abs(self.times[each] - old) > FINEST}
        self._old.clear()
        return changed

    def _violation(self, arc: _Arc) -> Seconds:
        return self.times[arc.source] + arc.seconds - self.times[arc.target]

    # -- propagation ---------------------------------------------------------------------------------------------

    def _relax(self) -> int | None:
        """Move what is too early; the bound on a fact that cannot be kept then, if any. Raises _Cycle."""
        violated: int | None = None
        moves = 0
        while self._todo:
            _, here = heapq.heappop(self._todo)
            for number in self._out[here]:
                arc = self._arcs[number]
                at = self.times[here] + arc.seconds
                if not arc.is_on or at <= self.times[arc.target] + FINEST:
                    continue
                if self._is_fact[arc.target]:
                    is_late = arc.is_bound and not self._is_fact[here] and not arc.behavior
                    if is_late and at > self.times[arc.target] + EPSILON:
                        violated = number
                    continue
                if not self._is_known[arc.target]:
                    continue
                self._set(arc.target, at, number)
                moves += 1
                if moves & (moves - 1) == 0 and (cycle := self._circle(arc.target)):
                    self._touch(here)
                    raise _Cycle(cycle)
        if violated is not None:
            # Seen again when it has been made way for: there may be others.
            self._touch(self._arcs[violated].source)
        return violated

    def _set(self, transition: int, at: Seconds, cause: int) -> None:
        self._old.setdefault(transition, self.times[transition])
        self._uncause(transition)
        if cause >= 0:
            self._effects[self._arcs[cause].source].add(transition)
        self.times[transition], self._cause[transition] = at, cause
        self._touch(transition)

    def _touch(self, transition: int) -> None:
        heapq.heappush(self._todo, (self._rank[transition], transition))

    def _uncause(self, transition: int) -> None:
        if (before := self._cause[transition]) >= 0:
            self._effects[self._arcs[before].source].discard(transition)
            self._cause[transition] = -1

    def _invalidate(self, transition: int) -> None:
        """Forget why `transition`, and all that follows from it, is as late as it is; and find out anew."""
        stack, found = [transition], []
        seen = {transition}
        while stack:
            found.append(here := stack.pop())
            fresh = self._effects[here] - seen
            seen |= fresh
            stack += fresh
        for here in found:
            if not self._is_fact[here]:
                self._set(here, self._base[here], -1)
        for here in sorted(found, key=self._rank.__getitem__):
            self._recompute(here)

    def _recompute(self, transition: int) -> None:
        if self._is_fact[transition] or not self._is_known[transition]:
            return
        for number in self._in[transition]:
            arc = self._arcs[number]
            at = self.times[arc.source] + arc.seconds
            if arc.is_on and at > self.times[transition] + FINEST:
                self._set(transition, at, number)
        self._touch(transition)

    def _raise_base(self, transition: int, at: Seconds) -> None:
        if at > self._base[transition]:
            self._base[transition] = at
            if not self._is_fact[transition] and at > self.times[transition]:
                self._set(transition, at, -1)

    def _switch_off(self, number: int) -> None:
        arc = self._arcs[number]
        if arc.is_on:
            arc.is_on = False
            self._given_way.discard(number)
            self._broken.discard(number)
            self._loosen(number)

    def _loosen(self, number: int) -> None:
        target = self._arcs[number].target
        if self._cause[target] == number:
            self._invalidate(target)

    def _set_seconds(self, number: int, seconds: Seconds) -> None:
        arc = self._arcs[number]
        before, arc.seconds = arc.seconds, seconds
        if seconds < before:
            self._loosen(number)
        elif seconds > before:
            self._touch(arc.source)

    # -- making way ----------------------------------------------------------------------------------------------

    def _circle(self, transition: int) -> list[int]:
        """The circle of causes that leads to `transition`, if there is one."""
        path: list[int] = []
        seen: dict[int, int] = {}
        here = transition
        while (number := self._cause[here]) >= 0:
            if here in seen:
                return path[seen[here] :]
            seen[here] = len(path)
            path.append(number)
            here = self._arcs[number].source
        return []

    def _reasons(self, transition: int) -> list[int]:
        """The chain of arcs that makes `transition` as late as it is."""
        path, seen = [], set()
        while (number := self._cause[transition]) >= 0 and number not in seen:
            seen.add(number)
            path.append(number)
            transition = self._arcs[number].source
        return path

    def _make_way(self, numbers: Sequence[int], excess: Seconds) -> None:
        """Let the phases along the way take less, or bear more, by `excess` in all; if they cannot, break a bound."""
        room = {each: self._arcs[each].seconds - self._arcs[each].least for each in numbers}
        elastic = [each for each in numbers if room[each] > FINEST and self._arcs[each].behavior]
        boundless = [each for each in elastic if room[each] == inf]
        if boundless:
            elastic, share = boundless[:1], 1.0
            room[elastic[0]] = excess
        else:
            total = sum(room[each] for each in elastic)
            share = min(1.0, excess / total) if total > 0.0 else 0.0
        enough = bool(elastic) and sum(room[each] for each in elastic) >= excess - EPSILON
        for each in elastic:
            self._given_way.add(each)
            self._set_seconds(each, self._arcs[each].seconds - share * room[each])
        if not enough:
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
