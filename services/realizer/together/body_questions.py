"""Questions to the body: what the behaviors of a block take, beside all that moves the body meanwhile."""

from collections.abc import Callable, Collection, Iterable, Mapping

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import BodyPose, EstimateBehaviors, EstimateItem, PlannedTime
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.decide.decisions import Decisions
from engage_hri.services.realizer.plan.agreement import behavior_times
from engage_hri.services.realizer.plan.known import Known, is_foreign
from engage_hri.services.realizer.plan.phases import with_planned_hand
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.points import performer

CROWD = 48
"""Behaviors of all live blocks from which on the body is asked about each block by itself: each question is about all
of them, and each new plan calls for one of each block."""


def is_crowd(performed: Iterable[Decisions]) -> bool:
    """True if these blocks have so many behaviors that they are not rehearsed beside each other."""
    return sum(len(each.plan.chains) for each in performed) > CROWD


def question_about(
    block: Block, before: Mapping[str, BodyPose] = {}, times: Mapping[str, tuple[PlannedTime, ...]] = {}
) -> EstimateBehaviors:
    """The question to the body about the behaviors of a block that it performs.

    before: poses in which behaviors start; without one, from where the body is now. times: when they are planned to
    begin and to wait, in the order in which they begin.
    """
    behaviors = [behavior for behavior in block.behaviors if performer(behavior) == "body"]
    rank = {id: number for number, id in enumerate(times)}
    behaviors.sort(key=lambda behavior: rank.get(behavior.id, len(rank)))
    items = [
        EstimateItem(behavior=behavior, pose=before.get(behavior.id), times=times.get(behavior.id, ()))
        for behavior in behaviors
    ]
    return EstimateBehaviors(items=tuple(items))


def question_about_rest(
    performed: Decisions, before: Mapping[str, BodyPose], times: Mapping[str, tuple[PlannedTime, ...]]
) -> EstimateBehaviors:
    """The same about behaviors of a block that is being performed: those with `times`."""
    plan, facts = performed.plan, performed.facts
    items = [
        EstimateItem(
            behavior=with_planned_hand(plan.chains[id]),
            pose=before.get(id),
            times=each,
            reached=facts.next_number(id),
        )
        for id, each in times.items()
    ]
    return EstimateBehaviors(items=tuple(items))


def meanwhile(
    performed: Iterable[Decisions],
    parts: Collection[str],
    now: Seconds,
    is_meant: Callable[[Decisions, str], bool] = lambda performed, behavior: True,
) -> tuple[EstimateItem, ...]:
    """Behaviors of these blocks that move the body from now on, as the body is asked about them.

    parts: those that matter; head and arms aim for where the torso is, so with one, the other does. is_meant: False
    for a behavior of a block that is to be left out.
    """
    matters = {*parts, "torso"}
    return tuple([
        EstimateItem(
            behavior=with_planned_hand(each.plan.chains[id]),
            times=times,
            reached=each.facts.next_number(id),
        )
        for each in performed
        if not each.is_ending
        for id, times in times_ahead(each, now).items()
        if "torso" in parts or not matters.isdisjoint(each.plan.estimates[id].parts)
        if is_meant(each, id)
    ])  # fmt: skip


def times_ahead(decisions: Decisions, now: Seconds) -> dict[str, tuple[PlannedTime, ...]]:
    """Seconds from now at which behaviors began or begin, wait, hurry and dawdle, in the order in which they begin.

    Of those that move the body and have not ended.
    """
    plan, facts, expected = decisions.plan, decisions.facts, decisions.foresight.times(now)
    others = Known(points={point: at - now for point, at in expected.items() if is_foreign(point.behavior)})
    moving = [id for id in plan.chains if _moves(plan, id) and not facts.has_ended(id)]
    moving.sort(key=lambda id: round(expected[plan.chains[id].points[0]], 6))
    return {
        id: behavior_times(plan, id, others, lambda point: expected[point] - now, facts.next_number(id))
        for id in plan.begun_in_order(moving)
    }


def parts_moved(plan: Plan, behaviors: Iterable[str]) -> set[str]:
    """Parts of the body that behaviors move."""
    return {part for id in behaviors if _moves(plan, id) for part in plan.estimates[id].parts}


def _moves(plan: Plan, behavior: str) -> bool:
    estimate = plan.estimates.get(behavior)
    return estimate is not None and bool(estimate.parts) and estimate.parts != ("voice",)
