"""A copy of the simulated torso, which moves on a clock of its own: for what a plan would come to."""

from copy import copy
from math import inf

from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.bell import EARLY, Bell
from engage_hri.services.control.contract.body import MovementAuthority
from engage_hri.services.control.motion.motion import Motion
from engage_hri.services.control.torso.runs import Run
from engage_hri.services.control.torso.torso import Torso


class Clock(Bell):
    """An instant that only the rehearsal moves: in place of the loop, and of the bell of each run."""

    def __init__(self, at: Seconds) -> None:
        self.at = at

    def time(self) -> Seconds:
        return self.at

    def now(self) -> Seconds:
        return self.at

    def is_past(self, at: Seconds) -> bool:
        return self.at >= at - EARLY

    def ring(self) -> None:
        """Wake nobody: nobody waits."""


def beside(torso: Torso, clock: Clock, world: World) -> Torso:
    """A copy of the torso that moves on `clock`; what it does changes nothing of the torso."""
    motions: dict[int, Motion] = {}

    def copied(motion: Motion) -> Motion:
        return motions.setdefault(id(motion), copy(motion))

    other = copy(torso)
    other.clock, other.world, other.attention = clock, world, copy(torso.attention)
    other.homeward = []
    other.misbelieved = dict(torso.misbelieved)
    other.tracks = {part: copy(track) for part, track in torso.tracks.items()}
    for track in other.tracks.values():
        track.motion, track.trunk = copied(track.motion), other.tracks["torso"]
    runs = {id(run): copy(run) for run in torso.runs.values()}
    for run in runs.values():
        run.motion, run.bell, run.pending = copied(run.motion), clock, list(run.pending)
        run.authority, run.gate = _alike(run), inf
    other.runs = {part: runs[id(run)] for part, run in torso.runs.items()}
    other.base = None
    return other


def _alike(run: Run) -> MovementAuthority:
    """An authority like that of `run`, which the rehearsal may revoke."""
    authority = MovementAuthority(run.behavior, run.authority.through, run.authority.pace)
    if run.authority.held:
        authority.hold()
    if run.authority.revoked is not None:
        authority.revoke(run.authority.revoked)
    return authority
