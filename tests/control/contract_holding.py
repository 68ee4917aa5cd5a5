"""The contract of bodies, held behaviors: they wait at the next place where they can, and then go on."""

import asyncio
from itertools import pairwise
from math import inf
from random import Random

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Gesture, Mark, Pointing, Speech, Wait
from engage_hri.schemas.references import type_name
from engage_hri.services.control.body import Arrived, Body, Reached, Spoke
from tests.control.motions import recorded, violations
from tests.control.suite import HOLDS, Stage, Suite, default, performed, times

ENOUGH = 10.0
"""Seconds in which any behavior comes to its next hold point, or to its end."""


class HoldingContract(Suite):
    """Part of `BodyContract`."""

    def moving(self, body: Body) -> list[BlockBehavior]:
        """Behaviors that can wait on their way; those of an arm with the right one."""
        return [
            replace(each, mode="RIGHT_HAND") if isinstance(each, Pointing | Gesture) else each
            for each in self.able(body)
            if type_name(each) in HOLDS and not isinstance(each, Wait | Speech)
        ]

    async def test_a_held_behavior_waits_at_the_next_hold_point_though_it_might_pass(self, body: Body):
        for behavior in self.moving(body):
            alone = times(await performed(body, behavior))
            stations = ("start", *HOLDS[type_name(behavior)])
            for since, hold in pairwise(stations):
                if alone[since] == alone[hold]:
                    continue  # it stands there for both
                stage, points = Stage(body, behavior, "end"), sync_points(behavior)
                await asyncio.sleep((alone[since] + alone[hold]) / 2 - alone["start"] if since != "start" else 0.0)
                stage.authority.hold()
                await asyncio.sleep(ENOUGH)

                assert stage.waits_at == [hold], behavior.id
                assert not set(stage.passed) & set(points[points.index(hold) :]), behavior.id
                assert not body.state().moving, behavior.id
                stage.authority.go_on()
                await stage.over()
                assert default(stage.passed) == points, behavior.id

    async def test_an_authority_that_comes_meanwhile_counts_once_it_goes_on(self, body: Body):
        for behavior in self.moving(body):
            stage = Stage(body, behavior)
            stage.authority.hold()
            await asyncio.sleep(ENOUGH)
            stage.authority.extend("end")
            await asyncio.sleep(ENOUGH)
            assert stage.waits_at == [HOLDS[type_name(behavior)][0]], behavior.id
            stage.authority.go_on()
            await stage.over()

            assert default(stage.passed) == sync_points(behavior), behavior.id
            assert stage.waits_at == [HOLDS[type_name(behavior)][0]], behavior.id

    async def test_going_on_does_not_give_authority(self, body: Body):
        for behavior in self.moving(body):
            stage, first = Stage(body, behavior), HOLDS[type_name(behavior)][0]
            stage.authority.hold()
            await asyncio.sleep(ENOUGH)
            stage.authority.go_on()
            await asyncio.sleep(ENOUGH)

            assert stage.waits_at == [first], behavior.id
            assert first not in stage.passed, behavior.id
            stage.authority.extend("end")
            await stage.over()

    async def test_a_pace_stays_while_a_behavior_is_held_and_counts_no_further_than_where_it_waits(self, body: Body):
        for behavior in self.moving(body):
            stage, last = Stage(body, behavior, "end"), sync_points(behavior)[-1]
            pace = {last: asyncio.get_running_loop().time() + 60.0}
            stage.authority.set_pace(pace)
            stage.authority.hold()
            assert stage.authority.pace == pace
            await asyncio.sleep(ENOUGH)
            assert stage.waits_at == [HOLDS[type_name(behavior)][0]], behavior.id
            stage.authority.set_pace({})
            stage.authority.go_on()
            await stage.over()

    @pytest.mark.parametrize("seed", range(6))
    async def test_whenever_it_is_held_it_waits_or_ends_by_itself(self, body: Body, seed: int):
        chance = Random(seed)
        for behavior in self.moving(body):
            stage = Stage(body, behavior, "end")
            await asyncio.sleep(chance.uniform(0.0, 2.0))
            stage.authority.hold()
            held_at = asyncio.get_running_loop().time()
            await asyncio.sleep(ENOUGH)
            waited = [each for each in stage.progress if isinstance(each, Arrived)]
            if not stage.task.done():
                points = sync_points(behavior)
                assert len(waited) == 1, behavior.id
                assert not set(stage.passed) & set(points[points.index(waited[0].sync) :]), behavior.id
                assert not body.state().moving, behavior.id
            else:
                # It went home by itself: it had left its last hold point, or could not stop there any more.
                assert not waited
                left = times(stage.progress)[HOLDS[type_name(behavior)][-1]]
                assert left < held_at + 0.5, behavior.id
            stage.authority.go_on()
            await stage.over()
            assert default(stage.passed) == sync_points(behavior), behavior.id

    async def test_a_held_behavior_can_be_aborted_and_taken_over(self, body: Body):
        await body.home()
        for behavior in self.moving(body):
            for how in ("relax", "taken_over"):
                stage = Stage(body, behavior, "end")
                stage.authority.hold()
                await asyncio.sleep(ENOUGH)
                later = stage
                if how == "relax":
                    stage.authority.revoke()
                else:
                    later = Stage(body, behavior, "end")
                await stage.over()
                await later.over()

                assert stage.authority.revoked == how, behavior.id
                assert "end" not in stage.passed, behavior.id
                await asyncio.sleep(ENOUGH)
                assert not body.state().moving, behavior.id

    @pytest.mark.parametrize("seed", range(3))
    async def test_holding_keeps_the_limits_of_the_joints(self, body: Body, seed: int):
        chance = Random(seed)
        async with recorded(body) as recording:
            for behavior in self.moving(body):
                stage = Stage(body, behavior, "end")
                for _ in range(4):
                    await asyncio.sleep(chance.uniform(0.0, 0.4))
                    stage.authority.hold()
                    await asyncio.sleep(chance.choice((0.02, 0.1, 1.0)))
                    stage.authority.go_on()
                await stage.over()

        assert violations(recording, body.capabilities.joints) == []

    @pytest.mark.parametrize("seed", range(6))
    async def test_a_held_voice_is_silent_from_the_next_gap_on(self, body: Body, seed: int):
        if "speech" not in body.capabilities.types:
            pytest.skip("mute by design")
        text = "this is one, and that: another piece. And 那边 也有 一个"
        chance = Random(seed)
        speech = Speech(id="s", text=text, marks=(Mark("m", text.index("that")), Mark("n", text.index("piece") + 2)))
        alone = Stage(body, speech, "end")
        await alone.over()
        took = times(alone.progress)["end"] - times(alone.progress)["start"]

        stage = Stage(body, speech, "end")
        longest = max(len(each.word) for each in alone.progress if isinstance(each, Spoke)) * 0.05 + 0.7
        held = 0.0
        for _ in range(3):
            await asyncio.sleep(chance.uniform(0.0, took / 3))
            if stage.task.done():
                break
            stage.authority.hold()
            since = asyncio.get_running_loop().time()
            await asyncio.sleep(longest)
            said, passed = len(stage.progress), list(stage.passed)
            await asyncio.sleep(5.0)
            held += asyncio.get_running_loop().time() - since
            assert (len(stage.progress), stage.passed) == (said, passed)
            stage.authority.go_on()
        progress = await stage.over()

        assert [each.word for each in progress if isinstance(each, Spoke)] == [
            each.word for each in alone.progress if isinstance(each, Spoke)
        ]
        assert stage.passed == alone.passed
        # Silence adds up; what it says after it was told to hold is no more than the word it is in.
        lasted = times(progress)["end"] - times(progress)["start"]
        assert took + held - 3 * longest <= lasted <= took + held + self.tolerance < inf
        assert all(each.arrived <= each.at for each in progress if isinstance(each, Reached))
