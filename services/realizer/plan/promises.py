"""Promises of a block: what it says of its points, held against when they come. The one measure of what was kept."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.known import is_foreign
from engage_hri.services.realizer.plan.relations import Equal, Order, Relations, Term, at_line
from engage_hri.services.realizer.points import EPSILON, ORIGIN, Point


class Broken(Struct, frozen=True):
    """Two points that do not come as a block says.

    early, late: the one that comes too early, and the one that comes too late for it. seconds: by which they are off.
    said: what the block says of them. last: the one of the two that came last. line: of the XML that says it; 0: not
    known.
    """

    early: Point
    late: Point
    seconds: Seconds
    said: str
    last: Point
    line: int = 0

    @property
    def point(self) -> Point:
        """The one of the two that is told of: the last, but no point of another block if one of this block is there,
        and not the block itself."""
        points = [point for point in (self.last, self.late, self.early) if point != ORIGIN]
        return next((point for point in points if not is_foreign(point.behavior)), points[0])

    @property
    def direction(self) -> str:
        """The way in which `point` is wrong."""
        return "later" if self.point == self.late else "earlier"

    def told(self, sync: str, verb: str, why: str = "") -> str:
        """The sentence of a warning, with its place.

        sync: the sync point of `point`, as the block spells it. verb: `came`, or `is planned`. why: the cause.
        """
        reason = f"{sync} {verb} {self.seconds:.2f} s {self.direction} than it should be: {self.said}"
        return at_line(self.line, "; ".join(filter(None, (reason, why))))


class _Same:
    """Terms that are one instant, and of those that have come the earliest and the latest."""

    __slots__ = ("ends", "terms")

    def __init__(self, equal: Equal) -> None:
        self.terms = equal.terms
        self.ends: tuple[tuple[Seconds, Point], tuple[Seconds, Point]] | None = None

    def come(self, term: Term, at: Seconds) -> Iterator[Broken]:
        here = (at + term.offset, term.point)
        earliest, latest = self.ends or (here, here)
        self.ends = min(here, earliest), max(here, latest)
        for early, late in ((here, latest), (earliest, here)):
            if late[0] > early[0]:
                said, line = " = ".join([each.text for each in self.terms]), max(each.line for each in self.terms)
                yield Broken(early[1], late[1], late[0] - early[0], said, term.point, line)


class _Ordered:
    """Two terms, of which the one is no earlier than the other."""

    __slots__ = ("_came", "_order")

    def __init__(self, order: Order) -> None:
        self._order = order
        self._came: dict[Term, Seconds] = {}

    def come(self, term: Term, at: Seconds) -> Iterator[Broken]:
        self._came[term] = at + term.offset
        if len(self._came) == 2:
            before, after = self._order.earlier, self._order.later
            if (seconds := self._came[before] - self._came[after]) > 0.0:
                said, line = f"{before.text} <= {after.text}", max(before.line, after.line)
                yield Broken(after.point, before.point, seconds, said, term.point, line)


class _Link(NamedTuple):
    """Something said of a point, and the link to what was said of it before: most points have one, which is small."""

    said: _Same | _Ordered
    term: Term
    before: "_Link | None"


class Promises:
    """Everything that a block says of its points, to be held against when they come, whoever comes wrong."""

    def __init__(self, relations: Relations) -> None:
        self._of: dict[Point, _Link] = {}
        for equal in relations.equals:
            self._take(_Same(equal), equal.terms)
        for order in relations.orders:
            self._take(_Ordered(order), (order.earlier, order.later))

    def _take(self, said: "_Same | _Ordered", terms: tuple[Term, ...]) -> None:
        for term in terms:
            self._of[term.point] = _Link(said, term, self._of.get(term.point))

    @property
    def points(self) -> tuple[Point, ...]:
        """The points of which something is said."""
        return tuple(self._of)

    def come(self, point: Point, at: Seconds) -> list[Broken]:
        """Note that a point comes `at` a time; returns what is broken with those that have come before."""
        links: list[_Link] = []
        link = self._of.get(point)
        while link is not None:
            links.append(link)
            link = link.before
        found = [broken for each in reversed(links) for broken in each.said.come(each.term, at)]
        return [each for each in found if each.early != each.late]


def broken_by(relations: Relations, times: Mapping[Point, Seconds]) -> list[Broken]:
    """Constraints that are broken if their points come at these times."""
    promises = Promises(relations)
    found: list[Broken] = []
    coming = [point for point in promises.points if point in times]
    for point in sorted(coming, key=times.__getitem__):
        found += [each for each in promises.come(point, times[point]) if each.seconds > EPSILON]
    return found
