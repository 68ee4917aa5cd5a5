"""The order in which behaviors of a block have a part, and its speeches the voice, where ties forbid the usual order.

Usually who has a part first is found by when the behaviors would start, each by itself, and speeches are said as the
document has them. Ties to others may leave no time for that: the second cannot wait for the first, or it could if a
third came earlier. A search that swaps one pair after the other needs hundreds of schedules for a block of a hundred
behaviors. So all users of a part are ordered in one pass (precedence constraint posting: Smith and Cheng,
"Slack-based heuristics for constraint satisfaction scheduling", AAAI 1993):

1. For each two users it is known how much later than the start of the one the other leaves the part, at least. That
   comes from the spare time of the ties in a schedule in which none of them waits for another (`_Room`).
2. Of two users of which only one can wait for the other, that one waits. This is a new tie and leaves less time to
   others. So the pairs are looked at again, until nothing new follows.
3. What is still open is decided one user after the other: behaviors in the order in which they would have to set out,
   speeches in that of the document. Each comes last of those that are placed so far, or as late as the ties allow.
   Each decision is a tie for the next. If one fits nowhere, earlier decisions are taken back, for a while (`MOST`).

A user that fits nowhere all the same is lost: the schedule tells why. The work ends, since each order is found from
one schedule, and the next only when a behavior or a tie is gone, or when another behavior was in the way.
"""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, Place
from engage_hri.services.realizer.plan.assembly import Assembly
from engage_hri.services.realizer.plan.handover import Turn, is_tied, least
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.relations import Classes, Relations
from engage_hri.services.realizer.plan.schedule import Circle, distances, spare_times
from engage_hri.services.realizer.points import EPSILON, SHIFTS, Point

MOST = 50
"""Places that are tried for the users of a part when not all have found one at once."""


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
        self._rivals = frozenset[str]()
        """Behaviors that have been in the way of others, or had others in their way."""
        self.begin_anew()

    def begin_anew(self) -> None:
        """Begin again without changes: the speeches have another order, or something is gone."""
        self._changed = frozenset[Turn]()
        self._ordered = frozenset[str]()
        """The rivals when they were last ordered."""
        self._untouched: Untouched | None = None

    @property
    def turns(self) -> frozenset[Turn]:
        return self.given | self._changed

    def see(self, seen: Untouched, chains: Mapping[str, Chain]) -> bool:
        """Note a schedule; the first is the one in which nobody waits for a part yet. True if who has been in the way
        of others so far changes places at once."""
        if self._untouched is not None:
            return False
        self._untouched = seen
        return self._order(chains)

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
        return self._order(chains)

    def _order(self, chains: Mapping[str, Chain]) -> bool:
        """Order those that have been in the way; False if that gives no new order."""
        rivals = self._rivals & chains.keys()
        if self._untouched is None or self._ordered == rivals:
            return False
        before, self._ordered = self._changed, rivals
        self._changed = _turns([chains[id] for id in chains if id in rivals], self._untouched)
        return self._changed != before


class SpeakingOrder:
    """The order in which the speeches of a block are said. current: the order to plan with; empty: in none.

    It is the document's at first. If that is impossible, the block is planned without any order, once: that shows
    what is impossible by itself, and the room that there is for other orders. The next order is the last one: what is
    impossible in it is lost.
    """

    def __init__(self, speeches: Sequence[str]) -> None:
        """speeches: in document order."""
        self._document = self.current = tuple(speeches)
        self._is_last = len(speeches) < 2

    def begin_anew(self, left: Container[str], *, is_retimed: bool) -> None:
        """Begin again with those that are left of the speeches, in the order that was found so far.

        is_retimed: a speech has given up a time, so another order may be possible, even that of the document.
        """
        is_changed = self.current != self._document
        self._document = tuple([id for id in self._document if id in left])
        self.current = () if is_changed and is_retimed else tuple([id for id in self.current if id in left])
        self._is_last = len(self._document) < 2 or (self._is_last and not is_retimed)

    def refute(self, circles: Iterable[Circle]) -> bool:
        """Plan without an order if these circles come of it; False if none does, or if it was the last one.

        circles: of ties of the net that cannot be kept together.
        """
        ties = [tie for circle in circles for tie, _ in circle if isinstance(tie, Place)]
        if self._is_last or not any({tie.behavior, tie.after} <= {*self.current} for tie in ties):
            return False
        self.current = ()
        return True

    def find(self, seen: Untouched, chains: Mapping[str, Chain], classes: Classes) -> bool:
        """Find the order to plan with if `seen` is a schedule without one: then True."""
        if self._is_last or self.current:
            return False
        speeches = [chains[id] for id in self._document]
        found = _orders(speeches, seen, classes)
        self.current = tuple(dict.fromkeys(chain.behavior.id for order in found for chain in order))
        self._is_last = True
        return True

    @property
    def turns(self) -> frozenset[Turn]:
        """Each speech with the end of the one before it, for which it waits."""
        return frozenset((later, Point(earlier, "end")) for earlier, later in pairwise(self.current))


def _turns(users: Iterable[Chain], untouched: Untouched) -> frozenset[Turn]:
    """Each of these behaviors with the one before it that has the same part."""
    orders = _orders(sorted(users, key=untouched.leaving), untouched)
    pairs = (pair for order in orders for pair in pairwise(order))
    return frozenset((later.behavior.id, one.points[untouched.left(one)]) for one, later in pairs)


def _orders(users: Sequence[Chain], untouched: Untouched, classes: Classes | None = None) -> list[list[Chain]]:
    """For each part, its users in order.

    One that fits nowhere comes behind the one that it is placed after; if it is required, it is left out.

    users: in the order in which they are placed. classes: of points, if they are speeches: one that is
    tied to the words of another waits for nothing else.
    """
    room = _room(users, untouched, classes)
    # A shift takes nothing from a look, nor a look from a shift: see `handover.in_series`.
    groups = [
        [number for number, chain in enumerate(users) if part in chain.parts and (chain.type in SHIFTS) == is_shift]
        for part in sorted({part for chain in users for part in chain.parts})
        for is_shift in (False, True)
    ]
    room = room.decided(groups)
    found = []
    for group in groups:
        tries = iter(range(MOST))
        placed = _placed(group, [], room, tries, may_skip=False) or _placed(group, [], room, tries, may_skip=True)
        assert placed is not None
        order, room = placed
        for before, number in pairwise([-1, *group]):
            # What fits nowhere is to be lost, but for what is required: who is in its way is.
            is_kept = users[number].behavior.id in untouched.present.required and users[number].type != "speech"
            if number not in order and not is_kept:
                order.insert(order.index(before) + 1 if before in order else 0, number)
        found.append([users[number] for number in order])
    return found


def _placed(
    todo: Sequence[int], order: list[int], room: "_Room", tries: Iterator[int], *, may_skip: bool
) -> tuple[list[int], "_Room"] | None:
    """The order with all of `todo` in it, and the room that it leaves; None if there is none, or no try is left."""
    if not todo:
        return order, room
    for place in range(len(order), -1, -1):
        after: _Room | None = room
        for pair in pairwise((*order[max(0, place - 1) : place], todo[0], *order[place : place + 1])):
            after = after and after.with_wait(*pair)
        if after is not None and (may_skip or next(tries, None) is not None):
            longer = [*order[:place], todo[0], *order[place:]]
            if found := _placed(todo[1:], longer, after, tries, may_skip=may_skip):
                return found
    return _placed(todo[1:], order, room, tries, may_skip=may_skip) if may_skip else None


class _Room:
    """The time that ties leave for one user of a part to have it after another.

    apart: how much later than the start of each (row) the others leave the part (column), at least. is_free: whether
    the row follows the column without a wait.
    """

    def __init__(self, apart: NDArray[np.float64], is_free: NDArray[np.bool_]) -> None:
        self._apart = apart
        self._is_free = is_free

    def with_wait(self, earlier: int, later: int) -> "_Room | None":
        """The room that is left if one waits for another; None if it cannot.

        What comes after the start of the later is as much later than what the earlier follows.
        """
        if self._is_free[later, earlier]:
            return self
        if self._apart[later, earlier] > EPSILON:
            return None
        longer = self._apart[:, earlier, None] + self._apart[later]
        return _Room(np.maximum(self._apart, longer, out=longer), self._is_free)

    def decided(self, groups: Iterable[Sequence[int]]) -> "_Room":
        """The room that is left if one waits for the other wherever only one of the two can."""
        room, is_open = self, np.zeros_like(self._is_free)
        for group in groups:
            is_open[np.ix_(group, group)] = True
        while True:
            cannot = (room._apart > EPSILON) & ~room._is_free
            must = is_open & cannot & ~cannot.T
            if not must.any():
                return room
            is_open &= ~(must | must.T)
            for earlier, later in np.argwhere(must):
                room = room.with_wait(earlier, later) or room


def _room(users: Sequence[Chain], untouched: Untouched, classes: Classes | None) -> _Room:
    at, times = untouched.assembly.at, np.array(untouched.times)
    spare = spare_times(untouched.ties, untouched.times)
    clock = np.array(distances(0, spare))
    spare[0] = []  # From each start, the way through the start of the block is known then.
    starts = [at[chain.points[0]] for chain in users]
    ends = [at[chain.points[untouched.left(chain)]] for chain in users]
    ways = (distances(start, spare) for start in starts)
    found = np.array([[way[each] for each in (0, *ends)] for way in ways])
    least_spare = np.minimum(found[:, 1:], found[:, :1] + clock[ends])
    is_free = np.zeros((len(users), len(users)), np.bool_)
    if classes is not None:
        roots = [{classes.find(point)[0] for point in each.points} for each in users]
        is_free[:] = [
            [
                not own.isdisjoint(roots[number]) and is_tied(later, earlier, classes)
                for number, earlier in enumerate(users)
            ]
            for later, own in zip(users, roots, strict=True)
        ]
    return _Room(times[ends] - times[starts, None] - least_spare, is_free)
