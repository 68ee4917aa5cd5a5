"""For whose part of the body a behavior has waited, in words."""

from collections.abc import Mapping
from typing import Literal

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.words import Spelling, taken
from engage_hri.services.realizer.points import Point

AT_ONCE: Seconds = 0.1
"""Seconds within which a behavior begins after what it waited for; if later, it waited for something else, too."""


def waited_for(
    plan: Plan, behavior: str, times: Mapping[Point, Seconds], spelling: Spelling, *, is_past: bool
) -> str:
    """Say for whom a behavior waits before it begins, and for which part; empty: for nobody, or for more than that.

    times: of points, those of other blocks among them. is_past: it has begun.
    """
    start = plan.chains[behavior].points[0]
    if (began := times.get(start)) is None:
        return ""
    found = []
    for place in plan.net.places:
        if place.kind == "series" and place.after and (place.behavior, place.target) == (behavior, plan.at[start]):
            holder = plan.chains.get(place.after)
            held = plan.holders.get(place.after, ()) if holder is None else holder.parts
            parts = tuple(part for part in plan.chains[behavior].parts if part in held)
            until = next(each for each in plan.net.transitions[place.source].points if each.behavior == place.after)
            if parts and (at := times.get(until)) is not None and began - at <= AT_ONCE:
                verb: Literal["has", "had"] = "had" if is_past else "has"
                found.append((at, taken(place.after, parts, until, spelling, verb=verb)))
    return f"it {'waited' if is_past else 'waits'} for its turn: {max(found)[1]}" if found else ""
