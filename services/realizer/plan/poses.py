"""Poses of the body when a behavior starts: on the target of the one before it, or home again."""

from collections.abc import Mapping

from engage_hri.schemas.body import BodyPose, Estimate
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.known import NOTHING, Known
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.planner import Plan
from engage_hri.services.realizer.plan.schedule import EPSILON
from engage_hri.services.realizer.points import SHIFTS, Point, family


def poses_before(plan: Plan, known: Known = NOTHING) -> dict[str, BodyPose]:
    """Poses in which behaviors start that take another's place, by their ids: on the target of the earlier one.

    How long a look takes depends on what was looked at before it, not on where the head is as the block comes in.
    known: other live blocks; the earlier one may be of any of them.
    """
    latest: dict[str, tuple[Chain, Estimate]] = {}
    base: BodyPose | None = None
    """Pose to which a look goes home, once a shift has been made."""
    poses = {}
    times = {
        **known.points,
        **{point: plan.predicted(point) for each in plan.chains.values() for point in each.points},
    }
    users = {name: (each.chain, each.estimate) for name, each in known.holders.items()}
    users |= {id: (each, plan.estimates.get(id)) for id, each in plan.chains.items()}
    order = {id: (times[each.points[0]], number) for number, (id, (each, _)) in enumerate(users.items())}
    for id in sorted(users, key=order.__getitem__):
        chain, estimate = users[id]
        is_shift, is_ours = chain.type in SHIFTS, id in plan.chains
        for part in chain.parts:
            earlier, before = latest.get(part, (None, None))
            if is_ours and earlier is not None and before is not None and before.pose_after is not None:
                if not _is_home(times, earlier, chain):
                    poses[id] = before.pose_after
                elif base is not None and family(chain.type) == "gaze":
                    poses[id] = base
            if estimate is not None and not (is_shift and is_ours and _is_overlaid(plan, id)):
                latest[part] = chain, estimate
        if is_shift and is_ours and estimate is not None:
            base = estimate.pose_after
    return poses


def _is_overlaid(plan: Plan, shift: str) -> bool:
    """True if the shift has no time to move the head, since a gaze has it or takes it."""
    since, to = (plan.predicted(point) for point in plan.chains[shift].points)
    return to < since + EPSILON


def _is_home(times: Mapping[Point, Seconds], earlier: Chain, later: Chain) -> bool:
    """True if the earlier had the time to take its part home. A shift leaves it where it is."""
    if earlier.type in SHIFTS:
        return False
    relax, end = (times[point] for point in earlier.points[-2:])
    return relax + EPSILON < end <= times[later.points[0]] + EPSILON
