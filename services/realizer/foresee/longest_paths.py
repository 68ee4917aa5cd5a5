"""Longest paths that are kept up to date: an instant that moves costs what depends on it, not the whole net."""

import heapq
from collections import defaultdict
from collections.abc import Sequence

from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.points import EPSILON

FINEST: Seconds = 1e-8
"""Seconds; smaller changes are rounding."""


class Arc(Struct, gc=False):
    """Lower bound: `target` is no earlier than `source` + `seconds`.

    asked: what `seconds` is when nothing gives way. least: what it may give way to. behavior: set if it is a phase.
    is_bound: may be broken if nothing else gives way. is_on: False once it has no effect any more. natural, shortest:
    of a phase, `asked` and `least` as estimated.
    """

    source: int
    target: int
    asked: Seconds
    least: Seconds
    behavior: str = ""
    is_bound: bool = False
    seconds: Seconds = 0.0
    is_on: bool = True
    natural: Seconds = 0.0
    shortest: Seconds = 0.0


class Circle(Exception):
    """A cycle of arcs that takes more than no time: no times satisfy all of them."""

    def __init__(self, arcs: Sequence[int]) -> None:
        self.arcs = tuple(arcs)


class LongestPaths:
    """Earliest times that the arcs allow, for each node that is a fact, or required, or that those depend on.

    is_kept: whether the time of a node is kept up to date; not needed while no decision depends on it.
    """

    def __init__(self, size: int, began: Seconds) -> None:
        self.times: list[Seconds] = [began] * size
        self._base: list[Seconds] = [began] * size
        """Time that a node is never earlier than, whatever the arcs say."""
        self._is_fact = [False] * size
        self.is_kept = [False] * size
        self._cause: list[int] = [-1] * size
        self._effects: defaultdict[int, set[int]] = defaultdict(set)
        self._arcs: list[Arc] = []
        self._out: list[list[int]] = [[] for _ in range(size)]
        self._in: list[list[int]] = [[] for _ in range(size)]
        self._rank = [0] * size
        """Order in which nodes are looked at."""
        self._old: dict[int, Seconds] = {}
        self._node_of: dict[str, int] = {}
        """For each behavior under way, the node for the time at which it passed its latest point."""
        self._todo: list[tuple[int, int]] = []

    def shift(self, behavior: str, at: Seconds) -> None:
        """Let what comes after the latest point of a behavior count as if it had passed that at `at`."""
        if (node := self._node_of.get(behavior)) is None:
            return
        before, self.times[node] = self.times[node], at
        for number in self._out[node] if at < before else ():
            self._loosen(number)
        self._touch(node)
        for bound in self._in[node]:
            self._touch(self._arcs[bound].source)

    def require(self, transition: int) -> None:
        """Keep the time of this node, and of all that it depends on, from now on."""
        stack, found = [transition], []
        while stack:
            here = stack.pop()
            if not self.is_kept[here] and not self._is_fact[here]:
                self.is_kept[here] = True
                found.append(here)
                stack += [self._arcs[number].source for number in self._in[here] if self._arcs[number].is_on]
        for here in sorted(found, key=self._rank.__getitem__):
            self._recompute(here)

    # -- propagation ---------------------------------------------------------------------------------------------

    def _relax(self) -> int | None:
        """Move what is too early. Returns a bound on a fact that cannot be kept then, if any. Raises Circle."""
        violated: list[int] = []
        moves = 0
        while self._todo:
            _, here = heapq.heappop(self._todo)
            for number in self._out[here]:
                arc = self._arcs[number]
                at = self.times[here] + arc.seconds
                if not arc.is_on or at <= self.times[arc.target] + FINEST:
                    continue
                if self._is_fact[arc.target]:
                    is_late = arc.is_bound and not self._is_fact[here]
                    if is_late and at > self.times[arc.target] + EPSILON:
                        violated.append(number)
                    continue
                if not self.is_kept[arc.target]:
                    continue
                self._set(arc.target, at, number)
                moves += 1
                if moves & (moves - 1) == 0 and (cycle := self._circle(arc.target)):
                    self._see_again([number, *violated])
                    raise Circle(cycle)
        self._see_again(violated)
        return violated[-1] if violated else None

    def _see_again(self, numbers: Sequence[int]) -> None:
        """Look at these arcs again once way has been made for one."""
        for number in numbers:
            self._touch(self._arcs[number].source)

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
        """Forget why `transition`, and all that follows from it, is as late as it is; and compute that again."""
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
        if self._is_fact[transition] or not self.is_kept[transition]:
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
            self._loosen(number)

    def _loosen(self, number: int) -> None:
        target = self._arcs[number].target
        if self._cause[target] == number:
            self._invalidate(target)

    def _set_seconds(self, number: int, seconds: Seconds) -> None:
        arc = self._arcs[number]
        before, arc.seconds = arc.seconds, seconds
        # Equal seconds change nothing: to compute the times again would only cost time.
        if seconds < before:
            self._loosen(number)
        elif seconds > before:
            self._touch(arc.source)

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

    def _new_node(self) -> int:
        """Add a node that is a fact, without arcs; returns its number."""
        self.times.append(0.0)
        self._base.append(0.0)
        self._is_fact.append(True)
        self.is_kept.append(True)
        self._cause.append(-1)
        self._out.append([])
        self._in.append([])
        self._rank.append(-1)
        return len(self.times) - 1
