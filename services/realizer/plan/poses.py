"""Questions to the body about a plan: the poses in which behaviors start, and when they begin, wait and hurry."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from math import inf

from engage_hri.schemas.body import BodyPose, Estimate, PlannedTime
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.known import NOTHING, Known, is_foreign
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.slack import UNNOTICED, slack
from engage_hri.services.realizer.points import EPSILON, SHIFTS, WITH_STROKE, Point, family

NOTICEABLE: Seconds = 0.0005
"""Seconds by which a phase may differ before it makes another plan."""

APART: Seconds = 2e-6
"""Seconds after all else has ended: a look that lasts so long goes home then, and not together with it."""
CUT: Seconds = 1.0
"""Seconds after it has been cut: a behavior that is to be cut at a hold point is never let go there."""


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
    ranked = [*known.holders, *plan.begun_in_order(plan.chains)]
    for id in sorted(ranked, key=lambda id: round(times[users[id][0].points[0]], 6)):
        chain, estimate = users[id]
        is_shift, is_ours = chain.type in SHIFTS, id in plan.chains
        for part in chain.parts:
            earlier, before = latest.get(part, (None, None))
            if is_ours and earlier is not None and before is not None and before.pose_after is not None:
                if not _is_home(times, earlier, chain):
                    poses[id] = before.pose_after
                elif base is not None and family(chain.type) == "gaze":
                    poses[id] = base
                elif is_foreign(earlier.points[0].behavior) and before.pose_end is not None:
                    poses[id] = before.pose_end  # Now it may still be elsewhere: the body rehearses this block only.
            if estimate is not None and not (is_shift and is_ours and _is_overlaid(plan, id)):
                latest[part] = chain, estimate
        if is_shift and is_ours and estimate is not None:
            base = estimate.pose_after
    return poses


def planned_times(plan: Plan, known: Known = NOTHING) -> dict[str, tuple[PlannedTime, ...]]:
    """Times at which behaviors begin, wait, hurry and dawdle, by their ids, in the order in which they begin.

    Empty if no behavior makes a difference to another or to itself: then its first estimates hold. known: other live
    blocks.
    """
    order = plan.begun_in_order(plan.chains)
    order.sort(key=lambda id: round(plan.predicted(plan.chains[id].points[0]), 6))
    moving = [id for id in order if (estimate := plan.estimates.get(id)) is not None and estimate.parts]
    times = {
        id: behavior_times(plan, id, known, plan.predicted) for id in moving if plan.estimates[id].parts != ("voice",)
    }
    used = [part for id in times for part in plan.estimates[id].parts]
    used += [part for each in known.holders.values() for part in each.chain.parts]
    if len(set(used)) == len(used) and "torso" not in used and all(len(each) == 1 for each in times.values()):
        return {}
    return times


def behavior_times(
    plan: Plan, id: str, known: Known, at: Callable[[Point], Seconds], reached: int = 0
) -> tuple[PlannedTime, ...]:
    """Times of the points that a behavior has reached; then those at which it begins, waits, hurries and dawdles.

    at: when a point of the plan comes, or came. reached: number of the behavior's points that have been.
    """
    chain = plan.chains[id]
    times = [PlannedTime(sync=point.sync, at=at(point)) for point in chain.points[: max(1, reached)]]
    taken, (_, cut) = _taken(plan, id, at), plan.successors.get(id, ("", None))
    is_lost = False
    left = max(0, reached - 1)
    for (since, to), segment in list(zip(pairwise(chain.points), chain.segments, strict=True))[left:]:
        is_lost = is_lost or to == cut
        begins, comes = at(since), at(to)
        surplus = comes - begins - segment.natural
        if segment.hold and is_lost:  # It may not pass: it waits there until it is cut.
            times.append(PlannedTime(sync=to.sync, at=taken + CUT))
            break
        if to == cut and surplus < -NOTICEABLE:
            break
        is_just_in_time = chain.type in SHIFTS and comes >= taken - EPSILON
        is_due = _is_met_there(plan, to, known, begins, at) if segment.hold else is_just_in_time
        is_due = is_due and not (plan.at[since] == plan.at[to] and times[-1].sync == since.sync)
        if abs(surplus) > NOTICEABLE or is_due:
            is_slower = EPSILON < surplus <= slack(plan, to)
            when = comes + (APART if id in plan.natural else 0.0)
            times.append(PlannedTime(sync=to.sync, at=when, through=is_slower))
    return tuple(times)


def _is_met_there(plan: Plan, hold: Point, known: Known, before: Seconds, at: Callable[[Point], Seconds]) -> bool:
    """True if one comes to this instant who cannot wait, or if this waits for one that comes at the same time.

    Who is at the hold point waits until that is measured. before: when it is at the point before. If a point of
    another block has come by then, it need not stop for it.
    """
    here, net = plan.at[hold], plan.net
    others = (
        each
        for each in plan.members[here]
        if each.behavior != hold.behavior
        and (each.kind == "passive" or (each.kind == "prompt" and plan.chains[each.behavior].type not in WITH_STROKE))
    )
    if any(known.points.get(each.point, inf) > before for each in others):
        return True
    awaited = (net.places[each] for each in net.inputs[here])
    sources = {each.source for each in awaited if each.kind not in ("phase", "idle") and each.source}
    return any(at(point) > at(hold) - UNNOTICED for each in sources for point in net.transitions[each].points[:1])


def _taken(plan: Plan, id: str, at: Callable[[Point], Seconds]) -> Seconds:
    """Time at which another takes a part of this behavior. A shift takes nothing from what lies over it."""
    is_shift = plan.chains[id].type in SHIFTS
    begun, parts = at(plan.chains[id].points[0]), set(plan.chains[id].parts)
    later = plan.entering[plan.entering.index(id) + 1 :]
    rivals = [plan.chains[each] for each in later if is_shift or plan.chains[each].type not in SHIFTS]
    starts = [at(each.points[0]) for each in rivals if parts & set(each.parts)]
    if id in plan.successors and is_foreign(successor := plan.successors[id][0]):
        starts.append(at(Point(successor, "start")))
    return min((start for start in starts if start >= begun), default=inf)


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
