"""Outcome of a plan that the body refutes: what the block says and the body will not keep."""

from collections.abc import Mapping, Sequence
from math import inf

from msgspec.structs import replace

from engage_hri.schemas.body import Estimate, Phase
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Place, order
from engage_hri.services.realizer.plan.known import is_foreign
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.poses import NOTICEABLE
from engage_hri.services.realizer.plan.promises import Broken, broken_by
from engage_hri.services.realizer.points import Point, Segment


def as_told(plan: Plan, told: Sequence[Estimate]) -> Plan:
    """The plan with what it misses if its phases take as long as the body told, and all that waits for them waits.

    Whoever performs it tries to be on time all the same.
    """
    times = _times(plan, {(each.behavior, phase.to): phase for each in told for phase in each.phases})
    missed = [each for each in broken_by(plan.relations, times) if not _is_foreign(each)]
    late = {(plan.at[each.late], plan.at[each.early]): each.seconds for each in missed}
    return replace(plan, late=late, broken=(*filter(_is_foreign, plan.broken), *missed))


def _times(plan: Plan, told: Mapping[tuple[str, str], Phase]) -> dict[Point, Seconds]:
    """Time at which each point comes. told: phases, by behavior and sync point.

    A behavior hurries and dawdles where it is planned to, as far as the body can, and waits at its hold points. No
    instant is earlier than planned; what passes of itself may be.
    """
    into: dict[int, list[Place]] = {}
    for place in plan.net.places:
        if place.kind not in ("idle", "phase"):
            into.setdefault(place.target, []).append(place)
    coming: dict[int, list[tuple[Chain, int]]] = {}
    for chain in plan.chains.values():
        for number, point in enumerate(chain.points):
            coming.setdefault(plan.at[point], []).append((chain, number))
    times, instants = plan.times, list(plan.schedule)
    for here in order(plan.net) or range(len(instants)):
        planned = plan.schedule[here]
        instants[here] = max([planned, *(instants[each.source] + each.lag for each in into.get(here, ()))])
        for chain, number in coming.get(here, ()):
            point, before = chain.points[number], chain.points[max(0, number - 1)]
            phase = told.get((point.behavior, point.sync))
            if phase is not None and plan.at[before] != here and not _is_cut(plan, point):
                segment = chain.segments[number - 1]
                is_paced = abs(planned - plan.predicted(before) - segment.natural) > NOTICEABLE
                times[point] = times[before] + (
                    _lasting(phase, segment, planned - times[before]) if is_paced else phase.natural
                )
                instants[here] = max(instants[here], times[point])
        for chain, number in coming.get(here, ()):
            if not number or chain.segments[number - 1].hold or plan.at[chain.points[number - 1]] == here:
                times[chain.points[number]] = instants[here]
    return times


def _is_cut(plan: Plan, point: Point) -> bool:
    """True if another takes the part of the behavior before this point, or at it."""
    cut = plan.successors.get(point.behavior, ("", None))[1]
    points = plan.chains[point.behavior].points
    return cut is not None and points.index(point) >= points.index(cut)


def _lasting(phase: Phase, segment: Segment, asked: Seconds) -> Seconds:
    """Seconds that a phase takes if it is asked to take `asked`: what was too short in an earlier answer still is."""
    shortest = max(phase.shortest, min(segment.shortest, phase.natural))
    return min(max(asked, shortest), inf if phase.longest is None else phase.longest)


def _is_foreign(broken: Broken) -> bool:
    return is_foreign(broken.early.behavior) or is_foreign(broken.late.behavior)
