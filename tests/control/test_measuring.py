"""Measuring a body that gets stuck: it ends, and says why."""

import asyncio

import pytest

from engage_hri.schemas.body_faults import BodyFault
from engage_hri.services.control.calibrating import SimulatedEyes, marks, measured
from engage_hri.services.control.contract.body import BodyFailed
from engage_hri.services.control.torso.body import SimulatedBody


async def test_a_part_that_is_stuck_for_good_is_measured_no_further_and_says_so() -> None:
    told: list[str] = []
    body = SimulatedBody()
    body.switch_faults([BodyFault(kind="stall", part="right_arm", before="stroke")])
    found = await measured(body, marks((0.5,), ()), ("right_arm", "head"), SimulatedEyes(body, 0.0), told.append)

    assert {each.part for each in found} == {"head"}
    (line,) = told
    assert line.startswith("right_arm at mark-1: nothing has come of it for ")
    assert line.endswith("; the right_arm is measured no further")


async def test_a_body_that_never_comes_home_fails_by_that() -> None:
    class Away(SimulatedBody):
        async def home(self, parts: tuple[str, ...] = ()) -> None:
            await asyncio.Event().wait()

    with pytest.raises(BodyFailed, match="not in its safe pose 60 s after"):
        await measured(body := Away(), marks(), ("head",), SimulatedEyes(body, 0.0), pytest.fail)
