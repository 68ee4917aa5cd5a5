"""Laws of takeovers: a later behavior gets the part, and the earlier one tells no more points."""

import asyncio

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, Pointing
from engage_hri.schemas.body import Ray
from engage_hri.schemas.references import type_name
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.testing.laws import broken, degrees, listed
from engage_hri.services.control.testing.rays import angle, aside
from engage_hri.services.control.testing.stage import Stage, standing
from engage_hri.services.control.testing.suite import Suite, does_not_apply


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
                may = tuple(one.passed)
                if "end" in may:
                    broken(
                        first,
                        expected="that it is under way until it is taken over",
                        measured=f"passed {listed(may)}",
                    )
                other = Stage(body, later, "end")
                await other.over()
                await one.over(1.0)
                may = may if is_waiting else tuple(one.passed)
                if one.authority.revoked != "taken_over" or tuple(one.passed) != may or "end" in one.passed:
                    broken(
                        first,
                        expected=f"an end as taken over, having passed {listed(may)}",
                        measured=f"revoked: {one.authority.revoked}; passed {listed(one.passed)}",
                    )
                if tuple(other.passed) != sync_points(later) or other.authority.revoked is not None:
                    broken(
                        later,
                        expected="all of its points: the part is its own",
                        measured=f"revoked: {other.authority.revoked}; passed {listed(other.passed)}",
                    )

    def _rivals(self, body: Body, kind: str) -> list[tuple[BlockBehavior, BlockBehavior]]:
        """Two behaviors of one type that need the same part; none: the body can't do two."""
        able = []
        for entity in self.world.entities:
            one: Gaze | Pointing = Gaze(id=f"to {entity.id}", target=entity.id)
            if kind == "pointing":
                one = Pointing(id=f"to {entity.id}", target=entity.id, mode="RIGHT_HAND")
                if not body.estimate(one, None, self.world).feasible:
                    one = replace(one, mode="LEFT_HAND")
            able += [one] * body.estimate(one, None, self.world).feasible
        pairs = [
            (one, other) for one in able for other in able if one is not other and _share(body, self, one, other)
        ]
        return list(pairs[:1])

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
        if shift.passed != ["start", "end"] or look.task.done():
            broken(
                shift.behavior,
                expected="start, end, and a look that goes on",
                measured=f"{listed(shift.passed)}; the look is {look.authority.revoked or 'under way'}",
            )
        self._check_same(before, body.state().gaze, shift.behavior)
        look.authority.extend("end")
        await look.over()
        if look.passed[-1] != "end":
            broken(look.behavior, "end", expected="its end", measured=f"passed {listed(look.passed)}")
        self._check_looks(body, there, look.behavior)

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
        if shift.passed != ["start", "end"]:
            broken(shift.behavior, expected="start, end", measured=listed(shift.passed))
        if tuple(look.passed) != sync_points(look.behavior):
            broken(look.behavior, expected=listed(sync_points(look.behavior)), measured=listed(look.passed))
        self._check_looks(body, there, look.behavior)

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
        for stage, points, how in ((one, ["start"], "taken_over"), (other, ["start", "end"], None)):
            if (stage.passed, stage.authority.revoked) != (points, how):
                broken(
                    stage.behavior,
                    expected=f"{listed(points)}; revoked: {how}",
                    measured=f"{listed(stage.passed)}; revoked: {stage.authority.revoked}",
                )
        self._check_looks(body, targets[1], other.behavior)

    def _needs_looks(self, body: Body) -> None:
        if not {"gaze", "gazeShift"} <= set(self.types(body)):
            self.lacks(body, "it has no gaze, or no gazeShift", "gaze", "gazeShift")
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

    def _check_looks(self, body: Body, target: str, behavior: BlockBehavior) -> None:
        gaze = self.observed(body).gaze
        if gaze is not None and (off := aside(gaze, self.position(target))) > self.accuracy + self.gaze_slack:
            broken(
                behavior,
                "end",
                expected=f"eyes on {target} in the end, within {degrees(self.accuracy + self.gaze_slack)}",
                measured=f"{degrees(off)} beside it",
            )

    def _check_same(self, before: Ray | None, after: Ray | None, behavior: BlockBehavior) -> None:
        if before and after and (off := angle(before.axis, after.axis)) > self.accuracy / 5 + self.gaze_slack:
            broken(
                behavior,
                "end",
                expected="eyes that stay on what the look is at",
                measured=f"they turn by {degrees(off)}",
            )


def _share(body: Body, suite: Suite, one: BlockBehavior, other: BlockBehavior) -> bool:
    """True if two behaviors need the same part."""
    parts = [set(body.estimate(each, None, suite.world).parts) for each in (one, other)]
    return type_name(one) == type_name(other) and bool(parts[0] & parts[1])
