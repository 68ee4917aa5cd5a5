"""The order in which behaviors of a block have a part: of two that cannot be in one order, the other is tried."""

from collections.abc import Container, Iterable, Mapping, Sequence
from itertools import accumulate

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.handover import Turn, in_series, least
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.points import Point


class PartOrder:
    """Behaviors that have changed places. turns: the waits that come of it, and those `given`, to begin with.

    Who takes a part first is found by when the two would start, each by itself. Only what is tied to them may tell
    that there is no time for it. Then those that are in each other's way come in the order in which they would have
    to set out if nobody waited for a part; if that does not help, they change places, once each pair; if that does
    not, either, back again.
    """

    def __init__(self, given: frozenset[Turn] = frozenset()) -> None:
        self.given = given
        self.begin_anew()

    def begin_anew(self) -> None:
        """Begin again without changes: the speeches have another order, or something is gone."""
        self._changed = frozenset[Turn]()
        self._times: Mapping[Point, Seconds] = {}
        self._tied: Container[Point] = ()
        self._sorted = set[str]()
        self._is_sorting = True
        self._tried = set[frozenset[str]]()

    @property
    def turns(self) -> frozenset[Turn]:
        return self.given | self._changed

    def see(self, times: Mapping[Point, Seconds], tied: Container[Point]) -> None:
        """Note when points come, the first time, when nobody waits for a part yet.

        tied: points of which the block says when they come.
        """
        if not self._times:
            self._times, self._tied = times, tied

    def change(self, impossible: Sequence[Turn], chains: Mapping[str, Chain], begun: Container[str]) -> bool:
        """Let some change places of which one cannot wait for the other; False if none has to be tried any more.

        impossible: waits for which there is no time. begun: behaviors that have their parts already.
        """
        found = [each for each in impossible if each[0] in chains and chains[each[0]].type != "speech"]
        if idle := self.given.intersection(found):
            self.given -= idle
            return True
        if found and self._times and self._is_sorting:
            turns = self._in_turn(found, chains, begun)
            self._is_sorting = turns not in (self._changed, frozenset(found))
            if self._is_sorting or self._changed:
                self._changed = turns if self._is_sorting else frozenset()
                return True
        for waiter, point in sorted(found):
            pair = frozenset((waiter, point.behavior))
            if pair in self._tried or point.behavior not in chains or any(id in begun for id in pair):
                continue
            self._tried.add(pair)
            last = chains[waiter].points[least(chains[waiter])]
            self._changed |= {(point.behavior, last)}
            return True
        if found and self._changed:
            self._changed = frozenset()
            return True
        return False

    def _in_turn(self, found: Iterable[Turn], chains: Mapping[str, Chain], begun: Container[str]) -> frozenset[Turn]:
        """Let each that has been in another's way wait for the one before it that has the same part."""
        self._sorted.update(id for waiter, point in found for id in (waiter, point.behavior))
        ids = [id for id in chains if id in self._sorted and id not in begun and chains[id].type != "speech"]
        ids.sort(key=lambda id: self._leaving(chains[id]))
        users = (
            [id for id in ids if part in chains[id].parts]
            for part in {part for id in ids for part in chains[id].parts}
        )
        return frozenset(
            (later, chains[earlier].points[least(chains[earlier], chains[later])])
            for each in users
            for earlier, later in in_series(each, chains)
        )

    def _leaving(self, chain: Chain) -> Seconds:
        """Time at which a behavior sets out for the first of its points that are tied, at its natural pace."""
        gone = accumulate((each.natural for each in chain.segments), initial=0.0)
        passed = [(point, self._times[point] - seconds) for point, seconds in zip(chain.points, gone, strict=True)]
        return round(max(passed[0][1], min((at for point, at in passed if point in self._tied), default=0.0)), 6)
