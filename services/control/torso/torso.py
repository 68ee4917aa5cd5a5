"""The parts of the simulated torso: which behavior has each, and along which path it moves. Nothing waits here.

Time is that of a clock: of the event loop for the body, of its own for a rehearsal.
"""

from collections.abc import Mapping
from math import inf

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Pointing
from engage_hri.schemas.body import BodyPose, Estimate, JointLimit, NoPointZone
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.bell import Bell
from engage_hri.services.control.contract.body import MovementAuthority
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.contract.variability import Deviations
from engage_hri.services.control.figure import choreography, kinematics, tracks
from engage_hri.services.control.figure.aiming import NECK, TRUNK, Aim
from engage_hri.services.control.figure.course import Course, Situation
from engage_hri.services.control.figure.estimates import Added, going_home, motion_estimate, poses
from engage_hri.services.control.figure.laid_paths import laid_path
from engage_hri.services.control.figure.repertoire import Repertoire
from engage_hri.services.control.figure.tracks import Track
from engage_hri.services.control.motion.motion import Motion
from engage_hri.services.control.motion.path import JointMotion, Leg, Path, resting
from engage_hri.services.control.torso import head, reaching, table_clearance
from engage_hri.services.control.torso.head import Fixation
from engage_hri.services.control.torso.parts import Clock
from engage_hri.services.control.torso.runs import Run
from engage_hri.services.runtime.steps import Steps, finished


class Torso:
    """The parts of a torso. runs: the behavior that has a part, by the part. attention: where the head belongs.

    misbelieved: angles at which the body believes joints that are elsewhere.
    """

    def __init__(
        self, clock: Clock, zones: tuple[NoPointZone, ...], repertoire: Repertoire, displaced: dict[str, float]
    ) -> None:
        self.clock = clock
        self.zones = zones
        self.repertoire = repertoire
        self.misbelieved = {joint: kinematics.HOME[joint] for joint in displaced}
        self.tracks = {part: Track(part, tracks.home_of(part, displaced)) for part in tracks.LIMITS}
        for track in self.tracks.values():
            track.trunk = self.tracks["torso"]
        self.runs: dict[str, Run] = {}
        self.homeward: list[Bell] = []
        """Bells of those who wait for parts to come home: each behavior that takes parts rings them."""
        self.world = World(entities=())
        self.attention = Fixation()
        self.base: MovementAuthority | None = None
        """Authority of the shift that has set the base gaze."""

    # -- planning -----------------------------------------------------------------------------------------------

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        """Estimate a movement by itself, from `pose` or from where its parts are."""
        try:
            situation = self.situation(world, pose)
            course = choreography.plan(behavior, situation)
            is_moving = pose is None and not self.misbelieved
            path = self.path(course, None if is_moving else situation)
            return self.told(behavior, course, path, situation, moving=is_moving)
        except Impossible as impossible:
            return impossible.estimate(behavior)

    def pose(self, world: World, pose: BodyPose | None) -> BodyPose:
        """Pose of all joints: those of `pose`, and where the others are."""
        return kinematics.pose_message(self.situation(world, pose).pose)

    def told(
        self, behavior: BlockBehavior, course: Course, path: Path, situation: Situation, *, moving: bool = True
    ) -> Estimate:
        """Estimate a movement along a path that was laid for it. moving: it begins now, from where its parts are."""
        added = self._added(course) if moving else None
        estimate = motion_estimate(behavior, course, path, *poses(course, situation.pose), added)
        leaves = next((point.sync for point in course.points if is_last_on_target(behavior, point.sync)), "")
        if added is None or not leaves:
            return estimate
        # The trunk has the part elsewhere by then, so its way home is another one.
        now, run = self.clock.time(), Run(behavior, course, MovementAuthority(behavior, leaves), Deviations(), 0)
        back = self.way_home(run, Motion(path, now), now + path.marks[leaves])
        return estimate if back is None else going_home(estimate, leaves, back)

    def _added(self, course: Course) -> Added | None:
        """Tell what the trunk adds to a path that begins now; None: nothing."""
        now, aim, torso = self.clock.time(), course.aim, self.tracks["torso"]
        if aim is None or torso.is_still(now, aim):
            return None
        return lambda seconds: aim.offset(torso.angles(now + seconds))

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
        trunks = table_clearance.places(self, now) if is_sure else table_clearance.way_along(here_only)
        described = Situation(here, rest, world, self.zones, tuple(self.runs), self.repertoire, trunk, trunks)
        return described if pose is None else self.placed(described, pose)

    def placed(self, situation: Situation, pose: BodyPose) -> Situation:
        """The same situation with the joints at rest in `pose`, as far as it has them."""
        here, rest = tracks.updated(situation.pose, pose), situation.rest
        if any(here[joint] != situation.pose[joint] for joint in TRUNK):
            rest = {**rest, **self._gaze_at_rest(here)}
        trunks = table_clearance.way_along([[here[joint] for joint in TRUNK]])
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
        path = laid_path(start, course)
        if "torso" in course.parts:
            yield from table_clearance.check(self, course, path, None if situation is None else situation.pose)
        return path

    def start(self, course: Course, situation: Situation | None = None) -> JointMotion:
        """State in which a path along `course` begins. situation: as for `path`."""
        if situation is not None and course.parts != ("nod",):
            return resting([situation.pose[joint] for joint in course.joints])
        now = self.clock.time()
        return tracks.joined([self.tracks[part].start_at(now, course.aim) for part in course.parts])

    def is_carried(self, course: Course) -> bool:
        """True if the trunk moves what goes along `course` to a target."""
        return course.aim is not None and not self.tracks["torso"].is_still(self.clock.time(), course.aim)

    def _path_on_the_move(self, start: JointMotion, course: Course) -> Path:
        """Lay a path to a target while the trunk moves: it arrives when the target is in reach. Raises Impossible."""
        path = laid_path(start, course, is_free=True)
        point = course.arrival
        if delay := reaching.delay(self, course.aim, self.clock.time() + path.marks[point]):
            path = laid_path(start, replace(course, legs=reaching.delayed(course.legs, point, delay)), is_free=True)
        table_clearance.check_carried(self, course, path)
        return path

    def is_off_target(self, run: Run, sync: str) -> bool:
        """True if `sync` says that a behavior is on its target, which is out of reach."""
        aim, trunk = run.course.aim, self.tracks["torso"].angles(self.clock.time())
        is_claim = sync == run.course.arrival or (isinstance(run.behavior, Pointing) and sync == "stroke_end")
        return aim is not None and is_claim and (run.is_lost or not aim.is_in_reach(trunk))

    # -- motion -------------------------------------------------------------------------------------------------

    def take_over(self, run: Run, path: Path) -> None:
        """Make `run` the owner of its parts, cut the runs that had them, and start its motion."""
        finished(self.taken_over(run, path))

    def taken_over(self, run: Run, path: Path) -> Steps[None]:
        """The same in steps, of a torso that stands still meanwhile."""
        run.began = self.clock.time()
        for joint in run.course.joints:
            self.misbelieved.pop(joint, None)
        left: list[str] = []
        for earlier in dict.fromkeys(self.runs[part] for part in run.course.parts if part in self.runs):
            self.release(earlier)
            if choreography.is_shift(earlier.behavior) and isinstance(run.behavior, Gaze):
                earlier.is_beneath = True
            else:
                earlier.authority.revoke("taken_over")
            earlier.bell.ring()
            left += [part for part in earlier.course.parts if part not in run.course.parts]
        for part in run.course.parts:
            self.runs[part] = run
        for bell in self.homeward:
            bell.ring()
        if choreography.is_shift(run.behavior):
            self.set_base(run.behavior, run.course, run.authority)
        elif isinstance(run.behavior, choreography.SETTLING):
            tracks.rebase(self.tracks, run.course.parts, run.course.on_target)
        self.play(run, path, run.course.aim)
        self.relax(tuple(left))
        if "torso" in run.course.parts:
            reaching.wait_for_reach(self)
            yield from table_clearance.give_way(self)

    def play(self, run: Run, path: Path, aim: Aim | None) -> None:
        now, run.gate = self.clock.time(), inf
        run.play(Motion(path, now, cruise=run.cruise, limit=run.limit(path)))
        column = 0
        for part in run.course.parts:
            self.tracks[part].play(run.motion, column, aim)
            column += len(self.tracks[part].joints)
        self.attention.follow_run(run, now)

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
        path = Path(start, run.with_faults((leg,)), limits)
        if run.course.parts != ("head",):
            trunks = table_clearance.places(self, at)
            for above in tracks.raised(tuple(start.q.tolist()), run.course.joints):
                if not tracks.meets_table(path, run.course.joints, trunks):
                    break
                first = Leg(goal=above, seconds=tracks.RAISING, marks=leg.marks[:1])
                legs = run.with_faults((first, replace(leg, marks=leg.marks[1:])))
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
            start = tracks.joined([self.tracks[part].start_at(now, aim) for part in run.course.parts])
            legs = run.motion.path.after(run.motion.s(now), [point.sync for point in run.pending])
            limits = self.limits(run, aim, now)
            path = self._path_home(run, start, goal, limits, now) if is_homeward else None
            self.play(run, path or Path(start, run.with_faults(legs), limits), aim)
        return passed

    def limits(self, run: Run, aim: Aim | None, at: Seconds) -> tuple[JointLimit, ...]:
        """Limits of a path with this aim that begins then."""
        is_free = aim is not None and not self.tracks["torso"].is_still(at, aim)
        return tracks.limits_of(run.course.parts, is_free=is_free)

    def extend(self, run: Run) -> None:
        """Let a behavior go as far and as fast as its authority says now."""
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
            table_clearance.keep_clear(self, run)
        if is_paced or is_extended:
            self.attention.follow_run(run, now)

    def deviate(self, deviations: Deviations) -> None:
        """Give exactly these faults to what is under way."""
        now = self.clock.time()
        for run in dict.fromkeys(self.runs.values()):
            run.deviate(deviations, now)
            self.attention.follow_run(run, now)

    def owns(self, run: Run) -> bool:
        return any(owner is run for owner in self.runs.values())

    def release(self, run: Run) -> None:
        for part in [part for part, owner in self.runs.items() if owner is run]:
            del self.runs[part]

    def abandon(self, run: Run) -> None:
        """Send the parts of `run` to rest. A shift of the head that is broken off stays where it can stop."""
        if choreography.is_shift(run.behavior):
            self._stay(run)
            self.attention.expect("", 0.0, self.clock.time())
        else:
            if isinstance(run.behavior, choreography.SETTLING):
                tracks.rebase(self.tracks, run.course.parts)
            self.relax(run.course.parts)

    def _stay(self, run: Run) -> None:
        """Stop a shift of the head, and make the direction where it stops the base gaze."""
        now, track = self.clock.time(), self.tracks["head"]
        goal = head.brake(run.motion, now)
        if track.aim is not None and not track.is_still(now, track.aim):
            goal = tuple((track.aim.offset(track.trunk.angles(run.motion.end)) + goal).tolist())
            leg = Leg(goal=goal, seconds=max(run.motion.end - now, head.SHORTEST))
            track.play(Motion(Path(track.at(now), (leg,), tracks.LIMITS["head"]), now))
        track.aim = None
        self.attention.stay(goal)

    def relax(self, parts: tuple[str, ...]) -> None:
        now = self.clock.time()
        # The trunk first: arms are not down before it is up.
        for part in sorted(parts, key=lambda part: part != "torso"):
            track = self.tracks[part]
            if part == "head":
                track.return_to(self.attention.angles, now, self.attention.aim)
                self.attention.expect(self.attention.entity, track.motion.end, now)
            else:
                track.return_to(track.base, now, trunks=table_clearance.places(self, now))
        if "torso" in parts:
            reaching.wait_for_reach(self)
            finished(table_clearance.give_way(self))

    # -- gaze ---------------------------------------------------------------------------------------------------

    def is_overlaid(self) -> bool:
        return "head" in self.runs and isinstance(self.runs["head"].behavior, Gaze)

    def set_base(self, behavior: BlockBehavior, course: Course, authority: MovementAuthority) -> None:
        """Make the goal of a shift the direction to which the head returns. A shift before it that has not ended is
        taken over."""
        if self.base is not None:
            self.base.revoke("taken_over")
        self.attention.shift(behavior, course)
        self.base = authority


def is_last_on_target(behavior: BlockBehavior, sync: str) -> bool:
    """True if a behavior with a target is on it up to this sync point."""
    return (isinstance(behavior, Gaze) and sync == "relax") or (
        isinstance(behavior, Pointing) and sync == "stroke_end"
    )


def _leg_home(run: Run, start: JointMotion, goal: tuple[float, ...]) -> Leg:
    """Leg from a target to where the part belongs."""
    here = tuple(start.q.tolist())
    return head.way_back(here, goal) if run.course.parts == ("head",) else choreography.lowering(here, goal)
