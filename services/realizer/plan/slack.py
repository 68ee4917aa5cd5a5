"""Slack at hold points: who is early there by less than a stop costs is slower on its way, and does not stop."""

from math import inf

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.points import Point

BRIEF: Seconds = 0.05
"""Most seconds by which a behavior is slower on its way, so as not to stop."""
UNNOTICED: Seconds = 0.008
"""Seconds by which it may pass there too early; and by which a plan may miss what its block says, untold."""
BRAKING: Seconds = 0.1
"""Seconds before a hold point at which a movement that is to stop there begins to brake, at the most."""


def slack(plan: Plan, point: Point) -> Seconds:
    """Seconds by which a behavior may be early at a hold point that it shares with nobody, and not stop there.

    point: any that comes with the hold point.
    """
    members = plan.members[plan.at[point]]
    if len(members) > 1 or not members[0].can_wait or (hold := members[0].point) in plan.manner.stands:
        return 0.0
    chain = plan.chains[hold.behavior]
    number = next(index for index, each in enumerate(chain.points) if plan.at[each] == plan.at[hold]) - 1
    longest = chain.longest[number]
    room = inf if longest is None else longest - chain.segments[number].natural
    return min(BRIEF, max(0.0, room) + UNNOTICED)
