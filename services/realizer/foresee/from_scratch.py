"""Forecast of a plan of which none is kept, with all that was measured; and whether a plan needs one that is kept."""

from collections.abc import Callable, Iterable, Mapping

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.foresee.forecast import Forecast
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.points import Point


def full_forecast(
    plan: Plan,
    began: Seconds,
    factor: Callable[[str], float],
    foreseen: Mapping[Point, Seconds],
    reached: Mapping[Point, Seconds],
    arrived: Mapping[Point, Seconds],
    instants: Mapping[int, Seconds],
    prolonged: Iterable[tuple[int, int, Seconds]] = (),
    heard: Mapping[str, Seconds] = {},
) -> Forecast:
    """Forecast of a block that keeps none, which has yet to be asked (`update`, `as_of`).

    instants: those that are over. prolonged, heard: see `prolong` and `shift` of `Forecast`.
    """
    forecast = Forecast(plan, began, factor, foreseen)
    for source, target, seconds in prolonged:
        forecast.prolong(source, target, seconds)
    for point, at in reached.items():
        if point in plan.at:
            forecast.passed(point.behavior, plan.at[point], at)
    for point in arrived.keys() - reached.keys():
        if point in plan.at:
            forecast.come(point.behavior, plan.at[point], arrived[point])
    for behavior, at in heard.items():
        forecast.shift(behavior, at)
    for transition, at in instants.items():
        forecast.fix(transition, at)
    return forecast


def is_predictive(plan: Plan) -> bool:
    """True if a time is bounded from above, or a point that cannot or should not wait is tied to another."""
    if any(bound.kind != "phase" for bound in plan.net.bounds):
        return True
    constrained = {place.target for place in plan.net.places if place.kind in ("order", "delay", "series")}
    return any(
        any(member.kind in ("passive", "prompt") for member in members)
        and (len(members) > 1 or transition in constrained)
        for transition, members in enumerate(plan.members)
    )
