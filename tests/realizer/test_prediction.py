"""The earliest schedule of small nets, by hand: who is slower, who hurries, and what is known beforehand."""

from collections.abc import Mapping

import pytest

from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place, Transition
from engage_hri.services.realizer.plan.prediction import Impossible, predict


def net(size: int, places: tuple[Place, ...], bounds: tuple[Bound, ...] = ()) -> PetriNet:
    return PetriNet(tuple(Transition(f"t{number}", ()) for number in range(size)), places, bounds)


def times(made: PetriNet, known: Mapping[int, float] | None = None) -> list[float]:
    return [round(each, 9) for each in predict(made, known=known or {}).times]


def phase(source: int, target: int, natural: float, shortest: float, behavior: str = "a") -> Place:
    return Place("phase", source, target, natural, shortest, behavior)


def slowest(source: int, target: int, natural: float, stretch: float | None, behavior: str = "b") -> Bound:
    """The phase from source to target cannot wait, and can take `stretch` seconds more than natural."""
    return Bound("phase", target, source, -natural, stretch, behavior)


def clock(number: int, at: float) -> Bound:
    return Bound("delay", number, 0, -at)


# -- what is known of other blocks ---------------------------------------------------------------------------------

FOREIGN = net(4, (Place("order", 0, 1), Place("delay", 1, 2, 1.0, 1.0), Place("order", 2, 3)))
"""The start, a point of another block, one of ours a second after it, the end."""


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        ({}, [0.0, 0.0, 1.0, 1.0]),
        ({1: 2.0}, [0.0, 2.0, 3.0, 3.0]),
        ({1: 0.0}, [0.0, 0.0, 1.0, 1.0]),
        ({1: -0.25}, [0.0, -0.25, 0.75, 0.75]),
        ({0: 5.0}, [0.0, 0.0, 1.0, 1.0]),
        ({0: -5.0}, [0.0, 0.0, 1.0, 1.0]),
        ({1: 2.0, 2: 7.0}, [0.0, 2.0, 7.0, 7.0]),
        ({1: 2.0, 2: 1.5}, [0.0, 2.0, 3.0, 3.0]),
    ],
)
def test_what_is_known_of_a_point_moves_what_comes_after_it(known: dict[int, float], expected: list[float]) -> None:
    """One that was before the block has its time; one that is expected comes no earlier than that."""
    assert times(FOREIGN, known) == expected


# -- who gives way -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stretch", "expected"), [(0.0, 1.0), (0.25, 1.25), (0.5, 1.5), (1.0, 2.0), (3.0, 2.0), (None, 2.0)]
)
def test_what_can_be_slower_is_before_anything_hurries(stretch: float | None, expected: float) -> None:
    """Two seconds of one beside one second of another that cannot wait: the first could do it in a second."""
    made = net(2, (phase(0, 1, 2.0, 1.0), phase(0, 1, 1.0, 0.5, "b")), (slowest(0, 1, 1.0, stretch),))

    assert times(made) == [0.0, expected]


def test_each_phase_hurries_in_proportion_to_its_room() -> None:
    made = net(3, (phase(0, 1, 1.0, 0.5), phase(1, 2, 2.0, 1.0)), (clock(2, 2.25),))

    assert times(made) == [0.0, 0.75, 2.25]


def test_a_phase_without_room_keeps_its_time() -> None:
    made = net(3, (phase(0, 1, 1.0, 1.0), phase(1, 2, 2.0, 0.5)), (clock(2, 2.25),))

    assert times(made) == [0.0, 1.0, 2.25]


@pytest.mark.parametrize("excess", [1e-9, 5e-8, 2.3e-7, 9e-7])
def test_two_times_that_miss_each_other_by_a_rounding_are_one(excess: float) -> None:
    """Nothing has room: without somebody giving way it would be tried for ever."""
    made = net(3, (phase(0, 1, 0.25, 0.25), phase(1, 2, 0.75 + excess, 0.75 + excess)), (clock(2, 1.0),))

    assert times(made) == pytest.approx([0.0, 0.25, 1.0], abs=1e-6)


def test_what_cannot_be_is_told_with_every_phase_as_short_and_as_long_as_can_be() -> None:
    made = net(2, (phase(0, 1, 2.0, 1.75), phase(0, 1, 1.0, 0.5, "b")), (slowest(0, 1, 1.0, 0.5),))

    with pytest.raises(Impossible) as impossible:
        times(made)
    (circle,) = impossible.value.circles
    assert sorted(seconds for _, seconds in circle) == [-1.5, 1.75]
    assert "+0.25 s" in str(impossible.value)


def test_two_circles_that_share_no_instant_are_told_together() -> None:
    places = (phase(0, 1, 2.0, 2.0), phase(0, 2, 3.0, 3.0, "b"))
    with pytest.raises(Impossible) as impossible:
        times(net(3, places, (clock(1, 1.0), clock(2, 1.0))))

    assert sorted(sum(seconds for _, seconds in circle) for circle in impossible.value.circles) == [1.0, 2.0]


@pytest.mark.parametrize("is_dispensable", [True, False])
def test_nothing_hurries_for_what_is_dispensable(*, is_dispensable: bool) -> None:
    made = net(2, (phase(0, 1, 2.0, 1.0),), (clock(1, 1.5),))

    if is_dispensable:
        with pytest.raises(Impossible) as impossible:
            predict(made, lambda ties: True)
        assert sorted(seconds for _, seconds in impossible.value.circles[0]) == [-1.5, 2.0]
    else:
        assert list(predict(made, lambda ties: False).times) == [0.0, 1.5]
