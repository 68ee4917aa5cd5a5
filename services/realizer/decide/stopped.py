"""Stopped time: what holds have stopped of a block so far, for another plan of it."""

from collections.abc import Iterator, Mapping

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.decide.held_up import HeldUp
from engage_hri.services.realizer.net.clocks import Stops
from engage_hri.services.realizer.net.facts import Facts
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.points import ORIGIN, Point, stands_soon


def stopped(plan: Plan, facts: Facts, held_up: HeldUp, times: Mapping[Point, Seconds], now: Seconds) -> Stops:
    """Tell what holds have stopped. times: of all points, measured or expected, by the loop's clock."""
    began = facts.began

    def cost(late: Point, early: Point, allowed: Seconds, by: Seconds) -> Seconds:
        return held_up.between(late, early, allowed, by, max(times.get(late, now), times.get(early, now)))

    return Stops(
        holds=facts.holds_so_far(now),
        phases={point: seconds for point, seconds in _stood(plan, facts, now) if seconds},
        reached={point: at - began for point, at in facts.reached.items()},
        times={ORIGIN: 0.0} | {point: at - began for point, at in times.items()},
        cost=cost,
    )


def _stood(plan: Plan, facts: Facts, now: Seconds) -> Iterator[tuple[Point, Seconds]]:
    """Seconds for which behaviors stood on their way to each point that they have come to, and to the next.

    A voice stands between two words, a clock at once; a movement goes on to where it can wait, and stands there.
    """
    for behavior in facts.begun:
        if (chain := plan.chains.get(behavior)) is None:
            continue
        stands = stands_soon(chain.behavior)
        for before, point in zip(chain.points, chain.points[1 : facts.next_number(behavior) + 1], strict=False):
            until = facts.reached.get(point, now)
            if stands:
                yield point, facts.stood_between(facts.reached[before], until, behavior)
            elif point in facts.arrived:
                yield point, facts.held_between(facts.arrived[point], until, behavior)
