"""End of all that a block still performs: the body is told to stop, and is given time to do so."""

import asyncio
from collections.abc import Mapping

from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.realizer.perform.behavior_run import BehaviorRun
from engage_hri.services.realizer.perform.control_link import ControlLink
from engage_hri.services.realizer.together.live import Ending
from engage_hri.services.requests.silence import unfinished

ABORT: Seconds = 5.0
"""Time that the body may take to end what was aborted before the block ends without it. Ours."""


async def all_ended(
    runs: Mapping[str, BehaviorRun],
    tasks: Mapping[str, asyncio.Task[None]],
    body: ControlLink,
    ending: Ending,
    bus: Bus,
) -> None:
    """Cancel what still runs, and return when all that the body does has ended, or `ABORT` is over."""
    moving = dict[asyncio.Task[None], str]()
    for id, run in runs.items():
        if run.pending is None or tasks[id].done():
            continue
        if run.is_by_body:
            moving[tasks[id]] = id
        if ending.status != "done" and not run.pending.outcome.done():
            body.cancel(id, ending.fault or f"block {ending.status}")
    for task in await unfinished(moving, ABORT, bus):
        # Its request is not to be kept alive: it is over, though the body does not say so.
        body.cancel(moving[task], "its block has ended")
