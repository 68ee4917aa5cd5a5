"""A behavior under way on Reachy Mini: its motion, the sync points to come, and how far it may go."""

from math import inf

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.bell import Bell
from engage_hri.services.control.contract.body import MovementAuthority
from engage_hri.services.control.motion.motion import Motion
from engage_hri.services.control.motion.path import Path
from engage_hri.services.control.reachy_mini.courses import Course, Instant


class Run:
    """A behavior that is being performed. bell: rings when its authority, its joints or its target have news.

    pending: instants that it has not passed. is_beneath: a shift that a look lies over moves no more. waits: it
    stands at a hold point until it may go on.
    """

    def __init__(self, behavior: BlockBehavior, course: Course, authority: MovementAuthority) -> None:
        self.behavior = behavior
        self.course = course
        self.authority = authority
        self.bell = Bell()
        self.pending: list[Instant] = list(course.instants)
        self.motion: Motion
        self.is_beneath = False
        self.waits = False
        self._is_held = False
        self._missed: frozenset[str] = frozenset()
        """Hold points at which it could not stop any more when it was told to wait."""

    @property
    def has_arrived(self) -> bool:
        """True once it has been at its goal."""
        return not any(self.course.arrival in instant.syncs for instant in self.pending)

    @property
    def is_homeward(self) -> bool:
        """True once it has left its goal for where its track belongs."""
        return not self.course.is_swing and not self.course.stays and len(self.pending) == 1

    def may_pass(self, hold: str) -> bool:
        """True if it may go on from a hold point now, or has to, since it could stop there no more."""
        return not hold or self.authority.covers(hold) or hold in self._missed

    def limit(self, path: Path) -> Seconds:
        """Position on `path`, in its natural seconds, up to which it may go now. Who goes to a goal stops there."""
        for instant in self.pending if self.course.is_swing else ():
            if not self.may_pass(instant.hold):
                return path.marks.get(instant.hold, inf)
        return inf

    def due(self, instant: Instant) -> Seconds | None:
        """Time at which the plan is at an instant; None: it does not go so far yet."""
        mark = self.motion.path.marks.get(instant.syncs[0])
        return None if mark is None else self.motion.crossing(mark)

    def regulate(self, now: Seconds) -> None:
        """Let the motion go as far as the authority permits. Held, it stops at the next place where it can."""
        is_news, self._is_held = self.authority.held and not self._is_held, self.authority.held
        if not self._is_held:
            self._missed = frozenset()
        elif is_news:
            marks = self.motion.path.marks
            self._missed = frozenset(
                instant.hold
                for instant in self.pending
                if instant.hold
                and self.authority.is_granted(instant.hold)
                and not self.motion.can_stop_at(marks.get(instant.hold, inf), now)
            )
        limit = self.limit(self.motion.path)
        if limit < self.motion.limit and limit < self.motion.path.length + 1e-9:
            self.motion.brake(now, limit)
        else:
            self.motion.extend(limit, now)
