"""Requests to hold, continue, stop and interrupt."""

from itertools import count

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import InterruptBehavior, PerformanceSteered, Steer, SteerPerformance, SteerRobot
from engage_hri.schemas.requests import Request
from engage_hri.services.requests.ends import Pending, Requester
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


def interrupt(requests: Requester, block: str, behavior: str) -> Pending:
    """End a behavior on request."""
    request = InterruptBehavior(id=f"i-{block}-{behavior}", requester="test", block=block, behavior=behavior)
    return requests.send(keys.BLOCK, request)
