"""The contract suite: what every body must do. A driver subclasses `BodyContract` and says how to make its body.

    class TestMyRobot(BodyContract):
        def make(self) -> Body:
            return MyRobot(simulated=True)

Needs `pytest-asyncio`; runs on the virtual clock where the body lives on loop time, else mark the class `real_time`.
"""

import asyncio
from collections.abc import Sequence
from itertools import pairwise

import msgspec
import pytest

from engage_hri.schemas.behavior_types import TYPES, sync_points
from engage_hri.schemas.behaviors import (
    BlockBehavior,
    FaceLexeme,
    Gaze,
    GazeShift,
    Gesture,
    Head,
    Locomotion,
    Mark,
    Pointing,
    Posture,
    PostureShift,
    Speech,
    Wait,
)
from engage_hri.schemas.references import type_name
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.body import (
    Arrived,
    BehaviorRefused,
    Body,
    MovementAuthority,
    Progress,
    Reached,
    Spoke,
)
from tests.control.motions import recorded, violations

WORLD = World(
    entities=(
        Entity(id="human", kind="person", position=(1.3, 0.0, 1.2)),
        Entity(id="near-right", kind="object", position=(0.45, -0.25, 0.73), radius=0.03),
        Entity(id="far-left", kind="object", position=(0.70, 0.30, 0.73), radius=0.03),
    )
)
BEHAVIORS: tuple[BlockBehavior, ...] = (
    Gaze(id="gaze", target="near-right"),
    GazeShift(id="gazeShift", target="far-left"),
    Pointing(id="pointing", target="far-left"),
    Gesture(id="gesture", lexeme="BEAT"),
    Head(id="head", lexeme="NOD"),
    Head(id="nods", lexeme="NOD", repetition=3),
    FaceLexeme(id="faceLexeme", lexeme="SMILE"),
    Posture(id="posture", lexeme="LEAN_FORWARD"),
    PostureShift(id="postureShift", lexeme="TURN_LEFT"),
    Speech(id="speech", text="This piece, please.", marks=(Mark("m", 5),)),
    Wait(id="wait", duration=0.5),
)
HOLDS = {name: row.holds for name, row in TYPES.items() if row.holds}
"""Where each type can wait, as the realizer knows it."""
ONE_INSTANT = {name: row.one_instant for name, row in TYPES.items() if row.one_instant}
"""Points of a type that always coincide, as the realizer knows it."""
PATIENCE = 30.0


def default(points: Sequence[str]) -> tuple[str, ...]:
    """Without `stroke:2` and on, which a body may tell of or not."""
    return tuple(sync for sync in points if not sync.startswith("stroke:"))


def times(progress: Sequence[Progress]) -> dict[str, float]:
    """When each sync point was passed."""
    return {item.sync: item.at for item in progress if isinstance(item, Reached)}


async def performed(body: Body, behavior: BlockBehavior, through: str = "end") -> list[Progress]:
    authority = MovementAuthority(behavior, through)
    return [progress async for progress in body.perform(behavior, authority)]


class Stage:
    """A behavior under way, with the authority in the test's hand."""

    def __init__(self, body: Body, behavior: BlockBehavior, through: str = "start") -> None:
        self.authority = MovementAuthority(behavior, through)
        self.progress: list[Progress] = []
        self._body, self._behavior = body, behavior
        self.task = asyncio.create_task(self._perform(), name=f"stage {behavior.id}")

    async def _perform(self) -> None:
        async for progress in self._body.perform(self._behavior, self.authority):
            self.progress.append(progress)

    @property
    def passed(self) -> list[str]:
        return [item.sync for item in self.progress if isinstance(item, Reached)]

    @property
    def waits_at(self) -> list[str]:
        return [item.sync for item in self.progress if isinstance(item, Arrived)]

    async def over(self) -> list[Progress]:
        await asyncio.wait_for(self.task, PATIENCE)
        return self.progress


class BodyContract:
    """Subclass it. tolerance: the stated error of the body's estimates, seconds per sync point."""

    tolerance = 1e-6
    behaviors: tuple[BlockBehavior, ...] = BEHAVIORS
    world = WORLD

    def make(self) -> Body:
        raise NotImplementedError

    @pytest.fixture
    async def body(self) -> Body:
        body = self.make()
        body.see(self.world)
        return body

    def holds(self, body: Body, behavior: BlockBehavior) -> tuple[str, ...]:
        """Where it can wait; in a speech where the body says so, at marks between two words."""
        if not isinstance(behavior, Speech):
            return HOLDS.get(type_name(behavior), ())
        return tuple(phase.to for phase in body.estimate(behavior, None, self.world).phases if phase.hold)

    def able(self, body: Body) -> list[BlockBehavior]:
        able = [behavior for behavior in self.behaviors if type_name(behavior) in body.capabilities.types]
        assert able, "a body that can do none of the suite's behaviors"
        return able

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

            takeover = times(other.progress)["start"]
            assert tuple(one.passed) == sync_points(first)
            assert times(one.progress)["end"] == pytest.approx(takeover, abs=0.05)

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


def poses_agree(one: object, other: object) -> bool:
    angles = [{angle.joint: angle.angle for angle in pose.joints} for pose in (one, other)]  # type: ignore[attr-defined]
    return all(abs(angles[0][joint] - angles[1][joint]) < 0.01 for joint in angles[0])
