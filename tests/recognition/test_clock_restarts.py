"""A reporter whose clock jumps back is understood again after three messages; at once if it jumps by a minute."""

import random

import pytest

from engage_hri.schemas.units import Stamp
from engage_hri.services.recognition.perceive.clocks import IN_A_ROW, LATE, ClockRestarts
from tests.random_cases import share_of


def told(stamps: list[tuple[float, float]]) -> list[float]:
    """Local times of messages that come at a time with a stamp. The bus knows the clock: it is the local one."""
    restarts, times = ClockRestarts(), []
    for now, seconds in stamps:
        restarts.hear("eyes", Stamp("wall", seconds), seconds, now)
        times.append(seconds + restarts.ahead("eyes", "wall"))
    return times


@pytest.mark.parametrize(("jump", "lost"), [(600.0, 0), (70.0, 0), (30.0, 2), (10.0, 2), (5.0, 2), (3.0, 3)])
def test_after_a_jump_back_what_is_told_is_of_now(jump: float, lost: int) -> None:
    times = told([(float(at), at - jump * (at >= 10)) for at in range(2000)])

    assert [at for at, time in enumerate(times) if abs(time - at) > 1e-9] == [*range(10, 10 + lost)]


@pytest.mark.parametrize("seed", range(share_of(100)))
def test_a_jump_back_is_noticed_at_any_rate(seed: int) -> None:
    """Also if fewer messages come than the jump is wide, and each takes a while, and some are late."""
    chance = random.Random(seed)
    jump, between = 10 ** chance.uniform(0.8, 3.0), 10 ** chance.uniform(-1.5, 1.5)
    is_late, way = chance.choice((0.0, 0.2)), chance.choice((0.0, 0.3))
    stamps, at, number = [], 0.0, 0
    while number < 300:
        at, number = at + chance.expovariate(1 / between), number + 1
        late = 2.0 * chance.random() if chance.random() < is_late else 0.0
        stamps.append((at + way * chance.random() + late, at - jump * (number >= 100), number >= 100))
    stamps.sort()
    times = told([(now, seconds) for now, seconds, _ in stamps])
    after = [
        (now, time - (seconds + jump))
        for (now, seconds, has_jumped), time in zip(stamps, times, strict=True)
        if has_jumped
    ]
    wrong = [now for now, error in after if abs(error) > LATE]

    assert len(wrong) <= 2 * IN_A_ROW or wrong[-1] - wrong[0] <= jump + 2 * LATE


@pytest.mark.parametrize("seed", range(share_of(100)))
def test_messages_that_come_in_another_order_are_no_jump(seed: int) -> None:
    """Late by up to 2 s, each by another time."""
    chance = random.Random(seed)
    rate, is_late, late = 10 ** chance.uniform(-1.0, 1.5), chance.random(), chance.choice((1.0, 2.0))
    stamps, at = [], 0.0
    for _ in range(500):
        at += chance.expovariate(rate)
        comes = at + (chance.uniform(late, 2.0) * chance.random() ** late if chance.random() < is_late else 0.0)
        stamps.append((comes + 0.1 * chance.random(), at))
    stamps.sort()

    assert told(stamps) == [seconds for _, seconds in stamps]


@pytest.mark.parametrize("seed", range(share_of(100)))
def test_messages_that_have_waited_for_a_link_are_no_jump(seed: int) -> None:
    """They come at once, or in some time, as a slow link lets them."""
    chance = random.Random(seed)
    rate, share = 10 ** chance.uniform(-1.0, 1.5), chance.choice((0.0, 0.3))
    stamps, at, cut, open, comes = [], 0.0, 0.0, 0.0, 0.0
    for _ in range(500):
        at += chance.expovariate(rate)
        if at > comes + 30.0 and chance.random() < 0.1:
            cut, open = at, at + chance.uniform(0.0, 20.0)
        comes = max(comes, at, open + share * (at - cut))
        stamps.append((comes + 0.1 * chance.random(), at))
    stamps.sort()

    assert told(stamps) == [seconds for _, seconds in stamps]


def test_late_messages_are_late() -> None:
    """Also two in a row."""
    arrivals = sorted((at + (30.5 if at % 10 in (3, 4) else 0.0), float(at)) for at in range(1000))

    assert told(arrivals)[:980] == [seconds for _, seconds in arrivals[:980]]


def test_a_clock_that_is_set_right_again_is_believed_again() -> None:
    times = told([(float(at), at - 600.0 * (10 <= at < 50)) for at in range(2000)])

    assert times == [float(at) for at in range(2000)]


def test_reporters_have_clocks_of_their_own() -> None:
    restarts = ClockRestarts()
    for at in range(20):
        restarts.hear("eyes", Stamp("wall", at - 600.0 * (at >= 10)), at, float(at))
        restarts.hear("ears", Stamp("wall", float(at)), at, float(at))

    assert restarts.ahead("ears", "wall") == 0.0
