"""The manner of a plan: where behaviors stand before they hurry, and whether times may be missed.

How short a phase can be depends on how it begins. Who passes a hold point on the way cannot change pace at once; who
stands there first sets out anew, with a gesture that is as small as it has to be. So a plan may let a behavior stand
for a moment at a hold point (`stands`), which costs STAND seconds and saves more behind it.
"""

from collections.abc import Mapping, Sequence

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import PetriNet, Place
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.relations import Problem
from engage_hri.services.realizer.points import EPSILON, Point, frozen

STAND: Seconds = 0.05
"""Seconds for which a behavior waits where it is to stand: a stop costs less, so that it has come to rest by then."""


class Manner(Struct, frozen=True):
    """stands: hold points at which behaviors stand. may_be_late: true to miss times, and lose no behavior.

    lost: why behaviors are dropped all the same: what the body promises leaves no time for them.
    """

    stands: frozenset[Point] = frozen()
    may_be_late: bool = False
    lost: tuple[Problem, ...] = ()


AT_EASE = Manner()
"""Nobody stands, and what cannot be on time is dropped: how a block is planned first."""
Late = Mapping[tuple[int, int], Seconds]
"""Upper bounds that a plan misses, by the transitions at their ends, and by how much."""


def standing(
    net: PetriNet, at: Mapping[Point, int], chains: Mapping[str, Chain], stands: frozenset[Point]
) -> PetriNet:
    """The net in which behaviors stand there. at: the transition of each point."""
    places = list(net.places)
    for point in sorted(stands):
        if (chain := chains.get(point.behavior)) is not None and point in chain.points:
            source, target = at[chain.points[0]], at[point]
            way = sum(each.natural for each in chain.segments[: chain.points.index(point)])
            if source != target:
                places.append(Place("order", source, target, way + STAND, way + STAND))
    return replace(net, places=tuple(places)) if len(places) > len(net.places) else net


def eased(net: PetriNet, times: Sequence[Seconds]) -> tuple[PetriNet, Late]:
    """The net with the bounds on what the block says as much later as these times miss them, and which those are.

    So whoever performs it hurries as the plan does, and no more.
    """
    late = {
        (each.source, each.target): by
        for each in net.bounds
        if not each.behavior and (by := times[each.source] + each.lag - times[each.target]) > EPSILON
    }
    bounds = [
        each if each.behavior else replace(each, lag=each.lag - late.get((each.source, each.target), 0.0))
        for each in net.bounds
    ]
    return replace(net, bounds=tuple(bounds)), late
