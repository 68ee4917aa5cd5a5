"""Arms over a table to which the trunk leans: where the trunk may be, and arms that give way. Nothing waits here.

Each path of an arm is laid such that it is clear of the table wherever the trunk is, or is going to be. When it
sets out later, what the arms have still to do is laid anew. A trunk that would take an arm into the table stays.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from copy import copy
from itertools import pairwise
from math import ceil, inf, radians

import numpy as np
from msgspec.structs import replace

from engage_hri.schemas.body import BodyPose, JointLimit
from engage_hri.schemas.units import Meters, Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.bases.moving_parts import MovingParts
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import tracks
from engage_hri.services.control.figure.course import TRUNK, UPRIGHT, Aim, Course, Situation, arm_time
from engage_hri.services.control.figure.estimates import is_arm
from engage_hri.services.control.figure.runs import Run
from engage_hri.services.control.figure.tracks import LIFTS, PartTrack, are_clear, lifted
from engage_hri.services.control.motion.motion import SAME, Motion, Trunk
from engage_hri.services.control.motion.path import Leg, Path
from engage_hri.services.runtime.steps import Steps

APART: Radians = radians(4.0)
"""Greatest angle between two places of the trunk that are looked at."""
UNDER_WAY = 9
"""Places of the trunk on its way that are looked at."""
TELL_APART: Radians = radians(0.25)
"""Places that are nearer to each other count as one: over the table that makes 2 mm."""
ARMS = ("left_arm", "right_arm")
OF_A_WAY = 384
"""Elements that a way on which an arm may give way counts for (see `runtime.steps`)."""
SHORTEST: Seconds = 0.1
"""Least time that is given to catch up with a target."""
LIFTING: Seconds = 0.35
"""Seconds in which an arm that waits is raised."""


class ClearOfTable(MovingParts[Run]):
    """The parts of a torso at its table, with arms that give way to it."""

    tracks: Mapping[str, PartTrack]

    @abstractmethod
    def situation(self, world: World, pose: BodyPose | None = None, *, real: bool = False) -> Situation:
        """Describe what a course starts from. real: with the true joint angles, not those that the body believes."""

    @abstractmethod
    def play(self, run: Run, path: Path, aim: Aim | None) -> None:
        """Let a behavior go along another path from now on. aim: the place that its part is on."""

    def limits(self, run: Run, aim: Aim | None, at: Seconds) -> tuple[JointLimit, ...]:
        """Limits of a path with this aim that begins then."""
        is_free = aim is not None and not self.tracks["torso"].is_still(at, aim)
        return tracks.limits_of(run.course.parts, is_free=is_free)

    def places(self, now: Seconds) -> tuple[Trunk, ...]:
        """Tell where the trunk is now, or then, and where it may be until it rests."""
        track, run = self.tracks["torso"], self.runs.get("torso")
        stops = [track.angles(now)]
        if track.is_moving(now):  # One that is broken off goes on for a while before it turns round.
            stops = [track.angles(at) for at in np.linspace(now, track.motion.end, UNDER_WAY).tolist()]
        if run is not None and _is_setting_out(run, now):
            stops.append(tuple(run.course.on_target[joint] for joint in TRUNK))
        if run is not None:
            stops += self.homes(run.course)
        return way_along([*stops, track.base])

    def homes(self, course: Course) -> list[Trunk]:
        """Tell where a trunk goes that is broken off on this course: back, or upright from a shift."""
        return [UPRIGHT] if course.stays else [self.tracks["torso"].base]

    def check(self, course: Course, path: Path, pose: Mapping[str, float] | None) -> Steps[None]:
        """Check that arms can be kept clear of the table while the trunk moves along `path`. Raises Impossible.

        pose: of arms that rest; None: they are where they are, and do what they do.
        """
        columns = [course.joints.index(joint) for joint in TRUNK]
        leaning = [tuple(place) for place in path.positions(tracks.ALONG)[:, columns].tolist()]
        around = way_along([*leaning, *self.homes(course)])
        for part in ARMS:
            if part in course.parts:
                continue
            run = None if pose is not None else self.runs.get(part)
            if pose is not None:
                joints = self.tracks[part].joints
                is_clear = _are_clear([pose[joint] for joint in joints], joints, around)
            else:
                is_clear = yield from self._stays_clear(part, course, Motion(path, self.clock.time()), around)
            if not is_clear:
                doing = "is there" if run is None else f"has {run.behavior.id!r} to do"
                reason = f"the {part.replace('_', ' ')} would come into the table as the torso leans: it {doing}"
                raise Impossible("CANNOT_CREATE_BEHAVIOR", reason)

    def _stays_clear(self, part: str, course: Course, leaning: Motion, around: tuple[Trunk, ...]) -> Steps[bool]:
        """True if an arm is clear of a trunk that moves so, or can be kept clear of it."""
        track, now = self.tracks[part], self.clock.time()
        if _is_clear(track, around, now):
            return True
        columns = [course.joints.index(joint) for joint in TRUNK]
        run = self.runs.get(part)
        if run is not None and not set(run.course.parts).isdisjoint(course.parts):  # It is taken over, and goes home.
            target = tuple(course.on_target[joint] for joint in TRUNK)
            return _are_clear(track.base, track.joints, (target, *map(tuple, self.homes(course))))
        if run is not None:
            found = yield from self._given_way(run, course.on_target, around, leaning, columns)
            return found is not None
        return (
            track.aim is None
            and _are_clear(track.motion.at(inf).q[track.columns].tolist(), track.joints, around)
            and _least_above(track.motion, track.columns, track.joints, None, leaning, columns, now) >= 0.0
        )

    def check_carried(self, course: Course, path: Path) -> None:
        """Check that an arm on its way to a place is clear of the table on a trunk that moves. Raises Impossible."""
        trunk, now = self.tracks["torso"], self.clock.time()
        columns, every = range(trunk.columns.start, trunk.columns.stop), range(len(course.joints))
        if (
            is_arm(course)
            and _least_above(Motion(path, now), every, course.joints, course.aim, trunk.motion, columns, now) < 0.0
        ):
            raise Impossible("CANNOT_CREATE_BEHAVIOR", "the table is in the way of the arm, as the torso moves")

    def give_way(self) -> Steps[None]:
        """Lay anew what arms have still to do, if the trunk that has just set out would take them into the table."""
        now = self.clock.time()
        around, trunk = self.places(now), self.tracks["torso"]
        for part in ARMS:
            run = self.runs.get(part)
            if run is None or "torso" in run.course.parts or _is_clear(self.tracks[part], around, now):
                continue
            columns = range(trunk.columns.start, trunk.columns.stop)
            going = self.situation(self.world, real=True).pose
            found = yield from self._given_way(run, going, around, trunk.motion, columns)
            if found is not None:
                run.course, path = found
                self.play(run, path, run.course.aim)
                run.bell.ring()

    def _given_way(
        self,
        run: Run,
        going: Mapping[str, float],
        around: tuple[Trunk, ...],
        trunk: Motion,
        columns: Sequence[int],
    ) -> Steps[tuple[Course, Path] | None]:
        """The rest of what an arm does, clear of the table; None: there is no way.

        going: where the trunk is going to be, as angles. trunk, columns: its motion, and its joints in that.
        """
        now = self.clock.time()
        if run.course.aim is not None:
            situation = self.situation(self.world, real=True)
            pose = {**situation.pose, **{joint: going[joint] for joint in TRUNK}}
            try:
                course = run.replanned(replace(situation, pose=pose, trunks=around))
            except Impossible:
                return None
            yield OF_A_WAY
            path = self.relaid(run, course, now)
            if path is None or not _are_clear(path.legs[-1].goal, course.joints, around):
                return None
            motion, every = run.foreseen(path, now), range(len(course.joints))
            is_clear = _least_above(motion, every, course.joints, course.aim, trunk, columns, now) >= 0.0
            return (course, path) if is_clear else None
        start = tracks.joined([self.tracks[part].at(now) for part in run.course.parts])
        here = tuple(start.q.tolist())
        joints, left = (
            run.course.joints,
            run.motion.path.after(run.motion.s(now), [point.sync for point in run.pending]),
        )
        poses = [leg.goal for leg in left[:-1]] + [here] * run.holding
        lifts = LIFTS if poses else LIFTS[:1]  # What goes home at once is the same for all.
        groups = [[lifted(joints, pose, lift) for pose in poses] for lift in lifts]
        is_possible = are_clear(joints, groups, around) if poses else [True]
        for lift in (lift for lift, is_clear in zip(lifts, is_possible, strict=True) if is_clear):
            legs = tuple(replace(leg, goal=lifted(joints, leg.goal, lift)) for leg in left[:-1]) + left[-1:]
            if run.holding and legs:
                waiting = tuple((sync, 1.0) for sync, at in legs[0].marks if at <= 0.0)
                rest = tuple(mark for mark in legs[0].marks if mark[1] > 0.0)
                raised = Leg(goal=lifted(joints, here, lift), seconds=LIFTING, marks=waiting)
                legs = (raised, replace(legs[0], marks=rest), *legs[1:])
            yield OF_A_WAY
            path = Path(start, legs, tracks.limits_of(run.course.parts))
            since = legs[0].seconds if len(legs) > 1 else path.length
            if tracks.meets_table(path, joints, around, since=since):
                if not _are_clear(path.legs[-1].goal, joints, around):
                    return None  # All of them end there.
                continue
            motion = run.foreseen(path, now)
            if _least_above(motion, range(len(joints)), joints, None, trunk, columns, now) >= 0.0:
                return replace(run.course, trunks=around), path
        return None

    def keep_clear(self, run: Run) -> None:
        """Let an arm that is slowed go at its own pace, if the trunk would come with it into the table otherwise."""
        now, trunk = self.clock.time(), self.tracks["torso"]
        parts = [part for part in run.course.parts if part in ARMS]
        if not parts or "torso" in run.course.parts or not trunk.is_moving(now):
            return
        around = self.places(now)
        if all(_is_clear(self.tracks[part], around, now) for part in parts):
            return
        own = copy(run.motion)
        own.run_at(run.cruise, now)
        columns, every = range(trunk.columns.start, trunk.columns.stop), range(len(run.course.joints))
        asked_for, free = (
            _least_above(motion, every, run.course.joints, self.tracks[parts[0]].aim, trunk.motion, columns, now)
            for motion in (run.motion, own)
        )
        if asked_for < 0.0 and asked_for < free:
            run.forget_pace(now)

    def relaid(self, run: Run, course: Course, now: Seconds) -> Path | None:
        """Path for the rest of a pointing whose target, or arm, is to be elsewhere; None: it is on its way home.

        course: to where it is to be.
        """
        if not run.awaits("stroke_end"):
            return None
        start = self.tracks[run.course.parts[0]].start_at(now, course.aim)
        left = run.motion.path.after(run.motion.s(now), [point.sync for point in run.pending])
        here = tuple(start.q.tolist())
        if len(left) == 1:  # It waits at the end of its stroke.
            waiting = tuple((sync, 1.0) for sync, _ in left[0].marks if run.awaits(sync) and sync == "stroke_end")
            goal, last = course.legs[-2].goal, course.legs[-1]
            legs = [Leg(goal=goal, seconds=arm_time(here, goal, SHORTEST, 150.0), marks=waiting), last]
        else:
            new = course.legs[-len(left) :]
            legs = [replace(leg, goal=to.goal, velocity=to.velocity) for leg, to in zip(left, new, strict=True)]
            least = arm_time(here, legs[0].goal, 0.0, 150.0) - 0.15
            legs[0] = replace(legs[0], seconds=max(legs[0].seconds, least))
        return Path(start, tuple(legs), self.limits(run, course.aim, now))


def _is_setting_out(run: Run, at: Seconds) -> bool:
    """True if a behavior of the trunk has not left its target by then, as it moves now."""
    marks = run.motion.path.marks
    leaves = run.motion.crossing(marks.get("relax", marks["end"]))
    return run.is_setting_out and (leaves is None or at <= leaves)


def way_along(stops: Sequence[Sequence[float]]) -> tuple[Trunk, ...]:
    """List these places of the trunk and some between them, each once."""
    found = {_cell(stops[0]): _snapped(stops[0])}
    for (turn, lean), (next_turn, next_lean) in pairwise(stops):
        steps = max(1, ceil(max(abs(next_turn - turn), abs(next_lean - lean)) / APART))
        for share in (step / steps for step in range(1, steps + 1)):
            place = (turn + share * (next_turn - turn), lean + share * (next_lean - lean))
            found.setdefault(_cell(place), _snapped(place))
    return tuple(found.values())


def _cell(place: Sequence[float]) -> tuple[int, int]:
    turn, lean = place
    return round(turn / TELL_APART), round(lean / TELL_APART)


def _snapped(place: Sequence[float]) -> Trunk:
    return UPRIGHT if _is_same(place, UPRIGHT) else tuple(place)


def _is_same(one: Sequence[float], other: Sequence[float]) -> bool:
    return all(abs(a - b) < SAME for a, b in zip(one, other, strict=True))


def _least_above(
    arms: Motion,
    which: Sequence[int] | slice,
    joints: tuple[str, ...],
    aim: Aim | None,
    trunk: Motion,
    columns: Sequence[int],
    now: Seconds,
) -> Meters:
    """Least distance by which arms stay out of the table as both move at once. which: joints of their motion."""
    until = max(arms.end, trunk.end)
    if aim is not None:  # Its way home is laid when it leaves its target.
        until = arms.crossing(arms.path.marks.get("stroke_end", inf)) or until
    at = np.linspace(now, until, tracks.MOMENTS)
    leaning, angles = trunk.positions(at)[:, list(columns)], arms.positions(at)[:, which]
    if aim is not None:
        angles = aim.within(angles + aim.offsets(leaning))
    return tracks.above_table_along(angles, joints, leaning)


def _are_clear(pose: Sequence[float], joints: tuple[str, ...], around: tuple[Trunk, ...]) -> bool:
    """True if arms that rest in a pose are clear of the table wherever the trunk is."""
    return tracks.above_table(np.array([pose]), joints, np.array(around)) >= 0.0


def _is_clear(track: PartTrack, around: tuple[Trunk, ...], now: Seconds) -> bool:
    """True if what is left of the motion of an arm stays clear of the table wherever the trunk is."""
    path, s = track.motion.path, track.motion.s(now)
    until = path.length if track.aim is None else max(s, path.marks.get("stroke_end", 0.0))
    shares = np.linspace(s, until, len(tracks.ALONG)) / (path.length or 1.0)
    angles, trunks = path.positions(shares)[:, track.columns], np.array(around)
    if track.aim is None:
        return tracks.above_table(angles, track.joints, trunks) >= 0.0
    on_target = track.aim.within(angles[:, None] + track.aim.offsets(trunks))
    return tracks.above_table_along(on_target, track.joints, trunks) >= 0.0
