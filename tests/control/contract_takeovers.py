"""The contract of bodies, what is taken over: no point that the joints have not passed, whoever has the part next."""

import asyncio

import pytest

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import (
    Gaze,
    GazeShift,
    Pointing,
)
from engage_hri.schemas.references import type_name
from engage_hri.services.control.body import (
    Body,
)
from tests.control.suite import ON_AXIS, Stage, Suite, aside


class TakeoverContract(Suite):
    """Part of `BodyContract`."""

    async def test_a_later_behavior_takes_over_the_part(self, body: Body):
        pairs = (
            (Gaze(id="one", target="near-right"), Gaze(id="other", target="human")),
            (Pointing(id="one", target="near-right", mode="RIGHT_HAND"),
             Pointing(id="other", target="far-left", mode="RIGHT_HAND")),
        )  # fmt: skip
        for first, later in pairs:
            if type_name(first) not in body.capabilities.types:
                continue
            one = Stage(body, first)
            await asyncio.sleep(5.0)
            other = Stage(body, later, "end")
            await other.over()
            await one.over()

            assert one.authority.revoked == "taken_over", first.id
            assert one.passed == list(sync_points(first)[: sync_points(first).index(one.waits_at[0])])
            assert tuple(other.passed) == sync_points(later)
            assert other.authority.revoked is None

    async def test_a_shift_takes_nothing_from_a_look_that_lies_over_it(self, body: Body):
        if not {"gaze", "gazeShift"} <= set(body.capabilities.types):
            pytest.skip("no head")
        look = Stage(body, Gaze(id="look", target="human"), "stroke")
        await asyncio.sleep(5.0)
        before = body.state().gaze
        shift = Stage(body, GazeShift(id="shift", target="near-right"), "end")
        await shift.over()
        await asyncio.sleep(5.0)

        assert shift.passed == ["start", "end"]
        assert body.state().gaze == before
        look.authority.extend("end")
        await look.over()
        assert look.passed[-1] == "end"
        assert aside(body.state().gaze, self.position("near-right")) < ON_AXIS

    async def test_a_look_that_comes_over_a_shift_on_its_way_goes_home_to_where_that_leads(self, body: Body):
        if not {"gaze", "gazeShift"} <= set(body.capabilities.types):
            pytest.skip("no head")
        shift = Stage(body, GazeShift(id="shift", target="near-right"), "end")
        await asyncio.sleep(0.1)
        look = Stage(body, Gaze(id="look", target="human"), "end")
        await shift.over()
        await look.over()

        assert shift.passed == ["start", "end"]
        assert tuple(look.passed) == sync_points(Gaze(id="look", target="human"))
        assert aside(body.state().gaze, self.position("near-right")) < ON_AXIS

    async def test_a_shift_on_its_way_is_taken_over_by_another(self, body: Body):
        if "gazeShift" not in body.capabilities.types:
            pytest.skip("no head")
        one = Stage(body, GazeShift(id="one", target="near-right"), "end")
        await asyncio.sleep(0.1)
        other = Stage(body, GazeShift(id="other", target="far-left"), "end")
        await one.over()
        await other.over()

        assert (one.passed, one.authority.revoked) == (["start"], "taken_over")
        assert (other.passed, other.authority.revoked) == (["start", "end"], None)
        assert aside(body.state().gaze, self.position("far-left")) < ON_AXIS
