from math import inf
from random import Random

import pytest

from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.zenoh.clocks import DRIFT, KEPT, REFRESH, Clocks
from tests.random_cases import share_of


def test_the_own_clock_needs_no_estimate():
    clocks = Clocks("own", lambda: 0.0)

    assert clocks.local(Stamp("own", 7.0)) == 7.0
    assert clocks.error("own") == 0.0


def test_a_clock_never_heard_of_reads_as_now():
    assert Clocks("own", lambda: 42.0).local(Stamp("strange", 7.0)) == 42.0


def test_until_measured_the_quickest_message_bounds_the_offset():
    clocks = Clocks("own", lambda: 0.0)

    for sent, arrived in ((100.0, 5.3), (101.0, 6.1), (102.0, 7.2)):
        clocks.heard("other", sent, arrived)

    assert clocks.local(Stamp("other", 110.0)) == pytest.approx(15.1)
    assert clocks.error("other") == inf
    assert clocks.offsets == ()


def test_the_offset_is_where_round_trips_overlap():
    clocks = Clocks("own", lambda: 3.6)
    clocks.heard("other", 1000.0, 0.5)

    clocks.measured("other", asked=1.0, remote=1001.2, answered=1.4)  # -1000.2 .. -999.8
    assert clocks.local(Stamp("other", 1001.2)) == pytest.approx(1.2)
    clocks.measured("other", asked=3.0, remote=1002.9, answered=3.6)  # -999.9 .. -999.3
    assert clocks.local(Stamp("other", 1001.0)) == pytest.approx(1.15, abs=3 * DRIFT)
    assert clocks.error("other") == pytest.approx(0.05, abs=3 * DRIFT)
    (told,) = clocks.offsets
    assert (told.clock, told.error) == ("other", clocks.error("other"))
    assert (told.offset, told.trip) == pytest.approx((-999.85, 0.4), abs=3 * DRIFT)


def test_an_error_grows_until_the_clock_is_measured_again():
    now = 10.1
    clocks = Clocks("own", lambda: now)
    clocks.measured("other", 10.0, 0.05, 10.1)
    errors = []
    for now in (10.1, 110.1, 1010.1):  # noqa: B007 - the clock reads it
        errors.append(clocks.error("other"))

    assert errors == pytest.approx([0.05, 0.05 + 100 * DRIFT, 0.05 + 1000 * DRIFT])


def test_a_machine_that_has_slept_is_measured_anew():
    clocks = Clocks("own", lambda: 60.0)
    for at in (10.0, 20.0):
        clocks.measured("other", at, at + 0.001, at + 0.002)
    clocks.measured("other", 60.0, 30.001, 60.002)  # its clock stood still for 30 s

    assert clocks.local(Stamp("other", 31.0)) == pytest.approx(61.0, abs=0.001)
    assert clocks.error("other") == pytest.approx(0.001)


@pytest.mark.parametrize("clock", ["own", ""])
def test_the_own_clock_and_none_are_never_measured(clock: str):
    clocks = Clocks("own", lambda: 0.0)
    clocks.heard(clock, 0.0, 1e9)
    clocks.measured(clock, 0.0, 5.0, 1.0)
    assert clocks.offsets == ()


@pytest.mark.parametrize("seed", range(share_of(40)))
def test_no_instant_is_further_off_than_is_told(seed: int):
    """Two clocks that go as they like within 50 ppm, and paths as slow, shaky and lopsided as chance makes them."""
    chance = Random(seed)
    offset = chance.uniform(-1e6, 1e6)
    rates = [1 + chance.uniform(-50e-6, 50e-6) for _ in range(2)]
    there, back = (chance.choice((0.0, 0.0002, 0.002, 0.05)) for _ in range(2))
    jitter = chance.choice((0.0, 0.0005, 0.03))

    def own(true: float) -> float:
        return true * rates[0]

    def other(true: float) -> float:
        return offset + true * rates[1]

    true = 0.0
    clocks = Clocks("own", lambda: own(true))
    worst = 0.0
    for _ in range(30):
        trips = []
        for _ in range(5):
            asked, remote = true, true + there + chance.random() * jitter
            true = remote + back + chance.random() * jitter
            trips.append(true - asked)
            clocks.measured("other", own(asked), other(remote), own(true))
        until = true + REFRESH
        while true < until:
            happened = true - chance.random()  # what is told of happened up to a second ago
            off = abs(clocks.local(Stamp("other", other(happened))) - own(happened))
            assert off <= clocks.error("other") + DRIFT
            assert clocks.error("other") <= min(trips) / 2 + DRIFT * (REFRESH + 1)
            worst = max(worst, off)
            true += chance.random() * 3
    assert worst > 0.0


def test_clocks_that_come_and_go_are_forgotten():
    clocks = Clocks("here", lambda: 100.0)
    for number in range(2 * KEPT):
        clocks.heard(f"loop-{number}", 50.0, 100.0)

    known = [number for number in range(2 * KEPT) if clocks.local(Stamp(f"loop-{number}", 1.0)) != 100.0]
    assert known == list(range(KEPT, 2 * KEPT))


def test_a_clock_that_was_measured_is_not_forgotten_for_those_that_are_only_heard_of():
    clocks = Clocks("here", lambda: 100.0)
    clocks.measured("robot", 99.0, 50.0, 99.1)
    for number in range(2 * KEPT):
        clocks.heard(f"loop-{number}", 50.0, 100.0)

    assert clocks.local(Stamp("robot", 50.0)) == pytest.approx(99.05)
