"""A behavior in motion: how far it may go, which sync points are still to come, and the faults that are due."""

from copy import copy
from math import inf

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Hand, Pointing
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.bases import moving_parts
from engage_hri.services.control.contract import variability
from engage_hri.services.control.contract.body import MovementAuthority
from engage_hri.services.control.contract.variability import Deviations
from engage_hri.services.control.figure import choreography
from engage_hri.services.control.figure.course import Course, Situation
from engage_hri.services.control.figure.estimates import hurried
from engage_hri.services.control.motion.motion import Motion, WalkPoint
from engage_hri.services.control.motion.path import Path
from engage_hri.services.runtime.steps import Steps

STALL, OVERHEAT = FAULTS = ("(stall)", "(overheat)")
"""Marks on a path where a fault happens; they are never reported."""


class Run(moving_parts.Run):
    """A behavior that moves the torso along `course`: in the size and at the rate that it is asked for, with faults.

    began: when it was given its parts.
    """

    course: Course

    def __init__(
        self,
        behavior: BlockBehavior,
        course: Course,
        authority: MovementAuthority,
        deviations: Deviations,
        occasion: int,
    ) -> None:
        super().__init__(behavior, course, authority)
        self.began: Seconds = inf
        self.is_lost = False
        """True while its target is where it cannot follow."""
        self.size = 1.0
        """Share of the full amplitude, 0 to 1."""
        self.gate: Seconds = inf
        """Position on its path at which it waits for joints that have not come along; inf: they have."""
        self._aim: tuple[str, Seconds] | None = None
        """The sync point that the rate is set for, with the instant asked for; None: it runs at its own rate."""
        self._tried_aims: list[tuple[str, Seconds]] = []
        """Instants asked for when a smaller path was last looked for."""
        self.cruise = 1.0
        self.faults: dict[str, BodyFault | None] = {}
        """The faults that it has, or has had, by their marks."""
        self._occasion = occasion
        self._take_faults(deviations)

    @property
    def is_setting_out(self) -> bool:
        """True if it has not left its target yet. A shift never does."""
        return self.awaits("stroke_end") or self.course.stays

    def replanned(self, situation: Situation) -> Course:
        """The course of a pointing of the same arm, in another situation. Raises Impossible."""
        assert isinstance(self.behavior, Pointing)
        hand: Hand = "LEFT_HAND" if self.course.parts == ("left_arm",) else "RIGHT_HAND"
        return choreography.plan(replace(self.behavior, mode=hand), situation)

    def play(self, motion: Motion) -> None:
        self.motion = motion
        self._aim = None

    def hurry(self, now: Seconds) -> Steps[Path | None]:
        """Look for a smaller path if this one would miss the instants asked for; None: stay on this one."""
        aims, here = self._aims(now), self.motion.s(now)
        # The point that it is just passing is reported first: no other path has it.
        is_passing = 0.0 < here >= self.motion.path.marks[self.pending[0].sync] - 1e-9
        if is_passing or aims == self._tried_aims:
            return None
        self._tried_aims = aims
        stops = [point.sync for point in self.pending if self.waits_at(point)]
        reduced = yield from hurried(self.course, self.motion, self.size, aims, now, self.cruise, stops)
        if reduced is None:
            return None
        self.size = reduced.size
        return reduced.path

    def keep_pace(self, now: Seconds) -> bool:
        """Set the rate such that it reaches its next point at the instant asked for. True if that is a new aim."""
        marks, limit = self.motion.path.marks, self.limit(self.motion.path)
        # What is asked for behind a point where it has to wait counts once it may pass there.
        aim = next((aim for aim in self._aims(now) if marks[aim[0]] <= limit + 1e-9), None)
        if aim == self._aim:
            return False
        self._aim = aim
        if aim is None:
            self.motion.run_at(self.cruise, now)
        else:
            sync, at = aim
            self.motion.run_at(self.cruise, now)
            waits = any(point.sync == point.held_with == sync for point in self.pending) and not self.may_pass(sync)
            # Who has to wait there until that instant comes at its own pace, if that is in time.
            if not (waits and self.motion.reaches(marks[sync], at)):
                # A slow motor is slow at its fastest, too; up to that rate the body makes up for it.
                self.motion.reach(marks[sync], at, now, self.cruise * self.motion.path.fastest)
        return True

    def foreseen(self, path: Path, now: Seconds) -> Motion:
        """Tell how it would move along another path from now on: as far and as fast as it may and is asked to."""
        trial = copy(self)
        trial.play(Motion(path, now, cruise=self.cruise, limit=self.limit(path)))
        trial.keep_pace(now)
        return trial.motion

    def forget_pace(self, now: Seconds) -> None:
        """Go on at its own rate, until it is next asked to keep its pace."""
        self.motion.run_at(self.cruise, now)
        self._aim = None

    def _aims(self, now: Seconds) -> list[tuple[str, Seconds]]:
        """Sync points ahead that are asked for at an instant, with that instant."""
        marks, here, planned = self.motion.path.marks, self.motion.s(now), self.authority.pace
        coming = (point.sync for point in self.pending if marks.get(point.sync, 0.0) > here + 1e-9)
        return [(sync, planned[sync]) for sync in coming if sync in planned]

    def due(self, point: WalkPoint) -> Seconds | None:
        """Instant at which it reports `point`; None if it may not go so far.

        A point at which the joints rest is reported at the instant asked for, if that is later than its arrival.
        """
        crossing = super().due(point)
        if (
            crossing is None
            or self.waits_at(point)
            or not self.motion.path.rests_at(self.motion.path.marks[point.sync])
        ):
            return crossing
        return max(crossing, self.authority.pace.get(point.sync, crossing))

    def limit(self, path: Path) -> Seconds:
        return min(self.gate, super().limit(path))

    def with_faults(self, path: Path, now: Seconds) -> Path:
        """Mark the faults that are still due on a new path."""
        self._mark_faults(motion := Motion(path, now), now)
        return motion.path

    def deviate(self, deviations: Deviations, now: Seconds) -> None:
        """Take over exactly these faults, in the middle of the motion."""
        before = dict(self.faults)
        self._take_faults(deviations)
        for mark in (mark for mark in FAULTS if self.faults[mark] != before.get(mark)):
            self.motion.path = self.motion.path.unmarked(mark)
        self._mark_faults(self.motion, now)
        if now < self.motion.end:
            self.motion.run_at(self.cruise, now)
            self._aim = None
        if (limit := self.limit(self.motion.path)) < self.motion.limit:
            self.motion.brake(now, limit)
        self.bell.ring()

    def _take_faults(self, deviations: Deviations) -> None:
        """Take over the faults that concern it; one that it has already, or has had, does not begin anew."""
        real = ("head",) if self.course.parts == ("nod",) else self.course.parts
        self.cruise = variability.rate(deviations, real, self.behavior.id, self._occasion)
        due = {
            STALL: variability.stall(deviations, real, self.behavior),
            OVERHEAT: variability.overheating(deviations, real, self.behavior),
        }
        for mark in (mark for mark, fault in due.items() if fault != self.faults.get(mark)):
            self.pending = [point for point in self.pending if point.sync != mark]
            if (fault := due[mark]) is not None:
                before = fault.before or ("stroke" if self.awaits("stroke") else "end")
                syncs = [point.sync for point in self.pending]
                if before in syncs:
                    self.pending.insert(syncs.index(before), WalkPoint(mark, is_told=False))
        self.faults = dict(due)

    def _mark_faults(self, motion: Motion, now: Seconds) -> None:
        """Mark the faults that are due on the path of a motion, half-way from here. One that comes too late to stop
        there does not happen."""
        for point in [each for each in self.pending if each.sync in FAULTS]:
            path, here = motion.path, motion.s(now)
            if point.sync in path.marks:
                continue
            following = self.pending[self.pending.index(point) :]
            before = path.marks[next(each.sync for each in following if each.sync not in FAULTS)]
            earlier = max((mark for mark in path.marks.values() if mark < before), default=0.0)
            half = (max(earlier, here) + before) / 2
            rate = motion.rate(now)
            soonest = here + rate * rate / (2 * path.gentlest_brake)
            if not motion.can_stop_at(half, now):
                half = soonest
            self.pending.remove(point)
            if half <= before:
                motion.path = path.marked(point.sync, half)
                # It comes before all that lies behind it: the ready of a posture, too, which is one with its stroke.
                passed = [each for each in self.pending if motion.path.marks.get(each.sync, inf) < half]
                self.pending.insert(len(passed), point)
