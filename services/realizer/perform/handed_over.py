"""Behaviors that the body has ended before their end: handed over, with all that matters done, or lost. Pure."""

from collections.abc import Container

from msgspec.structs import replace

from engage_hri.schemas.body import BehaviorOutcome
from engage_hri.schemas.faults import Fault
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.words import AS_IN_DRAFTS, Spelling
from engage_hri.services.realizer.points import Point

_TAKEN = Fault(reason="", cause="replaced")


def has_lost_nothing(plan: Plan, outcome: BehaviorOutcome, reached: Container[Point]) -> bool:
    """True if a behavior is done, or was taken over when it had nothing left to do but its way home.

    reached: points that were measured.
    """
    id = outcome.behavior
    if outcome.status != "taken_over" or id not in plan.kept:
        return outcome.status == "done"
    points = plan.chains[id].points
    return all(point in reached for point in points[: points.index(plan.kept[id]) + 1])


def loss(outcome: BehaviorOutcome, spelling: Spelling = AS_IN_DRAFTS) -> Fault:
    """Reason why a behavior has not come to its end."""
    if outcome.status == "taken_over":
        passed = spelling.sync(Point(outcome.behavior, outcome.passed)) if outcome.passed else "nothing of it"
        return replace(outcome.fault or _TAKEN, reason=f"another behavior took its part after {passed}", where="")
    return outcome.fault or Fault(reason=f"the body {outcome.status} it")
