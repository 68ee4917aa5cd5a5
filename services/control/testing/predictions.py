"""Laws of estimates: they come true, within the error that a body states, and asking for them changes nothing."""

import asyncio
from collections.abc import Mapping

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, Head, HeadDirectionShift, Speech, Wait
from engage_hri.schemas.body import Estimate, EstimateItem
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.testing.laws import broken, listed, ms, named
from engage_hri.services.control.testing.motions import recorded
from engage_hri.services.control.testing.stage import Stage, default, done, standing, times
from engage_hri.services.control.testing.suite import Suite, pose_angles

LOOKS = Gaze | GazeShift | HeadDirectionShift


def has_joints(behavior: BlockBehavior) -> bool:
    """True for what is done with joints."""
    return not isinstance(behavior, Speech | Wait)


def has_target(behavior: BlockBehavior) -> bool:
    """True for what brings joints somewhere, and not only through somewhere."""
    return has_joints(behavior) and not isinstance(behavior, Head)


class PredictionLaws(Suite):
    """Part of `BodyContract`."""

    topic = "predictions"

    async def test_takes_the_time_that_it_predicted(self, body: Body) -> None:
        """Time from each sync point to the next is what its estimate said, within the stated `tolerance`.

        Usually the estimate is the time of the command: the joints arrive later, or they are near enough already
        before it is over. Measure by how much, and count that in; or state a larger tolerance.
        """
        for case in self.cases(body):
            async with case as behavior:
                estimate = body.estimate(behavior, None, self.world)
                points = ("start", *default([phase.to for phase in estimate.phases]))
                if points != sync_points(behavior):
                    broken(
                        behavior,
                        expected=f"phases from `start` to `end`: {listed(sync_points(behavior))}",
                        measured=listed(points),
                    )
                realized = times(await done(body, behavior))
                for phase in estimate.phases:
                    took = realized[phase.to] - realized[phase.since]
                    if abs(took - phase.natural) > self.tolerance + 1e-9:
                        broken(
                            behavior,
                            phase.to,
                            expected=f"{ms(phase.natural)} from {phase.since}, within {ms(self.tolerance)}",
                            measured=f"{ms(took)}",
                            advice=_apart(took, phase.natural),
                        )
                    if phase.shortest > phase.natural + 1e-9:
                        broken(
                            behavior,
                            phase.to,
                            expected=f"a shortest time up to the natural {ms(phase.natural)}",
                            measured=ms(phase.shortest),
                        )

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
        self.check_pose(after, before, set(after), able[0], what="where it was before it was asked")
        again = [body.estimate(each, None, self.world) for each in able]
        for behavior, one, other in zip(able, first, again, strict=True):
            for phase, same in zip(one.phases, other.phases, strict=True):
                if abs(phase.natural - same.natural) > 1e-9 + self.tolerance:
                    broken(
                        behavior,
                        phase.to,
                        expected=f"the same answer again, {ms(phase.natural)}",
                        measured=ms(same.natural),
                    )

    async def test_is_on_target_where_it_said(self, body: Body) -> None:
        """Joints on target (from `stroke` to `relax`, of a shift at `end`) are where `pose_after` said.

        Usually `pose_after` is the goal, and the joints are short of it when the point is told: tell it from measured
        angles. What the next reference costs is counted from `pose_after`.
        """
        for case in self.cases(body, has_target, "nothing with a target or a pose"):
            async with case as behavior:
                joints, wanted = self.joints(body, behavior), body.estimate(behavior, None, self.world).pose_after
                if joints and wanted is None:
                    broken(behavior, expected="`pose_after`, the joints on target", measured="None")
                async with recorded(body, joints) as recording:
                    at = times(await done(body, behavior))
                    await asyncio.sleep(0.02)
                # Where a stroke is a motion, the target may be anywhere in it.
                since, until = at.get("stroke", at["end"]), at.get("relax", at["end"])
                there = [recording.at(since + (until - since) * share / 10) for share in range(11)]
                nearest = min(there, key=lambda seen: _distance(seen, pose_angles(wanted)))
                self.check_pose(
                    nearest,
                    pose_angles(wanted),
                    joints,
                    behavior,
                    "stroke" if "stroke" in at else "end",
                    what="where `pose_after` said",
                )

    async def test_ends_where_it_said(self, body: Body) -> None:
        """Joints of its parts are in the end where `pose_end` said, if it says that.

        Usually `pose_end` is the pose of rest, and a shift has changed to where the head goes back.
        """
        for case in self.cases(body, has_joints, "no joints"):
            async with case as behavior:
                estimate, joints = body.estimate(behavior, None, self.world), self.joints(body, behavior)
                await done(body, behavior)
                if not await standing(body):
                    broken(behavior, "end", expected="a body that comes to stand", measured="`moving` stays true")
                self.check_pose(
                    await self.pose(body),
                    pose_angles(estimate.pose_end),
                    joints,
                    behavior,
                    "end",
                    what="where `pose_end` said",
                )

    async def test_predicts_from_where_another_look_leaves_it(self, body: Body) -> None:
        """An estimate from the `pose_after` of another look, or of the same, is what it then takes from there.

        Usually `estimate` ignores its `pose`, and takes the present one: generation asks about several references.
        What its estimates are wrong by anyhow, from home, counts for nothing here.
        """
        for case in self.cases(body, lambda each: isinstance(each, LOOKS), "no looks"):
            async with case as behavior:
                assert isinstance(behavior, LOOKS)
                off = await self._off_from_home(body, behavior)
                for other in self._others(body, behavior):
                    await body.home()
                    there = body.estimate(other, None, self.world).pose_after
                    due = _until_target(body.estimate(behavior, there, self.world), behavior)
                    stage = Stage(body, other, "start" if isinstance(other, Gaze) else "end")
                    await stage.holding()
                    await standing(body)
                    took = await self._took(body, behavior)
                    await stage.over()
                    if min(abs(took - due), abs(took - due - off)) > self.tolerance + 1e-9:
                        broken(
                            behavior,
                            "stroke" if isinstance(behavior, Gaze) else "end",
                            expected=f"{ms(due)} from its start, after {named(other)}",
                            measured=ms(took),
                        )

    async def _off_from_home(self, body: Body, behavior: BlockBehavior) -> Seconds:
        """Time by which a look takes longer than it says, from home to its target."""
        due = _until_target(body.estimate(behavior, None, self.world), behavior)
        took = await self._took(body, behavior)
        return took - due

    async def _took(self, body: Body, behavior: BlockBehavior) -> Seconds:
        realized = times(await done(body, behavior))
        return realized["stroke" if isinstance(behavior, Gaze) else "end"] - realized["start"]

    def _others(self, body: Body, behavior: Gaze | GazeShift | HeadDirectionShift) -> list[BlockBehavior]:
        """The same look, and one at something else if it can: they are what is looked at before."""
        others = [
            replace(behavior, id="other", target=entity.id)
            for entity in self.world.entities
            if entity.id != behavior.target
        ]
        able = [each for each in others if body.estimate(each, None, self.world).feasible]
        return [replace(behavior, id="same"), *able[:1]]


def _until_target(estimate: Estimate, behavior: BlockBehavior) -> Seconds:
    """Time from start to target, as an estimate has it."""
    sync = "stroke" if isinstance(behavior, Gaze) else "end"
    points = [phase.to for phase in estimate.phases]
    return sum(phase.natural for phase in estimate.phases[: points.index(sync) + 1])


def _apart(took: Seconds, said: Seconds) -> str:
    if took > said:
        return f"it comes {ms(took - said)} later than it says: the estimate is to count that in"
    return f"it comes {ms(said - took)} earlier than it says: the estimate is too long by that"


def _distance(one: Mapping[str, Radians], other: Mapping[str, Radians]) -> Radians:
    return max((abs(angle - other[joint]) for joint, angle in one.items() if joint in other), default=0.0)
