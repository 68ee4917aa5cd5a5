"""Instants by name: one for each, the earliest first, equal ones in an order that is known."""

import pytest

from engage_hri.services.requests.deadlines import SLACK, Deadlines


def test_there_is_one_instant_for_each_name_however_often_it_was_set() -> None:
    deadlines: Deadlines[str] = Deadlines()
    for at in range(1000):
        deadlines.set("a", 5000.0 - at)
        deadlines.set("b", 5000.0)
    deadlines.set("c", 4002.0)
    deadlines.set("b", None)

    assert len(deadlines._heap) <= SLACK + 4 * 3
    assert (deadlines.due(4000.0), deadlines.look) == (None, 4001.0)
    assert [deadlines.due(9000.0) for _ in range(3)] == ["a", "c", None]
    assert (deadlines.first, deadlines.earliest) == (None, None)


@pytest.mark.parametrize(
    ("order", "first"), [(None, ["b", "a", "c"]), (str, ["a", "b", "c"]), (ord, ["a", "b", "c"])]
)
def test_equal_instants_come_as_they_were_set_or_by_name(order, first) -> None:  # type: ignore[no-untyped-def]
    deadlines: Deadlines[str] = Deadlines(order)
    for name in "bac":
        deadlines.set(name, 1.0)

    assert [deadlines.due(1.0) for _ in "abc"] == [*first]
