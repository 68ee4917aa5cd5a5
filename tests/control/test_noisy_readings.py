"""What the check of a body makes of encoders that are noisy, or that count in steps."""

import math
from random import Random

import pytest

from engage_hri.schemas.body import JointLimit
from engage_hri.services.control.testing.motions import STEP, Recording, violations

PEAK = 135.0
"""Degrees per second of the motion."""
LIMIT = JointLimit(
    joint="tilt", part="head", low=-1.0, high=1.0, speed=math.radians(150.0), acceleration=math.radians(1500.0)
)


def recording(noise: float = 0.0, step: float = 0.0) -> Recording:
    """Half a second of a joint that swings through 60 degrees, at most at `PEAK`. noise, step: degrees."""
    chance, made = Random(1), Recording(["tilt"])
    turns = 2.0 * PEAK / 60.0  # a cosine of 30 degrees is fastest at 30 degrees times its radians per second
    for number in range(126):
        angle = -30.0 * math.cos(turns * number * STEP) + chance.gauss(0.0, noise)
        angle = round(angle / step) * step if step else angle
        made.times.append(number * STEP)
        made.samples.append([math.radians(angle)])
    return made


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.1, 0.2, 0.3])
def test_the_speed_that_was_seen_is_the_same_however_noisy_the_encoders_are(noise: float) -> None:
    seen = math.degrees(recording(noise).fastest(math.radians(noise))["tilt"])

    assert seen == pytest.approx(PEAK, rel=0.05)


@pytest.mark.parametrize("step", [0.05, 0.1, 0.3])
def test_a_limit_that_only_encoders_seem_to_break_tells_the_noise_that_explains_it(step: float) -> None:
    counting = recording(step=step)
    broken = violations(counting, [LIMIT])

    assert "acceleration" in {each.what for each in broken}
    noise = max(each.explained for each in broken)
    assert violations(counting, [LIMIT], noise=noise * 1.001) == []
    assert violations(counting, [LIMIT], noise=noise * 0.9) != []
    assert math.degrees(noise) < step
