"""The order in which behaviors of a block have a part, where the order of their starts leaves no time for all.

Who has a part first is found by when the behaviors would start, each by itself. Ties to others may leave no time for
that order: the second cannot wait for the first, or it could if a third came earlier. A search that swaps one pair
after the other needs hundreds of schedules for a block of a hundred behaviors. So all parts are ordered in one pass
(precedence constraint posting: Smith and Cheng, "Slack-based heuristics for constraint satisfaction scheduling", AAAI
1993):

1. For each two behaviors it is known how much later than the start of the one the other leaves its part, at least.
   That comes from the spare time of the ties in a schedule in which nobody waits for a part.
2. Of two behaviors of which only one can wait for the other, that one waits. This is a new tie and leaves less time
   to others. So the pairs are looked at again, until nothing new follows.
3. What is still open is decided in the order in which the behaviors would have to set out: each comes last of those
   that have the part so far, or as late as the ties allow. Each decision is a tie for the next.

A behavior that fits nowhere stays without a place. The schedule tells why, and the behavior is lost.

The work ends: the order follows from the behaviors that have been in the way of others, and these only become more.
They are kept in mind when a behavior is dropped, so that the next order is right at once.
"""

from collections.abc import Container, Iterable, Mapping, Sequence
from itertools import accumulate, combinations, pairwise
from math import inf
from typing import NamedTuple

import numpy as np

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, Place
from engage_hri.services.realizer.plan.assembly import Assembly
from engage_hri.services.realizer.plan.handover import Turn, least
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.relations import Relations
from engage_hri.services.realizer.plan.spare_time import distances, spare_times
from engage_hri.services.realizer.points import EPSILON, SHIFTS


class Untouched(NamedTuple):
    """A schedule in which nobody waits for a part. times: of each transition. present: what the block says."""

    assembly: Assembly
    times: Sequence[Seconds]
    present: Relations

    def left(self, chain: Chain) -> int:
        """Number of the point of a behavior from which on another may have its part."""
        held = self.present.held
        return max([least(chain), *(number for number, point in enumerate(chain.points) if point in held)])

    def leaving(self, chain: Chain) -> Seconds:
        """Time at which a behavior sets out for the first of its points that are tied, at its natural pace."""
        at, tied = self.assembly.at, self.present.constrained
        gone = accumulate((each.natural for each in chain.segments), initial=0.0)
        passed = [(point, self.times[at[point]] - seconds) for point, seconds in zip(chain.points, gone, strict=True)]
        return round(max(passed[0][1], min((at for point, at in passed if point in tied), default=0.0)), 6)

    @property
    def ties(self) -> list[Place | Bound]:
        """The ties that must be kept; mere custom leaves time for anything."""
        net = self.assembly.net
        ties: tuple[Place | Bound, ...] = (*net.places, *net.bounds)
        return [tie for tie in ties if not self.assembly.is_dispensable(tie)]


class PartOrder:
    """Behaviors that have changed places. turns: the waits that come of it, and those `given`, to begin with."""

    def __init__(self, given: frozenset[Turn] = frozenset()) -> None:
        self.given = given
        self._rivals = set[str]()
        """Behaviors that have been in the way of others, or had others in their way."""
        self.begin_anew()

    def begin_anew(self) -> None:
        """Begin again without changes: the speeches have another order, or something is gone."""
        self._changed = frozenset[Turn]()
        self._untouched: Untouched | None = None

    @property
    def turns(self) -> frozenset[Turn]:
        return self.given | self._changed

    def see(self, assembly: Assembly, times: Sequence[Seconds], present: Relations) -> None:
        """Note a schedule; the first is the one in which nobody waits for a part yet."""
        self._untouched = self._untouched or Untouched(assembly, times, present)

    def change(
        self, impossible: Iterable[Turn], turns: Iterable[Turn], chains: Mapping[str, Chain], begun: Container[str]
    ) -> bool:
        """Order the parts anew, since one behavior cannot wait for another; False if that gives no new order.

        impossible: waits for which there is no time. turns: all waits so far. begun: behaviors that have their parts
        already.
        """
        found = [each for each in impossible if each[0] in chains and chains[each[0]].type != "speech"]
        if idle := self.given.intersection(found):
            self.given -= idle
            return True
        if not found or self._untouched is None:
            return False
        rivals = {id for waiter, point in (*found, *turns) for id in (waiter, point.behavior)}
        self._rivals |= {id for id in rivals & chains.keys() if id not in begun and chains[id].type != "speech"}
        before = self._changed
        self._changed = _ordered([chains[id] for id in chains if id in self._rivals], self._untouched)
        return self._changed != before


def _ordered(users: Sequence[Chain], untouched: Untouched) -> frozenset[Turn]:
    """Each of these behaviors with the one before it that has the same part."""
    room = _room(users, untouched)
    by_leaving = sorted(users, key=untouched.leaving)
    parts = sorted({part for chain in users for part in chain.parts})
    # A shift takes nothing from a look, nor a look from a shift: see `handover.in_series`.
    groups = [
        [chain for chain in by_leaving if part in chain.parts and (chain.type in SHIFTS) == is_shift]
        for part in parts
        for is_shift in (False, True)
    ]
    _decide(groups, room)
    turns = set[Turn]()
    for group in groups:
        order: list[Chain] = []
        for chain in group:
            places = range(len(order), -1, -1)
            fitting = (place for place in places if room.fits(chain, order[max(0, place - 1) : place + 1], place))
            if (place := next(fitting, None)) is not None:
                order.insert(place, chain)
                for earlier, later in pairwise(order[max(0, place - 1) : place + 2]):
                    room.take(earlier, later)
        turns |= {(later.behavior.id, one.points[untouched.left(one)]) for one, later in pairwise(order)}
    return frozenset(turns)


def _decide(groups: Iterable[Sequence[Chain]], room: "_Room") -> None:
    """Let one wait for the other wherever only one can, until nothing new follows."""
    undecided = {
        frozenset((one.behavior.id, two.behavior.id)): (one, two)
        for each in groups
        for one, two in combinations(each, 2)
    }
    is_new = True
    while is_new:
        decided = [pair for pair, both in undecided.items() if room.decide(*both)]
        for pair in decided:
            del undecided[pair]
        is_new = bool(decided)


class _Room:
    """The time that ties leave for one behavior to have a part after another.

    users: the behaviors. apart: how much later than the start of each (row) the others leave their parts (column), at
    least.
    """

    def __init__(self, users: Sequence[Chain], apart: Sequence[Sequence[Seconds]]) -> None:
        self._number = {chain.behavior.id: number for number, chain in enumerate(users)}
        self._apart = np.array(apart)

    def is_left(self, earlier: Chain, later: Chain) -> bool:
        """True if `later` can wait for `earlier`."""
        one, other = self._number[earlier.behavior.id], self._number[later.behavior.id]
        return bool(self._apart[other, one] <= EPSILON)

    def take(self, earlier: Chain, later: Chain) -> None:
        """Let `later` wait for `earlier`: what comes after its start is as much later than what `earlier` follows."""
        one, other = self._number[earlier.behavior.id], self._number[later.behavior.id]
        np.maximum(self._apart, self._apart[:, one, None] + self._apart[other], out=self._apart)

    def decide(self, one: Chain, two: Chain) -> bool:
        """Let one wait for the other if only one can; False if both can."""
        is_first, is_second = self.is_left(one, two), self.is_left(two, one)
        if is_first != is_second:
            self.take(*((one, two) if is_first else (two, one)))
        return not (is_first and is_second)

    def fits(self, chain: Chain, neighbors: Sequence[Chain], place: int) -> bool:
        """True if there is room for a behavior among its neighbors. place: how many come before it; 0: none does."""
        before, after = (neighbors[:1], neighbors[1:]) if place else ((), neighbors)
        return all(self.is_left(each, chain) for each in before) and all(self.is_left(chain, each) for each in after)


def _room(users: Sequence[Chain], untouched: Untouched) -> _Room:
    at, times = untouched.assembly.at, untouched.times
    spare = spare_times(untouched.ties, times)
    clock = distances(0, spare)
    spare[0] = []  # From each start, the way through the start of the block is known then.
    ends = [at[chain.points[untouched.left(chain)]] for chain in users]
    apart = []
    for start in (at[chain.points[0]] for chain in users):
        found = distances(start, spare)
        back = found.get(0, inf)
        apart.append(
            [times[end] - times[start] - min(found.get(end, inf), back + clock.get(end, inf)) for end in ends]
        )
    return _Room(users, apart)
