"""Each fault of the body switched on in the middle of a running block, and off again: the block ends by that name or
late, the arms are home, and the next block is as if nothing had been."""

import asyncio

import pytest

from engage_hri.schemas.behaviors import Gaze, Mark, Pointing, Speech
from engage_hri.schemas.body_faults import KINDS, BodyFault
from engage_hri.services.control.config import Variability
from tests.random_cases import share_of
from tests.realizer.stage import block, together
from tests.realizer.test_simulated_body import Robot, robot

BEHAVIORS = (
    Gaze(id="g", target="a"),
    Pointing(id="p", target="a", mode="LEFT_HAND"),
    Speech(id="s", text="please put this piece over there", marks=(Mark("m", 11),)),
)
TIES = (together("p:stroke", "s:m"), together("g:stroke", "p:stroke_start"))
ARM, HEAD = {"part": "left_arm"}, {"part": "head"}
SWITCHED: dict[str, tuple[list[BodyFault], set[str]]] = {
    "slow": ([BodyFault(kind="slow", amount=4.0, **ARM)], set()),
    "stall": ([BodyFault(kind="stall", **ARM)], set()),
    "stall of the head": ([BodyFault(kind="stall", before="end", **HEAD)], set()),
    "overheated": ([BodyFault(kind="overheated", **ARM)], {"p"}),
    "noise": ([BodyFault(kind="noise", amount=0.4)], set()),
    "displaced": ([BodyFault(kind="displaced", part="right_elbow", amount=80.0)], set()),
    "mute": ([BodyFault(kind="mute")], set()),
    "voiceless": ([BodyFault(kind="voiceless")], {"s"}),
    "lost": ([BodyFault(kind="lost", amount=1.0)], {"g", "p", "s"}),
    "miscalibrated": ([BodyFault(kind="miscalibrated", **ARM)], set()),
}
"""The faults of each case, and the behaviors that cannot be done with them."""


async def times(seen: Robot, name: str) -> dict[str, float]:
    """Where the points of a block are, from its start, on a healthy body."""
    seen.feedback.clear()
    outcome = await seen.perform(block(BEHAVIORS, *TIES, id=name))
    assert outcome is not None
    assert outcome.status == "done"
    assert outcome.dropped == ()
    return {point: each.time for point, each in seen.times().items()}


@pytest.mark.parametrize("case", SWITCHED)
@pytest.mark.parametrize("on", [0.5, 0.15, 1.2][: share_of(3, 3)])
async def test_a_fault_that_comes_in_the_middle_and_goes(case: str, on: float) -> None:
    faults, undone = SWITCHED[case]
    async with robot(Variability()) as seen:
        healthy = await times(seen, "before")
        await asyncio.sleep(3.0)
        seen.feedback.clear()
        asking = seen.ask(block(BEHAVIORS, *TIES, id="with"))
        await asyncio.sleep(on)
        seen.body.switch_faults(faults)
        await asyncio.sleep(1.0)
        seen.body.switch_faults([])
        outcome = await asyncio.wait_for(asking.outcome, 60.0)
        await asyncio.sleep(3.0)

        assert [end.block for end in seen.ends()] == ["with"]
        assert set(outcome.dropped) <= undone
        assert outcome.status == "done" or undone
        assert not seen.body.state().moving
        assert seen.away_from_home() == {}
        assert await times(seen, "after") == pytest.approx(healthy, abs=1e-4)


def test_every_kind_is_tried() -> None:
    assert {case.split()[0] for case in SWITCHED} == set(KINDS)
