"""Poses of the body when a behavior starts: on the target of the one before it, or home again."""

from collections.abc import Mapping

from engage_hri.schemas.body import BodyPose, Estimate
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.planner import Plan
from engage_hri.services.realizer.plan.schedule import EPSILON
from engage_hri.services.realizer.points import SHIFTS, Point, family


def poses_before(plan: Plan, left: Mapping[str, BodyPose] = {}) -> dict[str, BodyPose]:
    """Poses in which behaviors start that take another's place, by their ids: on the target of the earlier one.

    How long a look takes depends on what was looked at before it, not on where the head is as the block comes in.
    left: poses in which other blocks leave parts, see `poses_left`.
    """
    latest: dict[str, Estimate] = {}
    base: BodyPose | None = None
    """Pose to which a look goes home, once a shift has been made."""
    poses = {}
    order = {id: (plan.predicted(each.points[0]), number) for number, (id, each) in enumerate(plan.chains.items())}
    for id in sorted(plan.chains, key=order.__getitem__):
        estimate, is_shift = plan.estimates.get(id), plan.chains[id].type in SHIFTS
        for part in plan.chains[id].parts:
            before = latest.get(part)
            if before is None and part in left:
                poses[id] = left[part]
            if before is not None and before.pose_after is not None:
                if not _is_home(plan, before.behavior, id):
                    poses[id] = before.pose_after
                elif base is not None and family(plan.chains[id].type) == "gaze":
                    poses[id] = base
            if estimate is not None and not (is_shift and _is_overlaid(plan, id)):
                latest[part] = estimate
        if is_shift and estimate is not None:
            base = estimate.pose_after
    return poses


def poses_left(plan: Plan, times: Mapping[Point, Seconds], until: Seconds) -> dict[str, BodyPose]:
    """Poses of the body at `until`, by part: on the target of what goes on then. times: of each point."""
    going = [
        (times[chain.points[0]], number, chain.parts, estimate.pose_after)
        for number, (id, chain) in enumerate(plan.chains.items())
        if times[chain.points[0]] <= until < times[chain.points[-1]]
        and (estimate := plan.estimates.get(id)) is not None
        and estimate.pose_after is not None
    ]
    return {part: pose for *_, parts, pose in sorted(going, key=lambda each: each[:2]) for part in parts}


def _is_overlaid(plan: Plan, shift: str) -> bool:
    """True if the shift has no time to move the head, since a gaze has it or takes it."""
    since, to = (plan.predicted(point) for point in plan.chains[shift].points)
    return to < since + EPSILON


def _is_home(plan: Plan, earlier: str, later: str) -> bool:
    """True if the earlier had the time to take its part home. A shift leaves it where it is."""
    if plan.chains[earlier].type in SHIFTS:
        return False
    relax, end = (plan.predicted(point) for point in plan.chains[earlier].points[-2:])
    return relax + EPSILON < end <= plan.predicted(plan.chains[later].points[0]) + EPSILON
