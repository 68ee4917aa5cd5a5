"""Requests to hold, continue and stop."""

from itertools import count

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import PerformanceSteered, Steer, SteerPerformance, SteerRobot
from engage_hri.schemas.requests import Request
from tests.realizer.stage import Stage

NUMBERS = count()


def steer(id: str, to: Steer, block: str = "", behavior: str = "") -> tuple[str, Request]:
    """Key and request; without a block for the whole robot."""
    if block:
        return keys.BLOCK, SteerPerformance(id=id, requester="test", to=to, block=block, behavior=behavior)
    return keys.ROBOT, SteerRobot(id=id, requester="test", to=to)


async def steered(seen: Stage, to: Steer, block: str = "", behavior: str = "") -> tuple[str, ...]:
    """Steer, and return the blocks that it concerned."""
    outcome = await seen.requests.send(*steer(f"steer-{next(NUMBERS)}", to, block, behavior)).outcome
    assert isinstance(outcome, PerformanceSteered)
    return outcome.blocks
