"""Times of speeches that are given up where they cannot be kept: words are not lost for the sake of a time."""

from collections.abc import Container, Sequence

from msgspec.structs import replace

from engage_hri.services.realizer.plan.relations import Equal, Order, Relations
from engage_hri.services.realizer.points import Point


class Times:
    """The relations of a block, of which some that place its speeches are given up."""

    def __init__(self, relations: Relations, speeches: Container[str]) -> None:
        """speeches: those whose times may be given up."""
        self._relations = relations
        self._equals: dict[int, Equal | None] = dict(enumerate(relations.equals))
        """By number; None: given up. The numbers of the orders are negative."""
        self._orders: dict[int, Order | None] = {-n: order for n, order in enumerate(relations.orders, 1)}
        self._naming: dict[Point, list[int]] = {}
        """Numbers of the relations that name a point."""
        named = [(n, [term.point for term in each.terms]) for n, each in enumerate(self._relations.equals)]
        named += [(-n, [each.earlier.point, each.later.point]) for n, each in enumerate(self._relations.orders, 1)]
        for number, points in named:
            for point in dict.fromkeys(points):
                if point.behavior in speeches:
                    self._naming.setdefault(point, []).append(number)

    def give_up(
        self, points: Sequence[Point], among: Container[Point], dropped: Container[str]
    ) -> tuple[Point, str] | None:
        """Give up one relation of a speech; returns the point and what the relation said of it: `s:end = 2`.

        It is one of the last point that has any, the speech's own timing before what others say; what a required
        behavior says is never given up. None: there is none left.

        points: of speeches, that cannot all be on time. among: points to which the relation ties it, if there is such
        a one. dropped: behaviors that are gone; what is tied to them is tied through them, and given up last.
        """
        for is_enough in (
            lambda others: any(each in among and each.behavior not in dropped for each in others),
            lambda others: any(each.behavior not in dropped for each in others),
            bool,
        ):
            for point in reversed(points):
                naming = self._naming.get(point, ())
                for number in sorted(naming, key=lambda each: (each < 0, not self._is_own(each, point))):
                    if is_enough(self._others(number, point)):
                        return point, self._without(number, point)
        return None

    def _is_own(self, number: int, point: Point) -> bool:
        equal = self._equals.get(number)
        return equal is not None and equal.behavior == point.behavior

    def _others(self, number: int, point: Point) -> list[Point]:
        """Points to which a relation ties the point; none if it is given up already, or must be kept."""
        if number < 0:
            order = self._orders[number]
            return [] if order is None else [end.point for end in (order.earlier, order.later) if end.point != point]
        equal = self._equals[number]
        if equal is None or equal.behavior in self._relations.required:
            return []
        named = [term.point for term in equal.terms]
        return [each for each in named if each != point] if point in named else []

    def _without(self, number: int, point: Point) -> str:
        """Give up what a relation says of the point; returns what it said."""
        if number < 0:
            order, self._orders[number] = self._orders[number], None
            return f"{order.earlier.text} <= {order.later.text}" if order is not None else ""
        equal = self._equals[number]
        assert equal is not None
        others = tuple([term for term in equal.terms if term.point != point])
        self._equals[number] = Equal(others) if not equal.behavior and len(others) > 1 else None
        return " = ".join([term.text for term in equal.terms])

    @property
    def left(self) -> Relations:
        """The relations that are left."""
        equals = tuple([each for each in self._equals.values() if each is not None])
        orders = tuple([each for each in self._orders.values() if each is not None])
        return replace(self._relations, equals=equals, orders=orders)
