"""Limits of the realizer: what may be set, and what is refused with the name of the field."""

import pytest
from msgspec.structs import fields

from engage_hri.schemas.behaviors import Wait
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.requests.ends import RequestRefused
from tests.realizer.stage import block, stage

NAMES = [field.name for field in fields(RealizerConfig)]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", [-0.001, float("nan"), float("inf")])
def test_no_limit_is_negative_or_no_number(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"^{name} must "):
        RealizerConfig(**{name: value})


@pytest.mark.parametrize("name", [each for each in NAMES if each not in ("pulse", "lease", "stall", "stall_factor")])
def test_a_limit_may_be_nothing(name: str) -> None:
    assert getattr(RealizerConfig(**{name: 0.0}), name) == 0.0


@pytest.mark.parametrize(
    ("late", "late_factor", "stall", "stall_factor", "is_good"),
    [
        (0.5, 1.0, 0.5, 1.0, True),
        (0.5, 1.0, 0.49, 5.0, False),
        (0.5, 1.0, 3.0, 0.99, False),
        (3.1, 1.0, 3.0, 5.0, False),
        (3.0, 5.1, 3.0, 5.0, False),
        (0.0, 0.0, 0.0, 0.0, True),
    ],
)
def test_nobody_has_stalled_who_is_not_even_late(
    late: float, late_factor: float, stall: float, stall_factor: float, *, is_good: bool
) -> None:
    limits = {"late": late, "late_factor": late_factor, "stall": stall, "stall_factor": stall_factor}
    if is_good:
        assert RealizerConfig(**limits).stall == stall
    else:
        with pytest.raises(ValueError, match="stall and stall_factor must not be below late and late_factor"):
            RealizerConfig(**limits)


@pytest.mark.parametrize(
    ("pulse", "lease", "is_good"), [(1.0, 3.0, True), (1.0, 2.99, False), (0.0, 5.0, False), (0.001, 5.0, True)]
)
def test_movement_authority_outlives_two_pulses_that_are_lost(pulse: float, lease: float, *, is_good: bool) -> None:
    if is_good:
        assert RealizerConfig(pulse=pulse, lease=lease).lease == lease
    else:
        with pytest.raises(ValueError, match=rf"^lease {lease} s must be at least three times pulse {pulse} s"):
            RealizerConfig(pulse=pulse, lease=lease)


def test_what_is_documented_as_noticed_late_or_stalled_holds_of_the_defaults() -> None:
    """A motor that is up to four times as slow passes; what people notice is told; authority is renewed in time."""
    limits = RealizerConfig()

    for natural in (0.05, 0.5, 2.0, 10.0):
        assert 4 * natural <= natural + limits.stall + limits.stall_factor * natural
        assert limits.late + limits.late_factor * natural < limits.stall + limits.stall_factor * natural
    assert limits.skew == 0.1
    assert limits.pulse * 3 <= limits.lease < limits.longest_hold


@pytest.mark.parametrize("behaviors", [3, 4])
async def test_a_block_may_be_as_large_as_is_said_and_no_larger(behaviors: int) -> None:
    large = block([Wait(id=f"w{number}", duration=1.0) for number in range(behaviors)])
    async with stage(config=RealizerConfig(most=3)) as seen:
        if behaviors == 3:
            assert (await seen.perform(large)).status == "done"
        else:
            with pytest.raises(RequestRefused, match=r"4 behaviors.*; at most 3 are planned in time.*realizer\.most"):
                await seen.perform(large)
