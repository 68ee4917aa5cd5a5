"""Another plan of a block that is being performed: something was dropped, others came, motions take longer."""

from collections.abc import Collection, Iterable

from msgspec.structs import replace

from engage_hri.schemas.behaviors import Hand
from engage_hri.schemas.body import Estimate
from engage_hri.services.realizer.plan.known import Known
from engage_hri.services.realizer.plan.phases import ARMS
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.plan.relations import BlockRefused
from engage_hri.services.realizer.plan.stops import as_run


def planned_again(so_far: Plan, known: Known, gone: Iterable[str]) -> Plan:
    """A plan of a block as if the behaviors that are gone had never been written. Raises BlockRefused."""
    known = _still_untied(so_far, known)
    plan = plan_block(
        so_far.block,
        so_far.estimates.values(),
        dropped=gone,
        known=known,
        barred=_chosen(so_far, known),
        manner=so_far.manner,
    )
    return replace(plan, net=as_run(plan.net))


def reestimated(so_far: Plan, known: Known, gone: Collection[str], estimates: Iterable[Estimate]) -> Plan | None:
    """The plan with other estimates; None if these would cost a behavior, or a part that somebody else has.

    A motion that takes another time is no reason for that: blocks that plan with each other would never agree.
    """
    known = _still_untied(so_far, known)
    try:
        plan = plan_block(
            so_far.block,
            estimates,
            dropped=gone,
            known=known,
            barred=_chosen(so_far, known),
            turns=so_far.turns,
            manner=so_far.manner,
        )
    except BlockRefused:
        return None
    costs = {*plan.dropped} - {*gone, *so_far.dropped} or plan.takes.items() - so_far.takes.items()
    return None if costs else replace(plan, net=as_run(plan.net))


def _chosen(so_far: Plan, known: Known) -> set[tuple[str, Hand]]:
    """Hands that are not to be chosen: blocks that came later were planned around the arms that this one uses."""
    return {(id, hand) for id in so_far.chains.keys() - known.due for hand in ARMS}


def _still_untied(so_far: Plan, known: Known) -> Known:
    """Knowledge with the ties that were given up: others were planned with that in mind."""
    return replace(known, untied=known.untied | so_far.untied) if so_far.untied else known
