"""Points that are one instant, give or take fixed offsets: a weighted union-find. Thesis 4.4 had limits here.

Synchronizations that share a point merge, whatever their number, direction and sign of offset.
"""

import re
from collections import defaultdict, deque
from collections.abc import Collection

from msgspec import Struct

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.relations import BlockRefused, Equal, Term
from engage_hri.services.realizer.points import EPSILON, ORIGIN, Point

_OFFSET = re.compile(r"\s*[+-]\s*[0-9.]+(e[+-]?[0-9]+)?\s*$", re.IGNORECASE)
"""Offset behind the point that a reference names: `+0.5`."""


class Instant(Struct, frozen=True, gc=False):
    """Points that happen together.

    class_id, offset: its class, and seconds from the first instant of that. at: seconds from the block's start.
    """

    points: tuple[Point, ...]
    class_id: int
    offset: Seconds
    at: Seconds | None = None


Link = tuple[Term, Term]
"""A tie: what is said of the point where it begins, and of the one where it ends."""


class Classes:
    """Classes of points that are tied together, each so many seconds from the others.

    Times of the clock contradict each other as well, but make no class: two behaviors that are both to end at 10 s
    do not wait for each other.
    """

    def __init__(self) -> None:
        self._clock: dict[Point, Seconds] = {}
        """Seconds from the block's start at which a representative is to happen, if given."""
        self._parent: dict[Point, Point] = {}
        self._offset: dict[Point, Seconds] = {}
        """Seconds from a point's parent to the point."""
        self._links: dict[Point, list[tuple[Point, Link]]] = defaultdict(list)

    def add(self, point: Point) -> None:
        """Take in a point, in a class of its own."""
        if point not in self._parent:
            self._parent[point], self._offset[point] = point, 0.0

    def find(self, point: Point) -> tuple[Point, Seconds]:
        """The representative of the point's class, and the seconds from it to the point."""
        path = []
        while self._parent[point] != point:
            path.append(point)
            point = self._parent[point]
        offset = 0.0
        for each in reversed(path):
            offset += self._offset[each]
            self._parent[each], self._offset[each] = point, offset
        return point, offset

    def at(self, point: Point) -> Seconds | None:
        """Seconds from the block's start at which the point is to happen; None if not given."""
        if point == ORIGIN:
            return 0.0
        root, offset = self.find(point)
        clock = self._clock.get(root)
        return None if clock is None else clock + offset

    def offset_between(self, one: Point, other: Point) -> Seconds | None:
        """Seconds from `one` to `other`; None if nothing ties them."""
        (root, start), (other_root, end) = self.find(one), self.find(other)
        if root == other_root:
            return end - start
        since, to = self.at(one), self.at(other)
        return None if since is None or to is None else to - since

    def tie(self, equal: Equal, block: str) -> None:
        """Merge the classes of these points. Raises BlockRefused, with points and lines, at a contradiction."""
        first, *others = sorted(equal.terms, key=lambda term: term.point == ORIGIN)
        for term in others:
            self.add(first.point)
            self.add(term.point)
            apart = first.offset - term.offset  # first + first.offset = term + term.offset
            known = self.offset_between(first.point, term.point)
            if known is not None and abs(known - apart) > EPSILON:
                raise self._contradiction(first, term, known, block)
            self._links[first.point].append((term.point, (first, term)))
            self._links[term.point].append((first.point, (term, first)))
            self._merge(first.point, term.point, apart)

    def _merge(self, one: Point, other: Point, apart: Seconds) -> None:
        root, start = self.find(one)
        if other == ORIGIN:
            self._clock[root] = -apart - start
            return
        joined, end = self.find(other)
        if joined == root:
            return
        self._parent[joined], self._offset[joined] = root, start + apart - end
        if (clock := self._clock.pop(joined, None)) is not None:
            self._clock[root] = clock - self._offset[joined]

    def tie_if_possible(self, equal: Equal) -> bool:
        """Merge the classes of these points; False if that contradicts what is known."""
        try:
            self.tie(equal, "")
        except BlockRefused:
            return False
        return True

    def lines(self, one: Point, other: Point) -> set[int]:
        """Lines that tie the two points; empty if nothing does."""
        return {term.line for _, term in self._chain(one, other)} - {0}

    def _contradiction(self, first: Term, second: Term, known: Seconds, block: str) -> BlockRefused:
        chain = self._chain(first.point, second.point)
        lines = sorted({term.line for term in (first, second, *(term for _, term in chain))} - {0})
        sooner, later = map(_named, (first, second) if known >= 0 else (second, first))
        apart = f"{abs(round(known, 6)):g} s after {sooner}" if known else f"the same instant as {sooner}"
        said = ", ".join(f"{one.text} = {other.text}" for one, other in chain)
        why = f"{later} is already {apart} ({said})" if chain else "they are one sync point, with two offsets"
        reason = f"{first.text!r} and {second.text!r} cannot be one instant: {why}"
        advice = "leave one of them out" + (f"; see lines {', '.join(map(str, lines))}" if len(lines) > 1 else "")
        fault = Fault(reason=reason, where=block, line=max(lines, default=0), advice=advice)
        return BlockRefused(fault, "IMPOSSIBLE_TO_SCHEDULE")

    def _chain(self, start: Point, end: Point) -> "list[Link]":
        """The ties that lead from one point to another."""
        came: dict[Point, tuple[Point, Link] | None] = {start: None}
        queue = deque([start])
        while queue and end not in came:
            here = queue.popleft()
            for there, link in self._links[here]:
                if there not in came:
                    came[there] = (here, link)
                    queue.append(there)
        chain = []
        while (step := came.get(end)) is not None:
            chain.append(step[1])
            end = step[0]
        return chain[::-1]


def _named(term: Term) -> str:
    """Name of the point as the block spells it: what is written, without the offset."""
    return str(ORIGIN) if term.point == ORIGIN else _OFFSET.sub("", term.text)


def instants(classes: Classes, points: Collection[Point]) -> list[Instant]:
    """`points` (in a canonical order) grouped into instants: classes by their first point, each by offset."""
    members: dict[Point, list[tuple[Seconds, int, Point]]] = {}
    for number, point in enumerate(points):
        classes.add(point)
        root, offset = classes.find(point)
        members.setdefault(root, []).append((offset, number, point))
    found: list[Instant] = []
    for class_id, group in enumerate(members.values()):
        if len(group) == 1:
            alone = group[0][2]
            found.append(Instant((alone,), class_id, 0.0, classes.at(alone)))
            continue
        group.sort()
        lowest = group[0][0]
        together: list[tuple[Seconds, int, Point]] = []
        for member in group:
            if together and member[0] - together[0][0] > EPSILON:
                found.append(_instant(classes, together, class_id, lowest))
                together = []
            together.append(member)
        found.append(_instant(classes, together, class_id, lowest))
    return found


def _instant(classes: Classes, together: list[tuple[Seconds, int, Point]], class_id: int, lowest: Seconds) -> Instant:
    points = tuple(point for _, _, point in sorted(together, key=lambda member: member[1]))
    return Instant(points, class_id, round(together[0][0] - lowest, 9), classes.at(points[0]))
