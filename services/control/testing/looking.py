"""Laws of looks: a body looks at where things are now, and says what it looks at when it does."""

import asyncio
import math
from collections.abc import Sequence
from itertools import permutations

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, Pointing
from engage_hri.schemas.units import Meters, Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import Body, Revocation
from engage_hri.services.control.testing.findings import angle, aside, broken, degrees, listed
from engage_hri.services.control.testing.stage import LOOK_EVERY, Stage, default, standing, target_point
from engage_hri.services.control.testing.suite import Suite, by_each, does_not_apply, pose_angles

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

    @by_each(Gaze | GazeShift, "no looks")
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


class TakeoverLaws(Suite):
    """Part of `BodyContract`."""

    topic = "takeovers"

    async def test_a_later_behavior_takes_over_the_part(self, body: Body) -> None:
        """A later behavior gets the part of an earlier one at once: that ends as `taken_over`, and is not done.

        Usually the new one waits for the old one, or the old one goes on to tell its points while the joints go
        elsewhere.
        """
        pairs = [
            (one, other)
            for each in ("gaze", "pointing")
            if each in self.types(body)
            for one, other in self._rivals(body, each)
        ]
        if not pairs:
            what = "it has no two looks or pointings that need the same part"
            self.lacks(body, what, "gaze", "pointing")
        for first, later in pairs:
            for is_waiting in (True, False):
                one = Stage(body, first, "start" if is_waiting else "end")
                if is_waiting:
                    await one.holding()
                    await asyncio.sleep(self.dwell)
                else:
                    await asyncio.sleep(0.1)
                may = list(one.passed)
                if "end" in may:
                    what = "that it is under way until it is taken over"
                    broken(behavior=first, expected=what, measured=one.told)
                other = Stage(body, later, "end")
                await other.over()
                await one.over(1.0)
                self._check_ended(
                    one, may if is_waiting else [each for each in one.passed if each != "end"], "taken_over"
                )
                self._check_ended(other, sync_points(later))

    def _rivals(self, body: Body, kind: str) -> list[tuple[BlockBehavior, BlockBehavior]]:
        """Two behaviors of one type that need the same part; none: the body can't do two."""
        able = []
        for entity in self.world.entities:
            one: BlockBehavior = Gaze(id=f"to {entity.id}", target=entity.id)
            if kind == "pointing":
                one = self.with_one_hand(body, Pointing(id=one.id, target=entity.id))
            if (estimate := body.estimate(one, None, self.world)).feasible:
                able.append((one, set(estimate.parts)))
        pairs = [(one, other) for (one, its), (other, parts) in permutations(able, 2) if its & parts]
        return list(pairs[:1])

    def _check_ended(self, stage: Stage, points: Sequence[str], how: Revocation | None = None) -> None:
        """See what a behavior has passed in the end, and how it was revoked. Raises LawBroken."""
        if (default(stage.passed), stage.authority.revoked) != (tuple(points), how):
            ended = f", as {how}" if how else ""
            broken(behavior=stage.behavior, expected=f"{listed(points)}, and an end{ended}", measured=stage.told)

    async def test_a_shift_takes_nothing_from_a_look_that_lies_over_it(self, body: Body) -> None:
        """A shift beneath a look moves nothing and ends at once; when the look ends, it goes home to there.

        Usually the shift is a motion like any other, and takes the head.
        """
        self._needs_looks(body)
        look = Stage(body, Gaze(id="look", target=self._targets(body)[0]), "stroke")
        await look.holding()
        await standing(body)
        await asyncio.sleep(self.dwell)
        before, there = body.state().gaze, self._targets(body)[1]
        shift = Stage(body, GazeShift(id="shift", target=there), "end")
        await shift.over()
        await asyncio.sleep(self.dwell)
        self._check_ended(shift, ("start", "end"))
        if look.task.done():
            broken(behavior=look.behavior, expected="a look that goes on over a shift", measured=look.told)
        after = body.state().gaze
        if before and after and (off := angle(before.axis, after.axis)) > self.accuracy / 5 + self.gaze_slack:
            what = "eyes that stay on what a look is at"
            broken("end", behavior=shift.behavior, expected=what, measured=f"they turn by {degrees(off)}")
        look.authority.extend("end")
        await look.over()
        self.check_passed(look)
        self._check_looks(body, there, look)

    async def test_a_look_that_comes_over_a_shift_on_its_way_goes_home_to_where_that_leads(self, body: Body) -> None:
        """A look takes the head from a shift that is on its way; the shift ends, for it holds from now on.

        Usually the shift ends as taken over, and the look goes back to where the head was before both.
        """
        self._needs_looks(body)
        there, first = self._targets(body)[:2]
        shift = Stage(body, GazeShift(id="shift", target=there), "end")
        await asyncio.sleep(min(0.1, self.half(body, shift.behavior)))
        look = Stage(body, Gaze(id="look", target=first), "end")
        await shift.over()
        await look.over()
        self.check_passed(shift)
        self.check_passed(look)
        self._check_looks(body, there, look)

    async def test_a_shift_on_its_way_is_taken_over_by_another(self, body: Body) -> None:
        """The later one of two shifts has the head, and the earlier one ends as taken over, without its `end`.

        Usually the earlier one waits until the head stands still, wherever that is, and tells its end.
        """
        targets = self._targets(body, "gazeShift")
        if "gazeShift" not in self.types(body) or len(targets) < 2:
            self.lacks(body, "it has no two gazeShifts", "gazeShift")
        one = Stage(body, GazeShift(id="one", target=targets[0]), "end")
        await asyncio.sleep(min(0.1, self.half(body, one.behavior)))
        other = Stage(body, GazeShift(id="other", target=targets[1]), "end")
        await one.over()
        await other.over()
        self._check_ended(one, ("start",), "taken_over")
        self._check_ended(other, ("start", "end"))
        self._check_looks(body, targets[1], other)

    def _needs_looks(self, body: Body) -> None:
        self.needs(body, "gaze, or no gazeShift", "gaze", "gazeShift")
        if len(self._targets(body)) < 2:
            does_not_apply("there are no two things that it can look at")

    def _targets(self, body: Body, kind: str = "gaze") -> list[str]:
        """Ids of the entities that it can look at, that first to which it takes longest from here."""
        times = {}
        for entity in self.world.entities:
            look = (Gaze if kind == "gaze" else GazeShift)(id="any", target=entity.id)
            estimate = body.estimate(look, None, self.world)
            if estimate.feasible:
                times[entity.id] = sum(phase.natural for phase in estimate.phases)
        return sorted(times, key=lambda each: -times[each])

    def _check_looks(self, body: Body, target: str, stage: Stage) -> None:
        self.check_eyes(body, self.position(target), f"{target} in the end", "end", stage.behavior)
