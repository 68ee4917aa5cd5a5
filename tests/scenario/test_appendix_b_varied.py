"""Appendix B once more, with a slow bus, a body that is early or late, and a robot that speaks sooner or later."""

import pytest

from engage_hri.services.runtime.virtual_time import run_virtual
from engage_hri.services.tangram.collaboration import plans
from tests.bus.faulty import Faults
from tests.scenario.playing import play
from tests.scenario.test_appendix_b import EXPECTED, by_step, played


def test_a_slow_bus_that_delivers_some_messages_twice_gives_the_same_events() -> None:
    record = played(seed=3, faults=Faults(delay=0.02, duplicate=0.05))

    assert by_step(record) == EXPECTED["table"]
    assert {outcome.status for outcome in record.outcomes.values()} == {"done"}


@pytest.mark.parametrize("resolution", ["table", "object"])
def test_a_body_that_is_early_or_late_by_a_tenth_gives_the_same_events(resolution: str) -> None:
    record = played(resolution=resolution, seed=18, noise=0.1)

    assert by_step(record, resolution) == EXPECTED[resolution]


@pytest.mark.parametrize("settle", [0.8, 1.8, 2.4])
def test_how_soon_the_robot_speaks_after_a_placement_changes_no_event(
    settle: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """1.8 and 2.4 start a turn while the eyes are on the hand: the look that ends it must not fall back there."""
    monkeypatch.setattr(plans, "SETTLE", settle)

    assert by_step(run_virtual(play())) == EXPECTED["table"]
