"""At what pace a behavior is to run: planned instants of its coming points, where its own pace would miss them."""

from typing import TYPE_CHECKING

from engage_hri.schemas.units import Seconds

if TYPE_CHECKING:
    from engage_hri.services.realizer.decide.authority import Authority

Pace = tuple[tuple[str, Seconds], ...]
"""Sync points and their instants, by loop time. Empty: as is natural."""

NOTICEABLE: Seconds = 0.02
"""Planned instants that differ by less are not worth a message."""


def pace(behavior: str, authority: "Authority", now: Seconds) -> Pace:
    """When it is to come to its points, up to the next where it must ask; empty if that is when it comes anyway."""
    forecast, plan = authority.forecast, authority.plan
    if forecast is None or behavior not in plan.chains:
        return ()
    points = plan.chains[behavior].points
    number = authority.next_number(behavior)
    at = authority.reached[points[number - 1]] if number else now
    is_paced = forecast.is_hurried(behavior)
    planned: list[tuple[str, Seconds]] = []
    before = plan.at[points[number - 1]] if number else -1
    for point in points[number:]:
        here = plan.at[point]
        if here != before:
            natural, latest = at + forecast.phase(behavior, here), at + forecast.longest(behavior, here)
            if point is points[number] and not authority.paces.get(behavior):
                natural = max(natural, authority.not_before.get(behavior, natural))  # overdue, not slower on purpose
            at = max(natural, now) if authority.holds(point) else natural
            if forecast.times[here] > natural + NOTICEABLE and authority.member(point).kind == "passive":
                at = max(natural, min(forecast.times[here], latest))
                is_paced = is_paced or at > natural + NOTICEABLE
        before = here
        planned.append((point.sync, at))
        if not authority.may_pass(point):
            break
    return tuple(planned) if is_paced else ()


def differs(one: Pace, other: Pace) -> bool:
    """Noticeably?"""
    if not one or not other:
        return one != other
    before = dict(one)
    return any(sync not in before or abs(before[sync] - at) > NOTICEABLE for sync, at in other)
