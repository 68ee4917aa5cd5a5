"""A behavior in motion: how far it may go, which sync points are still to come, and the faults it is due."""

from math import inf

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.units import Seconds
from engage_hri.services.control import variability
from engage_hri.services.control.body import MovementAuthority
from engage_hri.services.control.config import Stall, Variability
from engage_hri.services.control.torso.course import Course, CoursePoint
from engage_hri.services.control.torso.motion import Leg, Motion, Path
from engage_hri.services.control.torso.sizing import hurried
from engage_hri.services.control.waiting import Bell

STALL, OVERHEAT = "(stall)", "(overheat)"
"""Points of a path that only the simulation knows."""


class Run:
    """`course` under `authority`. Its bell rings when the authority changes or another behavior takes over.

    cut_at: when a later behavior took its parts. holding: it waits at a hold point, and stands there soon.
    """

    def __init__(
        self,
        behavior: BlockBehavior,
        course: Course,
        authority: MovementAuthority,
        deviations: Variability,
        occasion: int,
    ) -> None:
        self.behavior = behavior
        self.course = course
        self.authority = authority
        self.bell = Bell()
        self.pending: list[CoursePoint] = list(course.points)
        self.holding = False
        self.cut_at: Seconds | None = None
        self.motion: Motion
        self.size = 1.0
        """Of its full amplitude."""
        self._aim: tuple[str, Seconds] | None = None
        """The sync point for whose sake it is faster or slower than it would be, and its instant."""
        self._tried: list[tuple[str, Seconds]] = []
        """The instants for which it has been made as small as it takes."""
        real = ("head",) if course.parts == ("nod",) else course.parts
        self.cruise = variability.rate(deviations, real, behavior.id, occasion)
        self.stall: Stall | None = variability.stall(deviations, real, behavior)
        if self.stall is not None:
            self._expect(STALL, self.stall.before)
        if variability.overheats(deviations, real):
            self._expect(OVERHEAT, "stroke" if self.awaits("stroke") else "end")

    def awaits(self, sync: str) -> bool:
        return any(point.sync == sync for point in self.pending)

    @property
    def left(self) -> list[str]:
        """Sync points still to be reported."""
        return [point.sync for point in self.pending if point.sync not in (STALL, OVERHEAT)]

    @property
    def is_over(self) -> bool:
        return self.cut_at is not None or self.authority.revoked is not None

    def play(self, motion: Motion) -> None:
        self.motion = motion
        self._aim = None

    def hurry(self, now: Seconds) -> Path | None:
        """A smaller way to go on, if it could not come to its points when it is asked to; None: stay on this one."""
        aims, here = self._aims(now), self.motion.s(now)
        # What it is just passing is told first: no other path has it.
        is_passing = 0.0 < here >= self.motion.path.marks[self.pending[0].sync] - 1e-9
        if is_passing or aims == self._tried:
            return None
        self._tried = aims
        if (reduced := hurried(self.course, self.motion, self.size, aims, now, self.cruise)) is None:
            return None
        self.size = reduced.size
        return reduced.path

    def keep_pace(self, now: Seconds) -> bool:
        """Run such that it comes to its next point when it is asked to; whether that changed anything."""
        aim = next(iter(self._aims(now)), None)
        if aim == self._aim:
            return False
        self._aim = aim
        marks = self.motion.path.marks
        if aim is None:
            self.motion.run_at(self.cruise, now)
        else:
            # A motor that is slow is so at its fastest, too; up to there the body sees to it that it is on time.
            self.motion.come(marks[aim[0]], aim[1], now, self.cruise * self.motion.path.fastest)
        return True

    def _aims(self, now: Seconds) -> list[tuple[str, Seconds]]:
        """Sync points ahead for which it has been given an instant."""
        marks, here, planned = self.motion.path.marks, self.motion.s(now), self.authority.pace
        coming = (point.sync for point in self.pending if marks.get(point.sync, 0.0) > here + 1e-9)
        return [(sync, planned[sync]) for sync in coming if sync in planned]

    def due(self, point: CoursePoint) -> Seconds | None:
        """When it comes to `point`; None if it may not go so far. Where it rests it is in no hurry to say so."""
        mark = self.motion.path.marks[point.sync]
        crossing = self.motion.crossing(mark)
        if crossing is None or not self.motion.path.at(mark).at_rest:
            return crossing
        return max(crossing, self.authority.pace.get(point.sync, crossing))

    def limit(self, path: Path) -> Seconds:
        """How far along `path` it may go now."""
        for point in self.pending:
            if point.sync in (STALL, OVERHEAT) or (point.held_with and not self.authority.covers(point.held_with)):
                return path.marks.get(point.stands_at or point.sync, inf)
        return inf

    @property
    def stands(self) -> bool:
        """Has it come to a stop where it has to wait?"""
        return self.holding and self.bell.is_past(self.motion.end)

    def leave(self, hold: str, now: Seconds) -> list[str]:
        """Wait there no longer; the sync points that it leaves. Where it stands may be another hold point, too."""
        passed = [point.sync for point in self.pending if point.held_with == hold]
        self.pending = [point for point in self.pending if point.held_with != hold]
        following = next(point for point in self.pending if point.sync not in (STALL, OVERHEAT))
        here = self.motion.s(now) + 1e-9
        is_here = following.held_with and self.motion.path.marks[following.sync] <= here
        self.holding = self.stands and bool(is_here)
        return passed

    def with_faults(self, legs: tuple[Leg, ...]) -> tuple[Leg, ...]:
        """`legs` that were made anew, with the faults that are still due."""
        marked = {sync for leg in legs for sync, _ in leg.marks}
        for number, point in enumerate(self.pending):
            if point.sync in (STALL, OVERHEAT) and point.sync not in marked:
                following = next(each.sync for each in self.pending[number:] if each.sync not in (STALL, OVERHEAT))
                legs = tuple(_marked(leg, point.sync, following) for leg in legs)
        return legs

    def cut(self, now: Seconds) -> None:
        """A later behavior has taken over."""
        self.cut_at = now
        self.bell.ring()

    def _expect(self, fault: str, before: str) -> None:
        """Put `fault` half-way to sync point `before`, on the leg that has it."""
        index = next((i for i, point in enumerate(self.pending) if point.sync == before), None)
        if index is None:
            return
        legs = tuple(_marked(leg, fault, before) for leg in self.course.legs)
        self.course = replace(self.course, legs=legs)
        self.pending.insert(index, CoursePoint(fault))


def _marked(leg: Leg, fault: str, before: str) -> Leg:
    fractions = dict(leg.marks)
    if before not in fractions:
        return leg
    earlier = max((fraction for fraction in fractions.values() if fraction < fractions[before]), default=0.0)
    marks = (*leg.marks, (fault, (earlier + fractions[before]) / 2))
    return Leg(goal=leg.goal, velocity=leg.velocity, seconds=leg.seconds, marks=marks)
