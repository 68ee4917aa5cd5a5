"""The order in which the speeches of a block are said: that of the document, or else the next one that is possible.

Constraints come first. Where they leave no time for one speech after another, the two change places; a speech is lost
only when no order serves all. So first it is made sure that the speeches are possible without any order. That tells
which of them have to come before which; next is the document's order but for those that have to come earlier.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import pairwise
from math import inf
from typing import Literal

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.prediction import Circle
from engage_hri.services.realizer.plan.relations import Relations
from engage_hri.services.realizer.plan.spare_time import distances, spare_times
from engage_hri.services.realizer.points import EPSILON, Point

WORK = 400
"""Orders that are tried, times behaviors of the block."""
LEAST = 4
"""Orders that are tried of a large block."""


class Misordered(Exception):
    """Another order of the speeches is to be tried."""


class SpeakingOrder:
    """A search through the orders of some speeches. current: the order to plan with.

    Stages: `document`, the order that is tried first. `alone`: no order, to see what is impossible by itself, and
    which must come before which. `search`: other orders. `last`: none is left, or there is only one; what is
    impossible in it is lost.
    """

    def __init__(self, speeches: Sequence[str], size: int) -> None:
        """Begin with the document's order.

        speeches: in document order. size: behaviors of the block.
        """
        self.current: tuple[str, ...] = tuple(speeches)
        self._stage: Literal["document", "alone", "search", "last"] = "document" if len(speeches) > 1 else "last"
        self._budget = max(LEAST, WORK // max(1, size))
        self._start(self.current)

    def _start(self, speeches: tuple[str, ...]) -> None:
        self._first = self._nearest = speeches
        self._seen = {speeches}
        self._left: list[tuple[str, ...]] = []
        self._refuted: dict[tuple[str, str], tuple[str, ...]] = {}
        """Pairs of which the first cannot come before the second, whatever the others do, and in which order seen."""

    def begin_anew(self, speeches: Collection[str]) -> None:
        """Begin again with those that are left of the speeches."""
        nearest = tuple(each for each in self._nearest if each in speeches)
        self._start(tuple(each for each in self._first if each in speeches))
        if self._stage == "alone":
            return
        if self._budget:
            self._stage, self.current = "document", self._first
        else:
            self._stage, self.current, self._nearest = "last", nearest, nearest

    def pass_alone(self, net: PetriNet, at: Mapping[Point, int], times: Sequence[Seconds]) -> bool:
        """Take note that the block can be scheduled. True if that was without an order: one is to be tried now.

        at: the transition of each point. times: of each transition.
        """
        if self._stage != "alone":
            return False
        before = _before(self._first, net, at, times)
        self._stage, self.current = "search", _sorted(self._first, before)
        self._nearest = self.current
        if self.current not in self._seen:
            self._seen.add(self.current)
            self._left.append(self._first)
        return True

    def refute(self, circles: Iterable[Circle], net: PetriNet) -> bool:
        """Go on to the next order; False if these circles do not depend on the order, or none is left.

        circles: of ties of the net that cannot be kept together.
        """
        if self._stage in ("alone", "last"):
            return False
        ranked = [self._pairs(circle, net) for circle in circles]
        if self._stage == "document" and any(ranked):
            self._stage, self.current = "alone", ()
            return True
        if not all(ranked):
            return False
        single = (pairs[0] for pairs in ranked if len(pairs) == 1)
        self._refuted = dict.fromkeys(single, self.current) | self._refuted
        # The last of each circle changes places first: what comes earlier keeps the document's order.
        for swapped in (*([pair] for pairs in ranked for pair in pairs), [pairs[-1] for pairs in ranked]):
            if (other := self._swapped(swapped)) not in self._seen:
                self._seen.add(other)
                self._left.append(other)
        if self._left and self._budget:
            self._budget -= 1
            self.current = self._left.pop()
        else:
            self._stage = "last"
            hopeless = (order for (one, two), order in self._refuted.items() if (two, one) in self._refuted)
            self.current = next(hopeless, self._nearest)
        return True

    @property
    def turns(self) -> frozenset[tuple[str, Point]]:
        """Each speech with the end of the one before it, for which it waits."""
        return frozenset((later, Point(earlier, "end")) for earlier, later in pairwise(self.current))

    def _pairs(self, circle: Circle, net: PetriNet) -> list[tuple[str, str]]:
        """Speeches that follow one another in a circle by the current order alone; the first said comes first."""
        place = {id: number for number, id in enumerate(self.current)}
        found = set()
        for tie, _ in circle:
            if tie.kind == "series" and tie.behavior in place:
                before = {point.behavior for point in net.transitions[tie.source].points} & place.keys()
                found |= {(id, tie.behavior) for id in before if place[id] < place[tie.behavior]}
        return sorted(found, key=lambda pair: place[pair[0]])

    def _swapped(self, pairs: Iterable[tuple[str, str]]) -> tuple[str, ...]:
        """The current order with the later of each pair right before the earlier."""
        order = list(self.current)
        for earlier, later in pairs:
            order.remove(later)
            order.insert(order.index(earlier), later)
        return tuple(order)


def _sorted(speeches: Sequence[str], before: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """The speeches in the order given, but each right after those that have to come before it.

    So one of which nothing is said stays behind all that it was behind.
    """
    found: dict[str, None] = {}
    begun = set[str]()
    todo = [*reversed(speeches)]
    while todo:
        id = todo[-1]
        if id in begun:
            found[todo.pop()] = None
        else:
            begun.add(id)
            todo += [each for each in reversed(before[id]) if each not in begun]
    return tuple(found)


def _before(
    speeches: Sequence[str], net: PetriNet, at: Mapping[Point, int], times: Sequence[Seconds]
) -> dict[str, list[str]]:
    """For each speech, those that have to come before it, in order, with every phase as short as can be.

    times: of a schedule. Two that have to come before each other are in no order.
    """
    ties: tuple[Place | Bound, ...] = (*net.places, *net.bounds)
    spare = spare_times(ties, times)
    starts, ends = ({id: at[Point(id, sync)] for id in speeches} for sync in ("start", "end"))
    clock = distances(0, spare)
    spare[0] = []  # From each start, the way through the start of the block is known then.
    before: dict[str, dict[str, None]] = {id: {} for id in speeches}
    for id, start in starts.items():
        found = distances(start, spare)
        for other, end in ends.items():
            distance = min(found.get(end, inf), found.get(0, inf) + clock.get(end, inf))
            if other != id and distance < times[end] - times[start] - EPSILON:
                before[other][id] = None
    return {id: [each for each in before[id] if id not in before[each]] for id in speeches}


def may_speak_at_once(id: str, chains: Mapping[str, Chain], present: Relations) -> bool:
    """True for an utterance that no constraint mentions: the voice decides whether it has to wait."""
    is_speech = id in chains and chains[id].type == "speech"
    return is_speech and all(point.behavior != id for point in present.constrained)
