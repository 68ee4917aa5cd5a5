"""Comparison of a plan with what its block says: times of other blocks may leave no time for all of it."""

from msgspec.structs import replace

from engage_hri.services.realizer.plan.known import Known
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.promises import broken_by
from engage_hri.services.realizer.plan.relations import Relations


def compared(plan: Plan, said: Relations, known: Known) -> Plan:
    """The plan with what it cannot keep of what the block says, and a copy of that: it has worked out nothing."""
    if not (known.points or plan.late):
        return replace(plan, relations=replace(plan.relations))
    times = known.with_own({point: plan.schedule[at] for point, at in plan.at.items()})
    broken = broken_by(said, times)
    return replace(plan, relations=replace(said), broken=tuple(broken))
