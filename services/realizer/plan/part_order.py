"""The order in which behaviors of a block have a part: of two that cannot be in one order, the other is tried."""

from collections.abc import Container, Mapping, Sequence

from engage_hri.services.realizer.plan.handover import Turn, least
from engage_hri.services.realizer.plan.phases import Chain


class PartOrder:
    """Behaviors that have changed places. turns: the waits that come of it, to begin with.

    Who takes a part first is found by when the two would start, each by itself. Only what is tied to them may tell
    that there is no time for it: then they change places, once each pair; if that does not help, back again.
    """

    def __init__(self) -> None:
        self.turns: frozenset[Turn] = frozenset()
        self._tried: set[frozenset[str]] = set()

    def begin_anew(self) -> None:
        """Begin again without changes: the speeches have another order, or something is gone."""
        self.turns = frozenset()
        self._tried.clear()

    def change(self, impossible: Sequence[Turn], chains: Mapping[str, Chain], begun: Container[str]) -> bool:
        """Let two change places of which one cannot wait for the other; False if none has to be tried any more.

        impossible: waits for which there is no time. begun: behaviors that have their parts already.
        """
        found = [each for each in impossible if each[0] in chains and chains[each[0]].type != "speech"]
        for waiter, point in sorted(found):
            pair = frozenset((waiter, point.behavior))
            if pair in self._tried or point.behavior not in chains or any(id in begun for id in pair):
                continue
            self._tried.add(pair)
            last = chains[waiter].points[least(chains[waiter])]
            self.turns |= {(point.behavior, last)}
            return True
        if found and self.turns:
            self.turns = frozenset()
            return True
        return False
