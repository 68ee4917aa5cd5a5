"""Laws of looks: a body looks at where things are now, and says what it looks at when it does."""

import asyncio
import math

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift
from engage_hri.schemas.units import Meters, Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.testing.laws import angle, aside, broken, degrees
from engage_hri.services.control.testing.stage import LOOK_EVERY, Stage, standing, target_point
from engage_hri.services.control.testing.suite import Suite, by_each, pose_angles

MOVED: Meters = 0.15
"""Distance by which a target is moved."""
FOLLOWING: Seconds = 1.0
WIDEST: Radians = math.radians(10.0)
"""Angle beside the axis of the eyes beyond which nothing is looked at, whatever cone a body states."""


class LookingLaws(Suite):
    """Part of `BodyContract`."""

    topic = "looks"

    @by_each(Gaze | GazeShift, "no looks")
    async def test_looks_at_where_its_target_is_now(self, body: Body, behavior: BlockBehavior) -> None:
        """A look at what has moved is where that is now. One that waits follows its target, or its eyes stay.

        Usually `see` is taken note of once, or the place of a target is kept from an earlier look.
        """
        assert isinstance(behavior, Gaze | GazeShift)
        if (moved := self._moved(body, behavior)) is None:
            return
        try:
            body.see(moved)
            wanted, joints = body.estimate(behavior, None, moved).pose_after, self.joints(body, behavior)
            stage = Stage(body, behavior, "start" if isinstance(behavior, Gaze) else "end")
            await stage.holding()
            await standing(body)
            sync, seen = target_point(behavior), await self.pose(body)
            self.check_pose(seen, pose_angles(wanted), joints, sync, what="where its target is now")
            self.check_eyes(body, self.position(behavior.target, moved), "where its target is now")
            if not stage.task.done():
                await self._check_following(body, behavior)
                stage.authority.extend("end")
            await stage.over()
        finally:
            body.see(self.world)

    async def _check_following(self, body: Body, behavior: Gaze | GazeShift) -> None:
        """Put the target back under the eyes of a look that waits."""
        before = self.observed(body).gaze
        body.see(self.world)
        await asyncio.sleep(FOLLOWING)
        await standing(body)
        after = self.observed(body).gaze
        if before is None or after is None:
            return
        if angle(before.axis, after.axis) <= self.near:
            self.note("a look that waits does not follow what it looks at: its eyes stay where that was")
        else:
            self.check_eyes(body, self.position(behavior.target), "where its target is now")

    def _moved(self, body: Body, behavior: Gaze | GazeShift) -> World | None:
        """The world with the target of a look elsewhere; None: there is nowhere that it can look at then."""
        x, y, z = self.position(behavior.target)
        side = -MOVED if y > 0 else MOVED
        for place in ((x, y + side, z), (x, y - side, z), (x, y, z + MOVED)):
            moved = self.world_with(behavior.target, place)
            if body.estimate(behavior, None, moved).feasible:
                return moved
        return None

    @by_each(lambda each: isinstance(each, Gaze | GazeShift), "no looks")
    async def test_says_what_it_looks_at(self, body: Body, behavior: BlockBehavior) -> None:
        """`looking_at` is the target once the eyes are on it, and never anything that the eyes are not on.

        Usually it is the target from the first instant on, or for as long as the behavior goes on. People are told by
        it what the robot looks at.
        """
        stage = Stage(body, behavior, "start" if isinstance(behavior, Gaze) else "end")
        while not stage.task.done() and not stage.waits_at:
            await asyncio.sleep(LOOK_EVERY)
            self._check_told(body)
            if asyncio.get_running_loop().time() > stage.began + 30.0:
                break
        await standing(body)
        if (told := body.state().looking_at) != (target := getattr(behavior, "target", "")):
            broken(target_point(behavior), expected=f"`looking_at` {target!r}", measured=repr(told))
        stage.authority.extend("end")
        while not stage.task.done() and asyncio.get_running_loop().time() < stage.began + 60.0:
            await asyncio.sleep(LOOK_EVERY)
            self._check_told(body)
        await stage.over()

    def _check_told(self, body: Body) -> None:
        state = body.state()
        near = min(body.capabilities.gaze_half_angle, WIDEST) + self.near
        if not state.looking_at or state.gaze is None:
            return
        entity = self.world.entity(state.looking_at)
        if entity is None or (off := aside(state.gaze, entity.position)) > near:
            beside = "the world has no such thing" if entity is None else f"{degrees(off)} beside it"
            what = f"eyes on what `looking_at` says, {state.looking_at!r}, within {degrees(near)}"
            broken(expected=what, measured=beside)
