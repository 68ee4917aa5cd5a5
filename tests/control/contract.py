"""The contract suite: what every body must do. A driver subclasses `BodyContract` and says how to make its body.

    class TestMyRobot(BodyContract):
        def make(self) -> Body:
            return MyRobot(simulated=True)

Needs `pytest-asyncio`; runs on the virtual clock where the body lives on loop time, else mark the class `real_time`.
"""

import asyncio
from itertools import pairwise

import msgspec
import pytest

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import (
    Locomotion,
    Speech,
    Wait,
)
from engage_hri.schemas.references import type_name
from engage_hri.services.control.body import (
    Arrived,
    BehaviorRefused,
    Body,
    Reached,
    Spoke,
)
from tests.control.contract_holding import HoldingContract
from tests.control.contract_takeovers import TakeoverContract
from tests.control.contract_truth import TruthContract
from tests.control.motions import recorded, violations
from tests.control.suite import HOLDS, ONE_INSTANT, Stage, default, performed, poses_agree, times


class BodyContract(TakeoverContract, HoldingContract, TruthContract):
    """Subclass it, and say in `make` how to make the body. tolerance: stated error of its estimates, seconds."""

    async def test_reports_every_sync_point_once_and_in_order(self, body: Body):
        for behavior in self.able(body):
            estimate = body.estimate(behavior, None, self.world)
            progress = await performed(body, behavior)

            reached = [item for item in progress if isinstance(item, Reached)]
            told = tuple(item.sync for item in reached)
            assert default(told) == sync_points(behavior), behavior.id
            assert told == ("start", *(phase.to for phase in estimate.phases)), behavior.id
            assert all(one.at <= other.at for one, other in pairwise(reached)), behavior.id
            assert all(item.arrived <= item.at for item in reached), behavior.id

    async def test_never_stops_where_it_may_pass(self, body: Body):
        for behavior in self.able(body):
            progress = await performed(body, behavior)

            assert not [item for item in progress if isinstance(item, Arrived)], behavior.id
            assert all(item.at == item.arrived for item in progress if isinstance(item, Reached)), behavior.id

    async def test_waits_at_each_hold_point_until_it_may_pass(self, body: Body):
        for behavior in self.able(body):
            stage = Stage(body, behavior)
            points = sync_points(behavior)
            for hold in self.holds(body, behavior):
                await asyncio.sleep(10.0)
                assert stage.waits_at[-1:] == [hold], behavior.id
                assert not set(stage.passed) & set(points[points.index(hold) :]), behavior.id
                stage.authority.extend(hold)
            progress = await stage.over()

            assert default(stage.passed) == points
            for hold in self.holds(body, behavior):
                left = next(item for item in progress if isinstance(item, Reached) and item.sync == hold)
                arrived = next(item for item in progress if isinstance(item, Arrived) and item.sync == hold)
                assert left.arrived == arrived.at < left.at, behavior.id

    async def test_points_that_are_one_instant_are_reported_as_one(self, body: Body):
        for behavior in self.able(body):
            for through in ("end", "start"):
                stage = Stage(body, behavior, through)
                await asyncio.sleep(5.0)
                stage.authority.extend("end")
                realized = times(await stage.over())

                for points in ONE_INSTANT.get(type_name(behavior), ()):
                    assert len({realized[sync] for sync in points}) == 1, (behavior.id, points)

    async def test_stands_still_while_it_holds(self, body: Body):
        for behavior in self.able(body):
            if type_name(behavior) not in HOLDS:
                continue
            stage = Stage(body, behavior)
            await asyncio.sleep(10.0)
            before = body.state().pose
            await asyncio.sleep(1.0)

            assert body.state().pose == before, behavior.id
            assert not body.state().moving
            stage.authority.extend("end")
            await stage.over()

    async def test_takes_the_time_that_it_predicted(self, body: Body):
        for behavior in self.able(body):
            estimate = body.estimate(behavior, None, self.world)
            realized = times(await performed(body, behavior))

            assert estimate.feasible, estimate.fault
            assert default([phase.to for phase in estimate.phases]) == sync_points(behavior)[1:]
            for phase in estimate.phases:
                took = realized[phase.to] - realized[phase.since]
                assert took == pytest.approx(phase.natural, abs=self.tolerance), (behavior.id, phase.to)
                assert phase.shortest <= phase.natural

    async def test_predicts_without_moving(self, body: Body):
        before = body.state()
        for behavior in self.able(body):
            body.estimate(behavior, before.pose, self.world)

        assert body.state() == before

    async def test_refuses_what_it_cannot_do_before_anything_moves(self, body: Body):
        before = body.state()
        unable = [
            Locomotion(id="walk", target="human"),
            *(msgspec.structs.replace(behavior, target="nothing") for behavior in self.able(body)
              if hasattr(behavior, "target")),
        ]  # fmt: skip
        for behavior in unable:
            with pytest.raises(BehaviorRefused) as refusal:
                await performed(body, behavior)

            assert refusal.value.fault.reason
            assert not body.estimate(behavior, None, self.world).feasible
        assert body.state() == before

    async def test_an_aborted_behavior_ends_safe(self, body: Body):
        await body.home()
        home = body.state().pose
        for behavior in self.able(body):
            if type_name(behavior).endswith("Shift"):
                continue
            for how in ("relax", "freeze"):
                stage = Stage(body, behavior, "end")
                await asyncio.sleep(0.35)
                stage.authority.revoke(how)
                await stage.over()
                await asyncio.sleep(5.0)

                assert "end" not in stage.passed, behavior.id
                assert poses_agree(body.state().pose, home), (behavior.id, how)
                assert not body.state().moving
                assert body.state().speaking == ""

    async def test_an_aborted_hold_ends_safe(self, body: Body):
        await body.home()
        home = body.state().pose
        for behavior in self.able(body):
            if type_name(behavior) in HOLDS:
                stage = Stage(body, behavior)
                await asyncio.sleep(5.0)
                stage.authority.revoke()
                await stage.over()
                await asyncio.sleep(5.0)

                assert poses_agree(body.state().pose, home), behavior.id

    async def test_a_dropped_stream_ends_safe(self, body: Body):
        await body.home()
        home = body.state().pose
        for behavior in self.able(body):
            stage = Stage(body, behavior, "end")
            await asyncio.sleep(0.35)
            stage.task.cancel()
            await asyncio.gather(stage.task, return_exceptions=True)
            await body.home()

            assert poses_agree(body.state().pose, home), behavior.id

    async def test_home_is_reached_from_anything(self, body: Body):
        await body.home()
        home = body.state().pose
        stages = [Stage(body, behavior) for behavior in self.able(body) if not isinstance(behavior, Wait)]
        await asyncio.sleep(0.45)
        await body.home()

        assert poses_agree(body.state().pose, home)
        assert not body.state().moving
        for stage in stages:
            await asyncio.gather(stage.task, return_exceptions=True)

    async def test_speech_tells_its_words_and_stops_at_one(self, body: Body):
        if "speech" not in body.capabilities.types:
            pytest.skip("mute by design")
        words = ["one", "two", "three", "four", "five", "six", "seven"]
        stage = Stage(body, Speech(id="long", text=" ".join(words)), "end")
        await asyncio.sleep(0.8)
        stage.authority.revoke()
        progress = await stage.over()

        said = [item for item in progress if isinstance(item, Spoke)]
        assert 0 < len(said) < 7
        assert [item.word for item in said] == words[: len(said)]
        assert "end" not in stage.passed

    async def test_keeps_its_limits_whatever_comes(self, body: Body):
        async with recorded(body) as recording:
            for behavior in self.able(body):
                stage = Stage(body, behavior)
                await asyncio.sleep(0.3)
                stage.authority.extend("end")
                other = Stage(body, msgspec.structs.replace(behavior, id="other"), "end")
                await asyncio.sleep(0.25)
                other.authority.revoke()
                await asyncio.gather(stage.task, other.task, return_exceptions=True)
            await body.home()

        assert violations(recording, body.capabilities.joints) == []
