"""Laws of estimates: they come true, within the error that a body states, and asking for them changes nothing."""

import asyncio
import math
from collections.abc import Sequence
from functools import partial

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Head, Looks, Pointing
from engage_hri.schemas.body import BodyPose, Estimate, EstimateItem, Phase, PlannedTime, Ray
from engage_hri.schemas.units import Degrees, Meters, Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import Arrived, Body, BodyState, Progress, Reached
from engage_hri.services.control.testing.findings import (
    angle,
    angles,
    aside,
    broken,
    degrees,
    listed,
    ms,
    named,
    turned,
)
from engage_hri.services.control.testing.motions import recorded
from engage_hri.services.control.testing.stage import (
    PATIENCE,
    Stage,
    default,
    done,
    standing,
    target_point,
    times,
    until_target,
)
from engage_hri.services.control.testing.suite import (
    AIMED,
    Suite,
    by_each,
    does_not_apply,
    has_joints,
    pose_angles,
)
from engage_hri.services.control.testing.truth import arms
from engage_hri.services.runtime.steps import finished
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop


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

    @by_each(Looks, "no looks")
    async def test_predicts_from_where_another_look_leaves_it(self, body: Body, behavior: BlockBehavior) -> None:
        """An estimate from the `pose_after` of another look, or of the same, is what it then takes from there.

        Usually `estimate` ignores its `pose`, and takes the present one: generation asks about several references.
        What its estimates are wrong by anyhow, from home, counts for nothing here.
        """
        assert isinstance(behavior, Looks)
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


ORIGIN = 0.05
"""Metres by which eyes or an elbow may be elsewhere than the ray of an estimate begins."""
WIDEST_CYLINDER, WIDEST_CONE = 0.2, math.radians(20.0)
"""A pointing or a look that is wider tells nobody one thing on a table from the next."""
UNSURE: Meters = 0.15
"""Least distance from its `reach` at which a body is asked to point, or to refuse it."""
UPPER_ARM = 1.5
"""Lengths of a forearm that the way from the elbow may be another than that from the shoulder."""
SAME: Degrees = 2.0
"""Degrees by which a way may be counted otherwise, for each behavior; for each joint its accuracy is added."""
LONGER, SHORTER = 1.4, 0.75
"""A way may be counted along its curve, or between its ends."""
REACTION: Seconds = 0.03
"""Seconds in addition to the tolerance that a body may take to follow a pace."""
FAR: Seconds = 120.0
"""Seconds that are asked for where a phase is said to have no longest time."""
SLOWER: Seconds = 0.5
"""Most seconds that are asked for in addition to the natural time."""


class ClaimLaws(Suite):
    """Part of `BodyContract`."""

    topic = "claims"

    @by_each(AIMED, "nothing with a target")
    async def test_is_along_the_ray_that_it_said(self, body: Body, behavior: BlockBehavior) -> None:
        """Eyes and forearms are along the `ray` of the estimate once they are on target, within `accuracy`.

        Usually the ray is the one of the pose at the start, or its axis points the other way, from the target to the
        eyes. Generation counts by it what else a look or pointing may be taken for.
        """
        said, sync = body.estimate(behavior, None, self.world).ray, target_point(behavior)
        if not (seen := await self._on_target(body, behavior)):
            return
        if said is None:
            broken(sync, expected="the `ray` on target in its estimate", measured="None")
        near = (3.0 if isinstance(behavior, Pointing) else 1.0) * self.accuracy + self.gaze_slack + said.error
        off, away = min((angle(said.axis, ray.axis), math.dist(said.origin, ray.origin)) for ray in seen)
        if off > near or away > ORIGIN + self.gaze_slack:
            broken(
                sync,
                expected=f"what the estimate says, within {degrees(near)} and {ORIGIN * 100:.0f} cm",
                measured=f"{degrees(off)} and {away * 100:.1f} cm beside it",
            )

    async def _on_target(self, body: Body, behavior: BlockBehavior) -> list[Ray]:
        """Perform a behavior, and see where its eyes or forearms are as it tells that it is on target."""
        stage = _OnTarget(self, body, behavior)
        await stage.over()
        assert stage.state is not None
        rays = arms(stage.state, behavior.mode) if isinstance(behavior, Pointing) else (stage.state.gaze,)
        return [ray for ray in rays if ray is not None]

    async def test_states_what_people_can_tell_apart(self, body: Body) -> None:
        """`pointing_radius` and `gaze_half_angle` are such that people can tell things on a table apart.

        Usually they are in other units: metres, and radians. Generation says in words what they do not tell apart.
        """
        able, types = body.capabilities, set(self.types(body))
        if not types & {"gaze", "gazeShift", "headDirectionShift", "pointing"}:
            does_not_apply("it neither looks nor points")
        if "pointing" in types and not 0.0 < able.pointing_radius <= WIDEST_CYLINDER:
            limit = f"a `pointing_radius` up to {WIDEST_CYLINDER * 100:.0f} cm"
            broken(expected=limit, measured=f"{able.pointing_radius * 100:.0f} cm")
        if not 0.0 < able.gaze_half_angle <= WIDEST_CONE:
            limit = f"a `gaze_half_angle` up to {degrees(WIDEST_CONE)}"
            broken(expected=limit, measured=degrees(able.gaze_half_angle))

    async def test_points_as_far_as_its_reach_and_no_farther(self, body: Body) -> None:
        """A body points at a thing somewhat within its `reach`, and refuses one as much beyond it.

        Usually it is in centimetres, or it is the length of the arm. One that states none (0) is not judged by it,
        and one that does not point has none. Nobody says where its shoulder is: the way counts from its elbow.
        """
        reach = body.capabilities.reach
        if "pointing" not in body.capabilities.types and reach:
            broken(expected="no `reach` where it does not point", measured=f"{reach:g} m")
        if not reach:
            does_not_apply("it states no `reach`")
        await self.judge(body, partial(self._check_reach, body, reach), Pointing, "no pointing")

    async def _check_reach(self, body: Body, reach: Meters, behavior: BlockBehavior) -> None:
        assert isinstance(behavior, Pointing)
        ray = body.estimate(behavior, None, self.world).ray
        if ray is None:
            return  # another law says so
        slack = max(UNSURE, UPPER_ARM * math.dist(ray.origin, ray.tip or ray.origin))
        within, beyond = (self._along(behavior, ray, reach + by) for by in (-slack, slack))
        await self._check_points(body, behavior, within, f"that it points {reach - slack:.2f} m far")
        body.see(beyond)
        if body.estimate(behavior, None, beyond).feasible:
            limit = f"a refusal of what is {reach + slack:.2f} m away, since its `reach` is {reach:.2f} m"
            broken(expected=limit, measured="it is feasible")
        body.see(self.world)

    def _along(self, behavior: Pointing, ray: Ray, distance: Meters) -> World:
        """The world with the target of a pointing farther away, or nearer, in the direction in which it is."""
        target = self.position(behavior.target)
        share = distance / math.dist(ray.origin, target)
        there = [here + share * (to - here) for here, to in zip(ray.origin, target, strict=True)]
        return self.world_with(behavior.target, (there[0], there[1], there[2]))

    async def _check_points(self, body: Body, behavior: Pointing, world: World, expected: str) -> None:
        body.see(world)
        if (told := body.estimate(behavior, None, world)).fault is not None or not told.feasible:
            reason = told.fault.reason if told.fault is not None else "it is infeasible"
            broken(expected=expected, measured=f"it is refused: {reason}")
        seen, place = await self._on_target(body, behavior), self.position(behavior.target, world)
        off = min((aside(ray, place) for ray in seen), default=0.0)
        if off > (near := 3.0 * self.accuracy + self.gaze_slack):
            broken("stroke", expected=f"{expected}, within {degrees(near)}", measured=degrees(off))

    @by_each(AIMED, "nothing with a target")
    async def test_counts_the_degrees_that_its_joints_turn(self, body: Body, behavior: BlockBehavior) -> None:
        """`head_degrees` and `arm_degrees` are the way of the joints to the target, from home and from another pose.

        Usually they are radians, or the angle of the target, or they are counted from the present pose whatever
        `pose` says. Generation chooses by them what is looked at and what is pointed at.
        """
        joints = sorted(self.joints(body, behavior))
        if not joints:
            return
        estimate, sync = body.estimate(behavior, None, self.world), target_point(behavior)
        async with recorded(body, joints) as recording:
            at = times(await done(body, behavior))
            await asyncio.sleep(0.02)
        start, there = recording.at(at["start"]), recording.at(at[sync])
        way = sum(math.degrees(abs(there[joint] - start[joint])) for joint in joints)
        self._check_degrees(behavior, estimate, way, len(joints), "from home")
        here = estimate.pose_after
        if here is None:
            return
        assert isinstance(behavior, AIMED)
        for other in self.aims(body, behavior):
            from_there = body.estimate(other, here, self.world)
            way = _way(here, from_there.pose_after, joints)
            what = f"from where {behavior.id} leaves it"
            self._check_degrees(other, from_there, way, len(joints), what)

    def _check_degrees(self, behavior: BlockBehavior, said: Estimate, way: Degrees, joints: int, what: str) -> None:
        counted = said.head_degrees + said.arm_degrees
        slack = SAME + joints * math.degrees(self.accuracy + self.slack)
        is_by_a_way = isinstance(behavior, Pointing) and what != "from home"  # an arm may have to go round
        if not SHORTER * way - slack <= counted <= (math.inf if is_by_a_way else LONGER * way + slack):
            broken(
                target_point(behavior),
                expected=f"about {way:.0f} degrees of its joints {what}",
                measured=f"`head_degrees` {said.head_degrees:.0f}, `arm_degrees` {said.arm_degrees:.0f}",
            )

    @by_each()
    async def test_rehearses_what_it_estimates(self, body: Body, behavior: BlockBehavior) -> None:
        """A rehearsal of one behavior, now and undisturbed, says what its estimate says.

        Usually `rehearse` has a model of its own. Plans are made of what it says, and in one of a single behavior
        nothing else moves.
        """
        said = body.estimate(behavior, None, self.world)
        planned = (PlannedTime(sync="start", at=0.0),)
        for begins in ((), planned) if has_joints(behavior) else ((),):
            items = [EstimateItem(behavior=behavior, times=begins)]
            self._check_rehearsed(said, body.rehearse(items, self.world)[0])
            self._check_rehearsed(said, finished(body.rehearse_in_steps(items, self.world))[0])
        if isinstance(behavior, AIMED):
            (told,) = body.rehearse([EstimateItem(behavior=behavior, only="degrees")], self.world)
            self._check_same_degrees(said, told)

    def _check_rehearsed(self, said: Estimate, told: Estimate) -> None:
        if told.feasible != said.feasible or [each.to for each in told.phases] != [each.to for each in said.phases]:
            broken(
                expected=f"the points of its estimate, {listed(each.to for each in said.phases)}",
                measured=listed(each.to for each in told.phases),
            )
        for one, other in zip(said.phases, told.phases, strict=True):
            for name in ("natural", "shortest"):
                took, again = getattr(one, name), getattr(other, name)
                if abs(took - again) > self.tolerance + 1e-6:
                    what = f"`{name}` of its estimate, {ms(took)}"
                    broken(one.to, expected=what, measured=f"{ms(again)} in the rehearsal")
        self._check_same_degrees(said, told)

    def _check_same_degrees(self, said: Estimate, told: Estimate) -> None:
        one, other = said.head_degrees + said.arm_degrees, told.head_degrees + told.arm_degrees
        if abs(one - other) > SAME + math.degrees(self.slack):
            broken(expected=f"the {one:.0f} degrees of its estimate", measured=f"{other:.0f} in the rehearsal")

    @by_each(has_joints, "no joints")
    async def test_is_as_fast_and_as_slow_as_it_said(self, body: Body, behavior: BlockBehavior) -> None:
        """Asked for its `shortest` time a body keeps it, and asked to be slow it takes up to its `longest`.

        Usually a driver with one pace leaves `shortest` at 0, or `longest` at None, which is "no limit". With one
        pace all three are the natural time; only at a hold point can it be any longer.
        """
        for is_fast in (True, False):
            await body.home()
            phases = body.estimate(behavior, None, self.world).phases
            await self._paced(body, behavior, phases, is_fast=is_fast)

    async def _paced(self, body: Body, behavior: BlockBehavior, phases: Sequence[Phase], *, is_fast: bool) -> None:
        """Let it go at a pace: in a hurry all the way, slowly from one place where it stands to the next."""
        loop, stage = asyncio.get_running_loop(), Stage(body, behavior)
        stations = ["start"] if is_fast else ["start", *self.holds(body, behavior)]
        for number, (station, until) in enumerate(zip(stations, [*stations[1:], "end"], strict=True), 1):
            leg = _between(phases, station, until)
            asked = [
                each.shortest if is_fast else self._slow(each, _leads_to_hold(leg[place:]))
                for place, each in enumerate(leg)
            ]
            left = loop.time()
            pace = {each.to: left + sum(asked[: place + 1]) for place, each in enumerate(leg)}
            stage.authority.set_pace(pace)
            stage.authority.extend(station if until != "end" else "end")
            waits = number if until != "end" else math.inf
            await stage.until(lambda waits=waits: len(stage.waits_at) >= waits, sum(asked) + PATIENCE)  # type: ignore[misc]
            self._check_leg(stage, leg, asked, left, is_fast)
        stage.authority.set_pace({})
        await stage.over()

    def _slow(self, phase: Phase, is_hold: bool) -> Seconds:
        """Time that is asked for of a phase that is to be slow. is_hold: it can wait at its end."""
        if is_hold or phase.natural < REACTION:
            return phase.natural
        most = SLOWER if isinstance(asyncio.get_running_loop(), VirtualTimeLoop) else SLOWER / 4
        if phase.longest is not None:
            return min(phase.longest, phase.natural + most)
        return phase.natural + (FAR if isinstance(asyncio.get_running_loop(), VirtualTimeLoop) else most)

    def _check_leg(
        self, stage: Stage, leg: Sequence[Phase], asked: Sequence[Seconds], left: Seconds, is_fast: bool
    ) -> None:
        came = _came(stage.progress)
        due, allowed = 0.0, REACTION
        for place, (phase, takes) in enumerate(zip(leg, asked, strict=True)):
            due, allowed = due + takes, allowed + self.tolerance
            if phase.to not in came or (not is_fast and _leads_to_hold(leg[place:])):
                continue
            took = came[phase.to] - left
            if (took - due if is_fast else due - took) > allowed:
                claim = f"`shortest` {ms(phase.shortest)}"
                if not is_fast:
                    claim = f"`longest` {'None' if phase.longest is None else ms(phase.longest)}"
                what = f"{ms(due)} as it was asked to, since {claim} allows it"
                broken(phase.to, expected=what, measured=ms(took))


class _OnTarget(Stage):
    """A behavior that is looked at as it tells that it is on target."""

    def __init__(self, suite: Suite, body: Body, behavior: BlockBehavior) -> None:
        self.state: BodyState | None = None
        self._suite = suite
        super().__init__(body, behavior, "end")

    def hear(self, progress: Progress) -> None:
        if isinstance(progress, Reached) and progress.sync == target_point(self.behavior):
            self.state = self._suite.observed(self._body)


def _leads_to_hold(leg: Sequence[Phase]) -> bool:
    """True if the first of these phases ends at a hold point, or at an instant with one."""
    for number, phase in enumerate(leg):
        if number and phase.natural > 0.0:
            return False
        if phase.hold:
            return True
    return False


def _way(here: BodyPose, there: BodyPose | None, joints: Sequence[str]) -> Degrees:
    """Degrees that joints turn from one pose to another."""
    one, other = angles(here), pose_angles(there)
    turned: list[Radians] = [abs(other[joint] - one[joint]) for joint in joints if joint in one and joint in other]
    return math.degrees(sum(turned))


def _between(phases: Sequence[Phase], since: str, to: str) -> Sequence[Phase]:
    """The phases from one sync point to another."""
    names = [phases[0].since, *(each.to for each in phases)]
    return phases[names.index(since) : names.index(to)]


def _came(progress: Sequence[Progress]) -> dict[str, Seconds]:
    """Loop time at which a body came to each sync point."""
    came: dict[str, Seconds] = {}
    for each in progress:
        if isinstance(each, Arrived):
            came.setdefault(each.sync, each.at)
        elif isinstance(each, Reached):
            came.setdefault(each.sync, each.arrived)
    return came
