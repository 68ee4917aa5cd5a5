"""Shifts of the base gaze while a look has the head: they move nothing, but set what the look goes home to.

A shift says where the head belongs. Its `end` says that this holds: the head is there, or a look lies over it.
"""

from collections.abc import AsyncGenerator

from engage_hri.services.control.contract.bell import Bell
from engage_hri.services.control.contract.body import MovementAuthority, Progress, Reached


async def pass_end(authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
    """Report the `end` of a shift under a look: at once, or at the instant that is asked for."""
    bell = Bell()
    now = bell.now()
    unwatch = authority.watch(bell.ring)
    try:
        while authority.revoked is None and not bell.is_past(due := authority.pace.get("end", now)):
            await bell.wait(due)
    finally:
        unwatch()
    if authority.revoked is None:
        yield Reached("end", at := bell.now(), at)
