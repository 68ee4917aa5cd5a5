"""A behavior under way on Reachy Mini: the one track that it moves, and the patience with its joints."""

from math import inf

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.bases import walk
from engage_hri.services.control.contract.body import MovementAuthority
from engage_hri.services.control.figure.course import Course
from engage_hri.services.control.motion.path import Path
from engage_hri.services.control.reachy_mini.watching import Watch


class Run(walk.Run):
    """A behavior that moves a track along `course`. patience: seconds without way after which its joints are stuck.

    watch: of its joints, since they have last come to one of its sync points.
    """

    def __init__(
        self, behavior: BlockBehavior, course: Course, authority: MovementAuthority, patience: Seconds
    ) -> None:
        super().__init__(behavior, course.points, authority)
        self.course = course
        self._patience = patience
        self.look_anew()

    def look_anew(self) -> None:
        """Give its joints the whole patience again."""
        self.watch = Watch(self._patience)

    @property
    def track(self) -> str:
        """Name of the track that it moves."""
        return self.course.parts[0]

    @property
    def is_swing(self) -> bool:
        """True for a nod: its way runs through to its end."""
        return self.track == "nod"

    @property
    def stays(self) -> bool:
        """True for a shift: it goes nowhere from its goal."""
        return len(self.course.points) == 2

    @property
    def has_arrived(self) -> bool:
        """True once it has been at its goal."""
        return not self.awaits(self.course.arrival)

    @property
    def is_homeward(self) -> bool:
        """True once it has left its goal for where its track belongs."""
        return not self.is_swing and not self.stays and len(self.pending) == 1

    def limit(self, path: Path) -> Seconds:
        # What goes to a goal stops there by itself: its way home is laid once it leaves.
        return super().limit(path) if self.is_swing else inf

    def is_start(self, sync: str) -> bool:
        """True for a point at which it only begins: nothing has to be anywhere."""
        first = next(point for point in self.course.points if point.sync == sync)
        return sync == "start" or not (self.is_swing or self.stays or first.held_with or sync == "end")

    def leave_instant(self, now: Seconds) -> list[str]:
        """Pass all points of the next instant; return them."""
        point = self.pending[0]
        if point.held_with:
            return self.leave(point.held_with, now)
        passed = [point.sync]
        if self.is_start(point.sync):
            passed = [each.sync for each in self.pending if self.is_start(each.sync)]
        self.pending = self.pending[len(passed) :]
        return passed
