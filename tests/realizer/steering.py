"""Requests to hold, continue and stop."""

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Steer, SteerPerformance, SteerRobot
from engage_hri.schemas.requests import Request


def steer(id: str, to: Steer, block: str = "", behavior: str = "") -> tuple[str, Request]:
    """Key and request; without a block for the whole robot."""
    if block:
        return keys.BLOCK, SteerPerformance(id=id, requester="test", to=to, block=block, behavior=behavior)
    return keys.ROBOT, SteerRobot(id=id, requester="test", to=to)
