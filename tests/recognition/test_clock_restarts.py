"""A reporter whose clock jumps back is understood again after three messages; at once if it jumps by a minute."""

import pytest

from engage_hri.schemas.units import Stamp
from engage_hri.services.recognition.perceive.clock_restarts import IN_A_ROW, ClockRestarts


def told(stamps: list[tuple[float, float]]) -> list[float]:
    """Local times of messages that come at a time with a stamp. The bus knows the clock: it is the local one."""
    restarts, times = ClockRestarts(), []
    for now, seconds in stamps:
        restarts.hear("eyes", Stamp("wall", seconds), seconds, now)
        times.append(seconds + restarts.ahead("eyes", "wall"))
    return times


@pytest.mark.parametrize(("jump", "lost"), [(600.0, 0), (70.0, 0), (30.0, IN_A_ROW - 1), (10.0, IN_A_ROW - 1)])
def test_after_a_jump_back_what_is_told_is_of_now(jump: float, lost: int) -> None:
    times = told([(float(at), at - jump * (at >= 10)) for at in range(100)])

    assert [at for at, time in enumerate(times) if abs(time - at) > 1e-9] == [*range(10, 10 + lost)]


def test_late_messages_are_late() -> None:
    """Also two in a row."""
    arrivals = sorted((at + (30.5 if at % 10 in (3, 4) else 0.0), float(at)) for at in range(1000))

    assert told(arrivals)[:980] == [seconds for _, seconds in arrivals[:980]]


def test_a_clock_that_is_set_right_again_is_believed_again() -> None:
    times = told([(float(at), at - 600.0 * (10 <= at < 50)) for at in range(100)])

    assert times == [float(at) for at in range(100)]


def test_reporters_have_clocks_of_their_own() -> None:
    restarts = ClockRestarts()
    for at in range(20):
        restarts.hear("eyes", Stamp("wall", at - 600.0 * (at >= 10)), at, float(at))
        restarts.hear("ears", Stamp("wall", float(at)), at, float(at))

    assert restarts.ahead("ears", "wall") == 0.0
