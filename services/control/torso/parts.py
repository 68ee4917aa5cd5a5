"""Parts of the torso as whoever lays motions for them sees them: where they are, whose they are, how to move them."""

from typing import Protocol

from engage_hri.schemas.body import BodyPose, JointLimit
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.figure.aiming import Aim
from engage_hri.services.control.figure.course import Situation
from engage_hri.services.control.figure.tracks import Track
from engage_hri.services.control.motion.path import Path
from engage_hri.services.control.torso.head import Fixation
from engage_hri.services.control.torso.runs import Run


class Clock(Protocol):
    """Source of the time."""

    def time(self) -> Seconds: ...


class Parts(Protocol):
    """The parts of a torso. runs: the behavior that has a part, by the part. attention: where the head belongs."""

    clock: Clock
    world: World
    tracks: dict[str, Track]
    runs: dict[str, Run]
    attention: Fixation

    def situation(self, world: World, pose: BodyPose | None = None, *, real: bool = False) -> Situation:
        """Describe what a course starts from. real: with the true joint angles, not those that the body believes."""
        ...

    def play(self, run: Run, path: Path, aim: Aim | None) -> None:
        """Let a behavior go along another path from now on. aim: the place that its part is on."""
        ...

    def limits(self, run: Run, aim: Aim | None, at: Seconds) -> tuple[JointLimit, ...]:
        """Limits of a path with this aim that begins then."""
        ...
