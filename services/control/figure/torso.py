"""The parts of the simulated torso: along which paths they move, and what they follow. Nothing waits here.

Time is that of a clock: of the event loop for the body, of its own for a rehearsal.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from math import degrees, inf, radians

import numpy as np
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Pointing
from engage_hri.schemas.body import BodyPose, Estimate, JointLimit, NoPointZone
from engage_hri.schemas.units import Meters, Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.bases.moving_parts import Clock
from engage_hri.services.control.contract.body import MovementAuthority
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.contract.variability import Deviations
from engage_hri.services.control.figure import choreography, head, kinematics, tracks
from engage_hri.services.control.figure.course import NECK, TRUNK, Aim, Course, Situation, return_time
from engage_hri.services.control.figure.estimates import Added, going_home, motion_estimate
from engage_hri.services.control.figure.head import Fixation
from engage_hri.services.control.figure.repertoire import Repertoire
from engage_hri.services.control.figure.runs import Run
from engage_hri.services.control.figure.table_clearance import ARMS, SHORTEST, ClearOfTable, way_along
from engage_hri.services.control.figure.tracks import PartTrack
from engage_hri.services.control.motion.motion import Motion, WalkPoint, is_shift
from engage_hri.services.control.motion.path import JointMotion, Leg, Path, resting
from engage_hri.services.runtime.steps import Steps, finished

NOTICEABLE: Meters = 0.01
"""A target that moves less does not move an arm."""
BEHIND: Radians = radians(2.0)
"""Angle by which eyes may be behind a target that moves, and be on it."""
BESIDE: Meters = 0.03
"""Distance by which a forearm may be behind it."""
STEP: Seconds = 0.02
"""Seconds between two looks at where the trunk will be."""
Angles = Mapping[str, float]
"""True angles of displaced joints, radians."""


class Torso(ClearOfTable):
    """The parts of a torso. attention: where the head belongs.

    misbelieved: angles at which the body believes joints that are elsewhere.
    """

    def __init__(
        self, clock: Clock, zones: tuple[NoPointZone, ...], repertoire: Repertoire, displaced: dict[str, float]
    ) -> None:
        super().__init__(clock, {name: PartTrack(name, tracks.home_of(name, displaced)) for name in tracks.LIMITS})
        self.zones = zones
        self.repertoire = repertoire
        self.misbelieved = {joint: kinematics.HOME[joint] for joint in displaced}
        self.attention = Fixation()

    # -- planning -----------------------------------------------------------------------------------------------

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World, only: str = "") -> Estimate:
        """Estimate a movement by itself, from `pose` or from where its parts are. only: what is asked of a look or a
        point, as of `EstimateItem`."""
        try:
            situation = self.situation(world, pose)
            course = choreography.plan(behavior, situation)
            is_moving = pose is None and not self.misbelieved
            path = self.path(course, None if is_moving else situation)
            only = only if isinstance(behavior, Gaze | Pointing) else ""
            return self.told(behavior, course, path, situation, moving=is_moving, only=only)
        except Impossible as impossible:
            return impossible.estimate(behavior)

    def pose(self, world: World, pose: BodyPose | None) -> BodyPose:
        """Pose of all joints: those of `pose`, and where the others are."""
        return kinematics.pose_message(self.situation(world, pose).pose)

    def told(
        self, behavior: BlockBehavior, course: Course, path: Path, situation: Situation, *, moving: bool = True,
        only: str = "",
    ) -> Estimate:  # fmt: skip
        """Estimate a movement along a path that was laid for it. moving: it begins now, from where its parts are."""
        added = self._added(course, path) if moving or course.turns_trunk else None
        estimate = motion_estimate(behavior, course, path, situation.pose, added, only)
        leaves = next((point.sync for point in course.points if is_last_on_target(behavior, point.sync)), "")
        if added is None or not leaves or only:
            return estimate
        # The trunk has the part elsewhere by then, so its way home is another one.
        now, run = self.clock.time(), Run(behavior, course, MovementAuthority(behavior, leaves), Deviations(), 0)
        back = self.way_home(run, Motion(path, now), now + path.marks[leaves])
        return estimate if back is None else going_home(estimate, leaves, back)

    def _added(self, course: Course, path: Path) -> Added | None:
        """Tell what the trunk adds to a path that begins now; None: nothing."""
        now, aim, torso = self.clock.time(), course.aim, self.tracks["torso"]
        if aim is None:
            return None
        if course.turns_trunk:
            count = len(aim.joints)
            return lambda seconds: np.append(aim.offset(path.position(seconds)[count:]), np.zeros(len(TRUNK)))
        return (lambda seconds: aim.offset(torso.angles(now + seconds))) if self.is_carried(course) else None

    def situation(self, world: World, pose: BodyPose | None = None, *, real: bool = False) -> Situation:
        """Describe what a course starts from. real: with the true joint angles, not those that the body believes."""
        now = self.clock.time()
        here = {"neck_roll": 0.0}
        """A tilt is on top of the gaze, like a nod: it is no part of where the head is."""
        for part, track in self.tracks.items():
            if part != "nod":
                here.update(zip(track.joints, track.angles(now), strict=True))
        # Paths of head and arms are laid for where the torso is going to be.
        torso, leaning = self.tracks["torso"], self.runs.get("torso")
        trunk = torso.angles(now) if real or not self.misbelieved else None
        here.update(zip(torso.joints, torso.angles(max(now, torso.motion.end)), strict=True))
        if leaning is not None and leaning.is_setting_out and torso.is_moving(now):
            here.update((joint, leaning.course.on_target[joint]) for joint in torso.joints)
        if not real:
            here.update(self.misbelieved)
        rest = {**tracks.bases(self.tracks), **self._gaze_at_rest(here)}
        is_sure = real or self.misbelieved.keys().isdisjoint(TRUNK)
        here_only = [[here[joint] for joint in TRUNK]]
        trunks = self.places(now) if is_sure else way_along(here_only)
        described = Situation(here, rest, world, self.zones, tuple(self.runs), self.repertoire, trunk, trunks)
        return described if pose is None else self.placed(described, pose)

    def placed(self, situation: Situation, pose: BodyPose) -> Situation:
        """The same situation with the joints at rest in `pose`, as far as it has them."""
        here, rest = tracks.updated(situation.pose, pose), situation.rest
        if any(here[joint] != situation.pose[joint] for joint in TRUNK):
            rest = {**rest, **self._gaze_at_rest(here)}
        trunks = way_along([[here[joint] for joint in TRUNK]])
        return replace(situation, pose=here, rest=rest, trunk=None, trunks=trunks)

    def _gaze_at_rest(self, pose: Mapping[str, float]) -> dict[str, float]:
        """Angles to which the head goes back, with the trunk as in `pose`."""
        return dict(zip(NECK, self.attention.angles_at([pose[joint] for joint in TRUNK]), strict=True))

    def path(self, course: Course, situation: Situation | None = None) -> Path:
        """Lay a path along `course`. Raises Impossible.

        situation: start at rest in its pose; None: start from where the parts are, as they move.
        """
        return finished(self.laid(course, situation))

    def laid(self, course: Course, situation: Situation | None = None) -> Steps[Path]:
        """The same in steps, of a torso that stands still meanwhile."""
        start = self.start(course, situation)
        if situation is None and self.is_carried(course):
            return self._path_on_the_move(start, course)
        path = self._path(start, course)
        if "torso" in course.parts:
            yield from self.check(course, path, None if situation is None else situation.pose)
        return path

    def _path(self, start: JointMotion, course: Course, *, is_free: bool = False) -> Path:
        """Lay a path along a course that is clear of the table. Raises Impossible.

        is_free: for a trunk that moves, without the ranges of joints (`tracks.limits_of`); who asks minds the table.
        """
        is_free |= course.turns_trunk
        path = Path(start, course.legs, tracks.limits_of(course.parts, is_free=is_free))
        # What is on a place is planned such that it is clear there wherever the trunk is; its way home is laid anew.
        trunks = course.trunks if course.aim is None else course.trunks[:1]
        if not is_free and tracks.meets_table(path, course.joints, trunks):
            raise Impossible("CANNOT_CREATE_BEHAVIOR", "the table is in the way of the arm")
        return path

    def start(self, course: Course, situation: Situation | None = None) -> JointMotion:
        """State in which a path along `course` begins. situation: as for `path`."""
        if situation is None or course.parts == ("nod",):
            return self._states(course.parts, course.aim)
        pose = dict(situation.pose)
        if course.aim is not None:
            pose |= zip(course.aim.joints, situation.start(course.aim), strict=True)
        return resting([pose[joint] for joint in course.joints])

    def _states(self, parts: Sequence[str], aim: Aim | None) -> JointMotion:
        """State in which a path begins now whose first part has this aim."""
        now = self.clock.time()
        return tracks.joined([self.tracks[part].start_at(now, aim if part == parts[0] else None) for part in parts])

    def is_carried(self, course: Course) -> bool:
        """True if a trunk that it does not turn itself moves what goes along `course` to a target."""
        if course.aim is None or course.turns_trunk:
            return False
        return not self.tracks["torso"].is_still(self.clock.time(), course.aim)

    def _path_on_the_move(self, start: JointMotion, course: Course) -> Path:
        """Lay a path to a target while the trunk moves: it arrives when the target is in reach. Raises Impossible."""
        path = self._path(start, course, is_free=True)
        point = course.arrival
        if delay := self._delay(course.aim, self.clock.time() + path.marks[point]):
            path = self._path(start, replace(course, legs=_delayed(course.legs, point, delay)), is_free=True)
        self.check_carried(course, path)
        return path

    def is_off_target(self, run: Run, sync: str) -> bool:
        """True if `sync` says that a behavior is on its target, which is out of reach."""
        aim, trunk = run.course.aim, self.tracks["torso"].angles(self.clock.time())
        is_claim = sync == run.course.arrival or (isinstance(run.behavior, Pointing) and sync == "stroke_end")
        return aim is not None and is_claim and (run.is_lost or not aim.is_in_reach(trunk))

    # -- motion -------------------------------------------------------------------------------------------------

    def take_over(self, run: Run) -> None:
        finished(self.taken_over(run, self.path(run.course)))

    def taken_over(self, run: Run, path: Path) -> Steps[None]:
        """The same in steps along a path that is laid, of a torso that stands still meanwhile."""
        run.began = self.clock.time()
        for joint in run.course.joints:
            self.misbelieved.pop(joint, None)
        left = self.take(run)
        if isinstance(run.behavior, choreography.SETTLING):
            self._rest_there(run.course, run.course.parts)
        elif run.course.turns_trunk:
            self._rest_there(run.course, ("torso",))
        self.play(run, path, run.course.aim)
        self.relax(left)
        if "torso" in run.course.parts:
            self._wait_for_reach()
            yield from self.give_way()

    def _rest_there(self, course: Course, parts: Collection[str]) -> None:
        """Let parts go home to the target of a course from now on."""
        for track in (self.tracks[name] for name in parts):
            track.base = tuple(course.on_target[joint] for joint in track.joints)

    def play(self, run: Run, path: Path, aim: Aim | None) -> None:
        now, run.gate = self.clock.time(), inf
        path = run.with_faults(path, now)
        run.play(Motion(path, now, cruise=run.cruise, limit=run.limit(path)))
        column = 0
        for part in run.course.parts:
            self.tracks[part].play(run.motion, column, aim if part == run.course.parts[0] else None)
            column += len(self.tracks[part].joints)
        self.attention.follow_run(run, now)

    def leave(self, run: Run, point: WalkPoint, *, has_waited: bool) -> Sequence[str]:
        if has_waited:
            return self.leave_hold(run, point.held_with)
        run.pending.pop(0)
        if is_last_on_target(run.behavior, point.sync):
            self.leave_target(run)
        self.attention.follow_run(run, self.clock.time())
        return [point.sync]

    def leave_target(self, run: Run) -> None:
        """Let a part that leaves its target move with the trunk again, or be on the base gaze.

        Its way home is laid anew if the trunk or a shift has made another of it.
        """
        now = self.clock.time()
        track, aim = self.tracks[run.course.parts[0]], self._home(run)[1]
        if (path := self.way_home(run, run.motion, now)) is not None:
            self.play(run, path, aim)
        else:
            track.aim = None if aim is None else aim.at(track.trunk.angles(now))

    def way_home(self, run: Run, motion: Motion, at: Seconds) -> Path | None:
        """The way home of a behavior that leaves its target then; None: as it was laid."""
        assert run.course.aim is not None
        torso, (goal, aim) = self.tracks["torso"], self._home(run)
        if torso.is_still(at, run.course.aim):
            base = goal if aim is None else tuple((aim.offset(torso.angles(at)) + goal).tolist())
            if not head.differ(run.course.legs[-1].goal, base):
                return None
        trunk = torso.at(at)
        start = run.course.aim.added(motion.at(at), trunk)
        start = start if aim is None else aim.removed(start, trunk)
        return self._path_home(run, start, goal, self.limits(run, aim, at), at)

    def _path_home(
        self, run: Run, start: JointMotion, goal: tuple[float, ...], limits: tuple[JointLimit, ...], at: Seconds
    ) -> Path:
        """Path from a target to where the part belongs, from then on; of an arm a way that is clear of the table."""
        leg = _leg_home(run, start, goal)
        path = Path(start, (leg,), limits)
        if run.course.parts != ("head",):
            trunks = self.places(at)
            for above in tracks.raised(tuple(start.q.tolist()), run.course.joints):
                if not tracks.meets_table(path, run.course.joints, trunks):
                    break
                first = Leg(goal=above, seconds=tracks.RAISING, marks=leg.marks[:1])
                legs = (first, replace(leg, marks=leg.marks[1:]))
                path = Path(start, legs, limits)
        return path

    def _home(self, run: Run) -> tuple[tuple[float, ...], Aim | None]:
        """Angles to which a behavior goes home, and the place that its part is on there."""
        if run.course.parts == ("head",):
            return self.attention.angles, self.attention.aim
        return run.course.legs[-1].goal, None

    def leave_hold(self, run: Run, hold: str) -> list[str]:
        """Let `run` go on from a hold point, on a new path if it stands still. Returns the sync points it passes."""
        now = self.clock.time()
        stood, passed = run.stands, run.leave(hold, now)
        if stood and not run.holding and not run.is_over:
            goal, aim = self._home(run)
            is_homeward = any(is_last_on_target(run.behavior, sync) for sync in passed)
            aim = aim if is_homeward else run.course.aim
            start = self._states(run.course.parts, aim)
            legs = run.motion.path.after(run.motion.s(now), [point.sync for point in run.pending])
            limits = self.limits(run, aim, now)
            path = self._path_home(run, start, goal, limits, now) if is_homeward else None
            self.play(run, path or Path(start, legs, limits), aim)
        return passed

    def extend(self, run: Run) -> None:
        finished(self.extended(run))

    def extended(self, run: Run) -> Steps[None]:
        """The same in steps, of a torso that stands still meanwhile."""
        now = self.clock.time()
        if (path := (yield from run.hurry(now))) is not None:
            self.play(run, path, self.tracks[run.course.parts[0]].aim)
        limit = run.limit(run.motion.path)
        is_extended = limit > run.motion.limit
        run.motion.extend(limit, now)
        run.brake_for_hold(now)
        is_paced = run.keep_pace(now)
        if is_paced:
            self.keep_clear(run)
        if is_paced or is_extended:
            self.attention.follow_run(run, now)

    def deviate(self, deviations: Deviations) -> None:
        """Give exactly these faults to what is under way."""
        now = self.clock.time()
        for run in dict.fromkeys(self.runs.values()):
            run.deviate(deviations, now)
            self.attention.follow_run(run, now)

    def abandon(self, run: Run) -> None:
        if is_shift(run.behavior):
            self._stay(run)
            self.attention.expect("", 0.0, self.clock.time())
        else:
            if isinstance(run.behavior, choreography.SETTLING):
                self.rebase(run.course.parts)
            self.relax(run.course.parts)

    def _stay(self, run: Run) -> None:
        """Stop a shift of the head, and make the direction where it stops the base gaze."""
        now, track = self.clock.time(), self.tracks["head"]
        run.motion.brake(now)
        goal = track.going()
        if track.aim is not None and not track.is_still(now, track.aim):
            goal = tuple((track.aim.offset(track.trunk.angles(run.motion.end)) + goal).tolist())
            leg = Leg(goal=goal, seconds=max(run.motion.end - now, SHORTEST))
            track.play(Motion(Path(track.at(now), (leg,), tracks.LIMITS["head"]), now))
        track.aim = None
        self.attention.stay(goal)
        if run.course.turns_trunk and run is self.runs.get("torso", run):
            self.tracks["torso"].base = self.tracks["torso"].going()

    def relax(self, names: Collection[str]) -> None:
        now = self.clock.time()
        # The trunk first: arms are not down before it is up.
        for part in sorted(names, key=lambda part: part != "torso"):
            track = self.tracks[part]
            if part == "head":
                track.return_to(self.attention.angles, now, self.attention.aim)
                self.attention.expect(self.attention.entity, track.motion.end, now)
            else:
                track.return_to(track.base, now, trunks=self.places(now))
        if "torso" in names:
            self._wait_for_reach()
            finished(self.give_way())

    def stop(self, run: Run) -> Seconds:
        self.attention.expect("", 0.0, self.clock.time())
        return super().stop(run)

    # -- targets that move ----------------------------------------------------------------------------------------

    def rest_on(self, run: Run | None) -> None:
        if run is None:
            self.attention.stay(tracks.HOME["head"])
        else:
            self.attention.shift(run.behavior, run.course)

    def follow(self) -> None:
        """Turn head and arms to follow the entities that they are on, or on their way to."""
        self._follow_with_head()
        for part in ARMS:
            run = self.runs.get(part)
            if run is not None and isinstance(run.behavior, Pointing) and run.awaits("stroke_end"):
                self._follow_with_arm(run)

    def _follow_with_head(self) -> None:
        now, situation, track = self.clock.time(), self.situation(self.world, real=True), self.tracks["head"]
        self.attention.update(situation)
        aim = self.attention.aim
        if (run := self.runs.get("head")) is None:
            head.turn(track, self.attention.angles, now, aim)
            return
        try:
            course = choreography.plan(run.behavior, situation)
        except Impossible:
            run.is_lost = self.world.entity(run.behavior.target) is not None  # type: ignore[union-attr]
            return
        run.is_lost = False
        path: Path | None = None
        if run.holding or run.awaits("stroke") or is_shift(run.behavior):
            aim = course.aim
            start = self._states(course.parts, aim)
            path = head.retargeted(run, course, start, self.limits(run, aim, now), now)
            if path is not None:
                run.course = course
                self._rest_there(course, [part for part in course.parts if part == "torso"])
        elif not run.awaits("relax"):
            path = head.homeward(run, self.attention.angles, track, now, aim)
        if path is not None:
            self.play(run, path, aim)
            run.bell.ring()

    def _follow_with_arm(self, run: Run) -> None:
        assert isinstance(run.behavior, Pointing)
        assert run.course.aim is not None
        entity, now = self.world.entity(run.behavior.target), self.clock.time()
        if entity is None:
            return  # It was last seen where the arm points.
        if math.dist(entity.position, run.course.aim.target) < NOTICEABLE:
            run.is_lost = False
            return
        try:
            course = run.replanned(self.situation(self.world, real=True))
        except Impossible:
            run.is_lost = True
            return
        path = self.relaid(run, course, now)
        run.is_lost = path is None or tracks.meets_table(path, course.joints, course.trunks[:1])
        if path is not None and not run.is_lost:
            run.course = course
            self.play(run, path, course.aim)
            run.bell.ring()

    def is_behind(self, run: Run) -> bool:
        """True if a behavior that waits on its target is still on its way to where that has moved."""
        now, aim = self.clock.time(), run.course.aim
        if aim is None or now >= run.motion.end or not isinstance(run.behavior, Gaze | Pointing):
            return False
        if isinstance(run.behavior, Pointing) and run.pending[0].sync != "stroke_end":
            return False
        pose = tracks.pose_at({part: self.tracks[part] for part in ("torso", *run.course.parts)}, now)
        if aim.side is None:
            on = aim.angles(self.tracks["torso"].angles(now))
            return any(abs(pose[joint] - angle) > BEHIND for joint, angle in zip(aim.joints, on, strict=True))
        forearm = kinematics.arm(pose, aim.side)
        way = [there - here for there, here in zip(aim.target, forearm.origin, strict=True)]
        along = sum(a * b for a, b in zip(way, forearm.axis, strict=True))
        return math.dist(way, [along * each for each in forearm.axis]) > BESIDE

    def _delay(self, aim: Aim | None, at: Seconds) -> Seconds:
        """Seconds from that instant on until the target comes into reach as the trunk moves; 0: it is, or never."""
        trunk = self.tracks["torso"]
        for step in range(1 + max(0, math.ceil((trunk.motion.end - at) / STEP))):
            if aim is None or aim.is_in_reach(trunk.angles(at + step * STEP)):
                return step * STEP
        return 0.0

    def _wait_for_reach(self) -> None:
        """Delay what is on its way to a target that is not in reach by then, since the trunk moves otherwise."""
        now = self.clock.time()
        for run in dict.fromkeys(self.runs.values()):
            point = run.course.arrival
            if run.course.aim is None or run.is_over or not run.awaits(point):
                continue
            at = run.motion.crossing(run.motion.path.marks[point])
            if at is not None and at > now and (late := self._delay(run.course.aim, at)):
                track = self.tracks[run.course.parts[0]]
                left = run.motion.path.after(run.motion.s(now), [each.sync for each in run.pending])
                start, legs = track.start_at(now, run.course.aim), _delayed(left, point, late)
                path = Path(start, legs, self.limits(run, run.course.aim, now))
                self.play(run, path, run.course.aim)
                run.bell.ring()

    # -- faults -------------------------------------------------------------------------------------------------

    def objection_to(self, on: Angles, angles: Angles) -> str:
        """Say why these joints cannot be displaced now; empty: they can. on: those that are already."""
        now, new = self.clock.time(), _new(on, angles)
        for joint, angle in new.items():
            limit = kinematics.LIMIT[joint]
            part = limit.part.replace("_", " ")
            if joint not in self.tracks[limit.part].joints:
                return f"{joint} cannot be displaced: it is at rest where it adds nothing"
            if not limit.low <= angle <= limit.high:
                low, high = degrees(limit.low), degrees(limit.high)
                return f"{joint} cannot be displaced to {degrees(angle):.0f} degrees: expected {low:.0f}..{high:.0f}"
            if limit.part in self.runs or self.tracks[limit.part].is_moving(now):
                return f"{joint} cannot be displaced: the {part} moves; it can be while it rests"
        if new and kinematics.touches_table({**tracks.pose_at(self.tracks, now), **new}):
            return "joints cannot be displaced so: an arm would touch the table"
        return ""

    def displace(self, on: Angles, angles: Angles) -> None:
        """Displace exactly these joints. Of one that is displaced no more the torso knows again where it is."""
        now, new = self.clock.time(), _new(on, angles)
        for part in dict.fromkeys(kinematics.LIMIT[joint].part for joint in new):
            track = self.tracks[part]
            here = dict(zip(track.joints, track.angles(now), strict=True))
            moved = {joint: angle for joint, angle in new.items() if joint in here}
            self.misbelieved |= {joint: self.misbelieved.get(joint, here[joint]) for joint in moved}
            goal = tuple((here | moved).values())
            leg = Leg(goal=goal, seconds=return_time(list(here.values()), goal))
            track.play(Motion(Path(resting(list(here.values())), (leg,), track.own_limits), now))
        known = [joint for joint in on if joint not in angles and self.misbelieved.pop(joint, None) is not None]
        self.relax(tuple(dict.fromkeys(kinematics.LIMIT[joint].part for joint in known)))


def is_last_on_target(behavior: BlockBehavior, sync: str) -> bool:
    """True if a behavior with a target is on it up to this sync point."""
    return (isinstance(behavior, Gaze) and sync == "relax") or (
        isinstance(behavior, Pointing) and sync == "stroke_end"
    )


def _leg_home(run: Run, start: JointMotion, goal: tuple[float, ...]) -> Leg:
    """Leg from a target to where the part belongs."""
    here = tuple(start.q.tolist())
    return head.way_back(here, goal) if run.course.parts == ("head",) else choreography.lowering(here, goal)


def _delayed(legs: Sequence[Leg], sync: str, by: Seconds) -> tuple[Leg, ...]:
    """Legs of which the one that ends in `sync` takes longer."""
    return tuple(replace(leg, seconds=leg.seconds + by) if sync in dict(leg.marks) else leg for leg in legs)


def _new(on: Angles, angles: Angles) -> dict[str, float]:
    return {joint: angle for joint, angle in angles.items() if on.get(joint) != angle}
