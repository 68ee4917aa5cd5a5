"""Nods and shakes against looks, and against heads that stand."""

from collections.abc import Callable

import numpy as np
import pytest

from engage_hri.services.perception.eyes.nodding import GestureChange, Nodding

Angle = Callable[[float], float]
RATE, NOISE = 15, np.radians(0.7)


def gestures(pitch: Angle, yaw: Angle = lambda at: 0.0, seed: int = 0, seconds: float = 6) -> list[GestureChange]:
    chance, nodding, changes = np.random.default_rng(seed), Nodding(), []
    for k in range(round(seconds * RATE)):
        at = k / RATE
        changes += nodding.feed(yaw(at) + chance.normal(0, NOISE), pitch(at) + chance.normal(0, NOISE), at)
    return changes


def swung(wide: float, hertz: float, times: float = 2, begin: float = 2.0) -> Angle:
    """An angle that swings, in degrees to each side."""
    return lambda at: (
        -np.radians(wide) * np.sin(2 * np.pi * hertz * (at - begin)) if begin < at < begin + times / hertz else 0.0
    )


@pytest.mark.parametrize("hertz", [1.3, 1.8, 2.5])
@pytest.mark.parametrize("wide", [6, 9, 12])
def test_two_nods_are_a_nod_from_when_they_began(wide: float, hertz: float):
    began = []
    for seed in range(20):
        told = gestures(swung(wide, hertz), seed=seed)
        assert [(each.gesture, each.began) for each in told] == [("nod", True), ("nod", False)], seed
        began.append(told[0].at)
        assert told[1].at == pytest.approx(2 + 2 / hertz, abs=0.45)
    assert np.median(began) == pytest.approx(2.0, abs=0.15)


def test_a_shake_is_a_shake():
    for seed in range(20):
        told = gestures(lambda at: 0.0, swung(8, 1.8), seed=seed)
        assert [(each.gesture, each.began) for each in told] == [("shake", True), ("shake", False)]


def test_looks_down_and_up_again_are_no_nod():
    def looking(at: float) -> float:
        return -0.4 * sum(
            np.clip((at - t) / 0.3, 0, 1) * (1 if n % 2 == 0 else -1)
            for n, t in enumerate((1, 1.8, 2.6, 3.4, 4.4, 5))
        )

    assert not any(gestures(looking, seed=seed) for seed in range(50))


def test_a_head_that_stands_does_nothing():
    assert not any(gestures(lambda at: 0.0, seed=seed) for seed in range(100))


def test_a_head_that_goes_round_neither_nods_nor_shakes():
    around = gestures(swung(10, 1.5, times=4), lambda at: swung(10, 1.5, times=4)(at - 1 / 6))

    assert around == []


def test_a_nod_of_a_head_that_is_lost_has_ended():
    nodding, pitch = Nodding(), swung(10, 1.8, times=8)
    told = [change for k in range(50) for change in nodding.feed(0.0, pitch(k / RATE), k / RATE)]

    assert [each.began for each in told] == [True]
    [end] = nodding.lose()
    assert not end.began
    assert 2.5 < end.at < 50 / RATE
    assert nodding.lose() == []
