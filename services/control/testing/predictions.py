"""Laws of estimates: they come true, within the error that a body states, and asking for them changes nothing."""

import asyncio

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Head, Speech, Wait
from engage_hri.schemas.body import EstimateItem
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.testing.asked import LOOKS
from engage_hri.services.control.testing.laws import broken, listed, ms, named, turned
from engage_hri.services.control.testing.motions import recorded
from engage_hri.services.control.testing.stage import (
    Stage,
    default,
    done,
    standing,
    target_point,
    times,
    until_target,
)
from engage_hri.services.control.testing.suite import Suite, by_each, pose_angles


def has_joints(behavior: BlockBehavior) -> bool:
    """True for what is done with joints."""
    return not isinstance(behavior, Speech | Wait)


def has_target(behavior: BlockBehavior) -> bool:
    """True for what brings joints somewhere, and not only through somewhere."""
    return has_joints(behavior) and not isinstance(behavior, Head)


class PredictionLaws(Suite):
    """Part of `BodyContract`."""

    topic = "predictions"

    @by_each()
    async def test_takes_the_time_that_it_predicted(self, body: Body, behavior: BlockBehavior) -> None:
        """Time from each sync point to the next is what its estimate said, within the stated `tolerance`.

        Usually the estimate is the time of the command: the joints arrive later, or they are near enough already
        before it is over. Measure by how much, and count that in; or state a larger tolerance.
        """
        estimate = body.estimate(behavior, None, self.world)
        points = ("start", *default([phase.to for phase in estimate.phases]))
        if points != sync_points(behavior):
            broken(expected=f"phases from `start` to `end`: {listed(sync_points(behavior))}", measured=listed(points))
        realized = times(await done(body, behavior))
        for phase in estimate.phases:
            took = realized[phase.to] - realized[phase.since]
            if abs(took - phase.natural) > self.tolerance + 1e-9:
                broken(
                    phase.to,
                    expected=f"{ms(phase.natural)} from {phase.since}, within {ms(self.tolerance)}",
                    measured=f"{ms(took)}",
                    advice=_apart(took, phase.natural),
                )
            if phase.shortest > phase.natural + 1e-9:
                what = f"a shortest time up to the natural {ms(phase.natural)}"
                broken(phase.to, expected=what, measured=ms(phase.shortest))

    async def test_predicts_without_moving(self, body: Body) -> None:
        """Estimates and rehearsals move nothing and change nothing: asked twice, a body says the same.

        Usually `estimate` calls the same planner as `perform`, and that commands the motors or keeps what it planned.
        """
        before = await self.pose(body)
        able = self.able(body)
        first = [body.estimate(each, None, self.world) for each in able]
        items = [EstimateItem(behavior=each) for each in able]
        rehearsed = body.rehearse(items, self.world)
        if len(rehearsed) != len(items):
            broken(expected=f"{len(items)} estimates of a rehearsal", measured=f"{len(rehearsed)}")
        for behavior in able:
            body.estimate(behavior, body.state().pose, self.world)
        if body.state().moving:
            broken(expected="a body that stands after it was asked", measured="`moving` is true")
        await asyncio.sleep(0.5)
        after = await self.pose(body)
        self.check_pose(after, before, set(after), what="where it was before it was asked")
        for behavior, said in zip(able, first, strict=True):
            again = body.estimate(behavior, None, self.world)
            for phase, same in zip(said.phases, again.phases, strict=True):
                if abs(phase.natural - same.natural) > 1e-9 + self.tolerance:
                    what = f"the same answer again, {ms(phase.natural)}"
                    broken(phase.to, behavior=behavior, expected=what, measured=ms(same.natural))

    @by_each(has_target, "nothing with a target or a pose")
    async def test_is_on_target_where_it_said(self, body: Body, behavior: BlockBehavior) -> None:
        """Joints on target (from `stroke` to `relax`, of a shift at `end`) are where `pose_after` said.

        Usually `pose_after` is the goal, and the joints are short of it when the point is told: tell it from measured
        angles. What the next reference costs is counted from `pose_after`.
        """
        joints, wanted = self.joints(body, behavior), body.estimate(behavior, None, self.world).pose_after
        if joints and wanted is None:
            broken(expected="`pose_after`, the joints on target", measured="None")
        async with recorded(body, joints) as recording:
            at = times(await done(body, behavior))
            await asyncio.sleep(0.02)
        # Where a stroke is a motion, the target may be anywhere in it.
        since, until = at.get("stroke", at["end"]), at.get("relax", at["end"])
        there = [recording.at(since + (until - since) * share / 10) for share in range(11)]
        due, sync = pose_angles(wanted), "stroke" if "stroke" in at else "end"
        nearest = min(there, key=lambda seen: turned(seen, due))
        self.check_pose(nearest, due, joints, sync, what="where `pose_after` said")

    @by_each(has_joints, "no joints")
    async def test_ends_where_it_said(self, body: Body, behavior: BlockBehavior) -> None:
        """Joints of its parts are in the end where `pose_end` said, if it says that.

        Usually `pose_end` is the pose of rest, and a shift has changed to where the head goes back.
        """
        estimate, joints = body.estimate(behavior, None, self.world), self.joints(body, behavior)
        await done(body, behavior)
        await self.check_stands(body, "end")
        due = pose_angles(estimate.pose_end)
        self.check_pose(await self.pose(body), due, joints, "end", what="where `pose_end` said")

    @by_each(LOOKS, "no looks")
    async def test_predicts_from_where_another_look_leaves_it(self, body: Body, behavior: BlockBehavior) -> None:
        """An estimate from the `pose_after` of another look, or of the same, is what it then takes from there.

        Usually `estimate` ignores its `pose`, and takes the present one: generation asks about several references.
        What its estimates are wrong by anyhow, from home, counts for nothing here.
        """
        assert isinstance(behavior, LOOKS)
        sync, said = target_point(behavior), body.estimate(behavior, None, self.world)
        off = await self._took(body, behavior, sync) - until_target(said, behavior)
        for other in self.aims(body, behavior):
            await body.home()
            there = body.estimate(other, None, self.world).pose_after
            due = until_target(body.estimate(behavior, there, self.world), behavior)
            stage = Stage(body, other, "start" if isinstance(other, Gaze) else "end")
            await stage.holding()
            await standing(body)
            took = await self._took(body, behavior, sync)
            await stage.over()
            if min(abs(took - due), abs(took - due - off)) > self.tolerance + 1e-9:
                broken(sync, expected=f"{ms(due)} from its start, after {named(other)}", measured=ms(took))

    async def _took(self, body: Body, behavior: BlockBehavior, sync: str) -> Seconds:
        realized = times(await done(body, behavior))
        return realized[sync] - realized["start"]


def _apart(took: Seconds, said: Seconds) -> str:
    if took > said:
        return f"it comes {ms(took - said)} later than it says: the estimate is to count that in"
    return f"it comes {ms(said - took)} earlier than it says: the estimate is too long by that"
