"""The measure of growth itself: it finds what is planted, wherever it is, and names the way to it."""

import functools
from collections import OrderedDict, deque
from collections.abc import Callable
from typing import Any

import numpy
import pytest
from msgspec import Struct

from tests.growth.reach import grown, sizes


class Inner:
    __slots__ = ("_hidden", "more")

    def __init__(self) -> None:
        self._hidden: dict[object, object] = {}
        self.more: list[object] = []


class Outer(Struct):
    inner: Inner
    seen: set[object]


class Holder:
    def __init__(self) -> None:
        self.outer = Outer(Inner(), set())
        self.ordered: OrderedDict[object, object] = OrderedDict()
        self.text = ""
        self.raw = bytearray()
        self.array = numpy.zeros(4)
        self.listeners: list[Callable[[], object]] = [self._made([])]
        self.last: deque[object] = deque(maxlen=50)
        self.some: list[object] = [[] for _ in range(10)]
        self.unbounded = functools.cache(lambda each: each)
        self.bounded = functools.lru_cache(1000)(lambda each: each)

    def _made(self, kept: list[object]) -> Callable[[], object]:
        return lambda: kept


def _plant_in_closure(held: Holder) -> None:
    held.listeners[0].__closure__[0].cell_contents.extend(range(100))  # type: ignore[index]


def _cache(cached: Any) -> None:
    for each in range(100):
        cached(f"name {each}")


PLANTED: dict[str, Callable[[Holder], object]] = {
    "held.outer.inner._hidden": lambda held: held.outer.inner._hidden.update(dict.fromkeys(range(100))),
    "held.outer.inner.more": lambda held: held.outer.inner.more.extend(range(100)),
    "held.outer.seen": lambda held: held.outer.seen.update(range(100)),
    "held.ordered": lambda held: held.ordered.update(dict.fromkeys(range(100))),
    "held.text": lambda held: setattr(held, "text", "x" * 5000),
    "held.raw": lambda held: held.raw.extend(bytes(5000)),
    "held.array": lambda held: setattr(held, "array", numpy.zeros(500)),
    "held.listeners[*].<kept>": _plant_in_closure,
    "held.some[*]": lambda held: [each.extend(range(10)) for each in held.some],  # type: ignore[attr-defined]
    "held.unbounded": lambda held: _cache(held.unbounded),
}


@pytest.mark.parametrize("path", PLANTED)
def test_a_leak_is_found_wherever_it_is_and_the_way_to_it_is_named(path: str) -> None:
    held = Holder()
    before = sizes({"held": held})
    PLANTED[path](held)

    assert path in [one.path for one in grown(before, sizes({"held": held}), slack=20)]


@pytest.mark.parametrize("fill", [lambda held: held.last.extend(range(40)), lambda held: _cache(held.bounded)])
def test_what_has_a_bound_of_its_own_is_no_growth_while_it_fills_up(fill: Callable[[Holder], object]) -> None:
    held = Holder()
    before = sizes({"held": held})
    fill(held)

    assert grown(before, sizes({"held": held}), slack=20) == []


def test_growth_of_what_lies_in_a_bounded_container_is_found() -> None:
    held = Holder()
    held.last.extend([[0]] * 50)
    before = sizes({"held": held})
    held.last.extend([list(range(100)) for _ in range(50)])

    assert [one.path for one in grown(before, sizes({"held": held}), slack=20)] == ["held.last[*]"]


def test_a_container_that_passes_its_limit_is_found() -> None:
    held = Holder()
    before = sizes({"held": held}, {"more": 50})
    held.outer.inner.more.extend(range(51))

    found = grown(before, sizes({"held": held}, {"more": 50}), slack=20)
    assert [str(one) for one in found] == ["held.outer.inner.more: 0 -> 51"]
