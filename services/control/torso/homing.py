"""Waiting until parts of the torso have come home, or another behavior has taken one."""

from collections.abc import Collection

from engage_hri.services.control.contract.bell import Bell
from engage_hri.services.control.contract.body import TakenOver
from engage_hri.services.control.torso.torso import Torso


async def wait(torso: Torso, going: Collection[str]) -> None:
    """Return when the motions of the tracks `going` are over. Raises TakenOver."""
    bell, motions = Bell(), [torso.tracks[name] for name in going]
    torso.homeward.append(bell)
    try:
        while not bell.is_past(until := max((track.motion.end for track in motions), default=0.0)):
            await bell.wait(until)
            check(torso, going)
    finally:
        torso.homeward.remove(bell)


def check(torso: Torso, going: Collection[str]) -> None:
    """Raise TakenOver if a behavior has taken any of the parts."""
    if taken := sorted({name.replace("nod", "head") for name in going} & {*torso.runs}):
        raise TakenOver(taken)
