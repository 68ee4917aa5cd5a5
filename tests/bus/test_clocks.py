from math import inf

import pytest

from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.zenoh.clocks import KEPT, REFRESH, Clocks


def test_the_own_clock_needs_no_estimate():
    clocks = Clocks("own", lambda: 0.0)

    assert clocks.local(Stamp("own", 7.0)) == 7.0
    assert clocks.error("own") == 0.0


def test_a_clock_never_heard_of_reads_as_now():
    assert Clocks("own", lambda: 42.0).local(Stamp("strange", 7.0)) == 42.0


def test_until_measured_the_quickest_message_bounds_the_offset():
    clocks = Clocks("own", lambda: 0.0)

    due = [clocks.heard("other", sent, arrived) for sent, arrived in ((100.0, 5.3), (101.0, 6.1), (102.0, 7.2))]

    assert clocks.local(Stamp("other", 110.0)) == pytest.approx(15.1)
    assert clocks.error("other") == inf
    assert due == [True, False, False]


def test_the_quickest_round_trip_wins_and_its_half_is_the_error():
    clocks = Clocks("own", lambda: 0.0)
    clocks.heard("other", 1000.0, 0.5)

    clocks.measured("other", asked=1.0, remote=1001.2, answered=1.4)
    clocks.measured("other", asked=2.0, remote=2001.01 - 1000, answered=2.02)
    clocks.measured("other", asked=3.0, remote=1002.9, answered=3.6)

    assert clocks.local(Stamp("other", 1001.01)) == pytest.approx(2.01)
    assert clocks.error("other") == pytest.approx(0.01)


def test_a_measurement_is_due_again_when_the_clocks_may_have_drifted():
    clocks = Clocks("own", lambda: 0.0)
    clocks.heard("other", 0.0, 10.0)
    clocks.measured("other", 10.0, 0.1, 10.1)

    assert not clocks.heard("other", 20.0, 30.0)
    assert clocks.heard("other", 20.0, 10.1 + REFRESH + 1)
    assert not clocks.heard("other", 20.0, 10.1 + REFRESH + 2)


@pytest.mark.parametrize("clock", ["own", ""])
def test_the_own_clock_and_none_are_never_measured(clock: str):
    assert not Clocks("own", lambda: 0.0).heard(clock, 0.0, 1e9)


def test_clocks_that_come_and_go_are_forgotten():
    clocks = Clocks("here", lambda: 100.0)
    for number in range(2 * KEPT):
        clocks.heard(f"loop-{number}", 50.0, 100.0)

    known = [number for number in range(2 * KEPT) if clocks.local(Stamp(f"loop-{number}", 1.0)) != 100.0]
    assert known == list(range(KEPT, 2 * KEPT))
