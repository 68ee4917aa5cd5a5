"""A process that the system has stopped for a while, in virtual time."""

import asyncio
import math

from engage_hri.schemas.units import Seconds
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop


def stand_still(until: Seconds) -> None:
    """Do nothing until then."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualTimeLoop)
    loop._virtual_now = until
    loop._clock_resolution = math.ulp(until)  # type: ignore[attr-defined]
