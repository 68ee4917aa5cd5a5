"""Limits of the realizer: what may be set, and what is refused with the name of the field."""

import pytest
from msgspec.structs import fields

from engage_hri.schemas.behaviors import Wait
from engage_hri.services.realizer.config import LATE, LEASE, RealizerConfig
from engage_hri.services.realizer.decide.decisions import LATE_FACTOR, STALL_FACTOR
from engage_hri.services.realizer.report import SKEW
from engage_hri.services.realizer.service import PULSE
from engage_hri.services.realizer.together import planning
from engage_hri.services.requests.ends import RequestRefused
from tests.realizer.stage import block, stage

NAMES = [field.name for field in fields(RealizerConfig)]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", [-0.001, float("nan"), float("inf")])
def test_no_limit_is_negative_or_no_number(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"^{name} must "):
        RealizerConfig(**{name: value})


@pytest.mark.parametrize("name", [each for each in NAMES if each != "stall"])
def test_a_limit_may_be_nothing(name: str) -> None:
    assert getattr(RealizerConfig(**{name: 0.0}), name) == 0.0


@pytest.mark.parametrize(("stall", "is_good"), [(LATE, True), (LATE - 0.01, False)])
def test_nobody_has_stalled_who_is_not_even_late(stall: float, *, is_good: bool) -> None:
    if is_good:
        assert RealizerConfig(stall=stall).stall == stall
    else:
        with pytest.raises(ValueError, match=rf"^stall {stall} s must not be below 0.5 s"):
            RealizerConfig(stall=stall)


@pytest.mark.parametrize(("held_after", "is_good"), [(LEASE - 0.01, True), (LEASE, False)])
def test_a_body_that_hears_nothing_holds_before_it_goes_home(held_after: float, *, is_good: bool) -> None:
    if is_good:
        assert RealizerConfig(held_after=held_after).held_after == held_after
    else:
        with pytest.raises(ValueError, match=r"^held_after 4.0 s must be below 4 s"):
            RealizerConfig(held_after=held_after)


def test_what_is_documented_as_noticed_late_or_stalled_holds_of_the_defaults() -> None:
    """A motor that is up to four times as slow passes; what people notice is told; authority is renewed in time."""
    limits = RealizerConfig()

    for natural in (0.05, 0.5, 2.0, 10.0):
        assert 4 * natural <= natural + limits.stall + STALL_FACTOR * natural
        assert LATE + LATE_FACTOR * natural < limits.stall + STALL_FACTOR * natural
    assert SKEW == 0.1
    assert PULSE * 3 <= LEASE < limits.longest_hold


@pytest.mark.parametrize("behaviors", [3, 4])
async def test_a_block_may_be_as_large_as_is_said_and_no_larger(
    behaviors: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(planning, "MOST_BEHAVIORS", 3)
    large = block([Wait(id=f"w{number}", duration=1.0) for number in range(behaviors)])
    async with stage() as seen:
        if behaviors == 3:
            assert (await seen.perform(large)).status == "done"
        else:
            with pytest.raises(RequestRefused, match=r"4 behaviors; a block has 3 at most.*cut it into several"):
                await seen.perform(large)
