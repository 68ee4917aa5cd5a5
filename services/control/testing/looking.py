"""Laws of looks: a body looks at where things are now, and says what it looks at when it does."""

import asyncio
import math

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift
from engage_hri.schemas.units import Meters, Radians, Seconds, Vector
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.testing.laws import broken, degrees
from engage_hri.services.control.testing.rays import angle, aside
from engage_hri.services.control.testing.stage import LOOK_EVERY, Stage, standing
from engage_hri.services.control.testing.suite import Suite, pose_angles

MOVED: Meters = 0.15
"""Distance by which a target is moved."""
FOLLOWING: Seconds = 1.0
WIDEST: Radians = math.radians(10.0)
"""Angle beside the axis of the eyes beyond which nothing is looked at, whatever cone a body states."""


class LookingLaws(Suite):
    """Part of `BodyContract`."""

    topic = "looks"

    async def test_looks_at_where_its_target_is_now(self, body: Body) -> None:
        """A look at what has moved is where that is now. One that waits follows its target, or its eyes stay.

        Usually `see` is taken note of once, or the place of a target is kept from an earlier look.
        """
        try:
            for case in self.cases(body, lambda each: isinstance(each, Gaze | GazeShift), "no looks"):
                async with case as behavior:
                    if (moved := self._moved(body, behavior)) is not None:
                        await self._check_news(body, behavior, moved)
                    body.see(self.world)
        finally:
            body.see(self.world)

    async def _check_news(self, body: Body, behavior: BlockBehavior, moved: World) -> None:
        place, sync = _place(moved, behavior), "stroke" if isinstance(behavior, Gaze) else "end"
        body.see(moved)
        wanted, joints = body.estimate(behavior, None, moved).pose_after, self.joints(body, behavior)
        stage = Stage(body, behavior, "start" if isinstance(behavior, Gaze) else "end")
        await stage.holding()
        await standing(body)
        seen = await self.pose(body)
        self.check_pose(seen, pose_angles(wanted), joints, behavior, sync, what="where its target is now")
        self._check_eyes(body, behavior, place)
        if not stage.task.done():
            await self._check_following(body, behavior)
            stage.authority.extend("end")
        await stage.over()

    async def _check_following(self, body: Body, behavior: BlockBehavior) -> None:
        """Put the target back under the eyes of a look that waits."""
        before = self.observed(body).gaze
        body.see(self.world)
        await asyncio.sleep(FOLLOWING)
        await standing(body)
        after = self.observed(body).gaze
        if before is None or after is None:
            return
        if angle(before.axis, after.axis) <= self.accuracy + self.gaze_slack:
            self.note("a look that waits does not follow what it looks at: its eyes stay where that was")
        else:
            self._check_eyes(body, behavior, _place(self.world, behavior))

    def _check_eyes(self, body: Body, behavior: BlockBehavior, place: Vector) -> None:
        gaze, near = self.observed(body).gaze, self.accuracy + self.gaze_slack
        if gaze is not None and (off := aside(gaze, place)) > near:
            broken(
                behavior,
                expected=f"eyes on where its target is now, within {degrees(near)}",
                measured=f"{degrees(off)} beside it",
            )

    def _moved(self, body: Body, behavior: BlockBehavior) -> World | None:
        """The world with the target of a look elsewhere; None: there is nowhere that it can look at then."""
        x, y, z = _place(self.world, behavior)
        side = -MOVED if y > 0 else MOVED
        for place in ((x, y + side, z), (x, y - side, z), (x, y, z + MOVED)):
            moved = replace(
                self.world,
                entities=tuple(
                    replace(each, position=place) if each.id == getattr(behavior, "target", "") else each
                    for each in self.world.entities
                ),
            )
            if body.estimate(behavior, None, moved).feasible:
                return moved
        return None

    async def test_says_what_it_looks_at(self, body: Body) -> None:
        """`looking_at` is the target once the eyes are on it, and never anything that the eyes are not on.

        Usually it is the target from the first instant on, or for as long as the behavior goes on. People are told by
        it what the robot looks at.
        """
        for case in self.cases(body, lambda each: isinstance(each, Gaze | GazeShift), "no looks"):
            async with case as behavior:
                stage = Stage(body, behavior, "start" if isinstance(behavior, Gaze) else "end")
                while not stage.task.done() and not stage.waits_at:
                    await asyncio.sleep(LOOK_EVERY)
                    self._check_told(body, behavior)
                    if asyncio.get_running_loop().time() > stage.began + 30.0:
                        break
                await standing(body)
                if (told := body.state().looking_at) != (target := getattr(behavior, "target", "")):
                    broken(
                        behavior,
                        "stroke" if isinstance(behavior, Gaze) else "end",
                        expected=f"`looking_at` {target!r}",
                        measured=repr(told),
                    )
                stage.authority.extend("end")
                while not stage.task.done() and asyncio.get_running_loop().time() < stage.began + 60.0:
                    await asyncio.sleep(LOOK_EVERY)
                    self._check_told(body, behavior)
                await stage.over()

    def _check_told(self, body: Body, behavior: BlockBehavior) -> None:
        state = body.state()
        near = min(body.capabilities.gaze_half_angle, WIDEST) + self.accuracy + self.gaze_slack
        if not state.looking_at or state.gaze is None:
            return
        entity = self.world.entity(state.looking_at)
        if entity is None or (off := aside(state.gaze, entity.position)) > near:
            beside = "the world has no such thing" if entity is None else f"{degrees(off)} beside it"
            broken(
                behavior,
                expected=f"eyes on what `looking_at` says, {state.looking_at!r}, within {degrees(near)}",
                measured=beside,
            )


def _place(world: World, behavior: BlockBehavior) -> Vector:
    found = world.entity(getattr(behavior, "target", ""))
    assert found is not None
    return found.position
