"""The tracks of Reachy Mini: how its parts move, what they look at, and how far the measured joints are off.

Nothing waits here, and nothing is sent. Time is that of a clock.
"""

import math
from collections.abc import Collection, Sequence
from contextlib import suppress
from math import inf, radians

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Looks
from engage_hri.schemas.body import BodyPose, Estimate
from engage_hri.schemas.units import Radians, Seconds, Vector
from engage_hri.schemas.world import World
from engage_hri.services.control.bases import moving_parts
from engage_hri.services.control.bases.linked import GAP
from engage_hri.services.control.bases.moving_parts import Clock, MovingParts
from engage_hri.services.control.bases.walk import Off, Watch, farthest, nearest, settling
from engage_hri.services.control.contract.body import MovementAuthority
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import choreography
from engage_hri.services.control.figure.course import Course
from engage_hri.services.control.figure.estimates import phases
from engage_hri.services.control.figure.kinematics import Mounting
from engage_hri.services.control.motion.motion import Motion, Place, Track, WalkPoint, is_shift
from engage_hri.services.control.motion.path import Array, JointMotion, Leg, Path, resting
from engage_hri.services.control.reachy_mini import courses, joints
from engage_hri.services.control.reachy_mini.courses import Circumstances
from engage_hri.services.control.reachy_mini.joints import Angles
from engage_hri.services.control.reachy_mini.settings import ReachyMiniSettings

NEAR = {
    "head_pitch": radians(0.8), "head_yaw": radians(0.8), "body_follow": radians(2.0), "nod_yaw": radians(1.0),
    "nod_pitch": radians(1.0), "nod_roll": radians(1.0), "body_turn": radians(1.0), "body_lean": radians(0.5),
    "right_antenna": radians(1.0), "left_antenna": radians(1.0),
}  # fmt: skip
"""How far a joint of a track may be from a sync point."""
NOTICEABLE = radians(0.3)
"""A target that moves less does not move the head."""
SHORTEST: Seconds = 0.1
"""Least time that is given to catch up with a target."""
FOLLOWING: Seconds = 0.3
"""A look on a target that moves may be so far behind it."""
FORGOTTEN: Seconds = 0.5
"""What has not been seen elsewhere for so long stands."""
ASTRAY = radians(6.0)
"""Joints that are further than this from where they were sent have been moved by somebody else."""
BEHIND: Seconds = 0.1
"""How far behind a sync point the joints may be measured to have passed it: measurements come now and then."""
FRAME: Seconds = 0.02
"""Seconds between two measurements; a point is told of by the first one that bears it out."""
GAIN, SMOOTH, LONGEST = 0.08, 0.3, radians(0.35)
"""Of the correction of a head: share of an error that one measurement corrects, slow against the lag of the motors;
weight of one measurement in the error that is believed; the most that one changes, 15 degrees a second."""


class Run(moving_parts.Run):
    """A behavior that moves one track along a course to its goal. Its way home is laid once it leaves that.

    watch: of its joints, since they have last come to one of its sync points.
    """

    def __init__(
        self, behavior: BlockBehavior, course: Course, authority: MovementAuthority, patience: Seconds
    ) -> None:
        super().__init__(behavior, course, authority)
        self.track = course.parts[0]
        self.is_swing = self.track == "nod"
        """True for a nod: its way runs through to its end."""
        self._patience = patience
        self.look_anew()

    def look_anew(self) -> None:
        """Give its joints the whole patience again."""
        self.watch = Watch(self._patience)

    @property
    def is_homeward(self) -> bool:
        """True once it has left its goal for where its track belongs."""
        return not self.is_swing and not self.course.stays and len(self.pending) == 1

    def limit(self, path: Path) -> Seconds:
        # What goes to a goal stops there by itself.
        return super().limit(path) if self.is_swing else inf

    def is_start(self, sync: str) -> bool:
        """True for a point at which it only begins: nothing has to be anywhere."""
        is_held = any(point.held_with for point in self.course.points if point.sync == sync)
        return sync == "start" or not (self.is_swing or self.course.stays or is_held or sync == "end")

    def leave_instant(self, now: Seconds) -> list[str]:
        """Pass all points of the next instant; return them."""
        point = self.pending[0]
        if point.held_with:
            return self.leave(point.held_with, now)
        passed = [each.sync for each in self.pending if self.is_start(each.sync)]
        passed = passed if self.is_start(point.sync) else [point.sync]
        self.pending = self.pending[len(passed) :]
        return passed


class Aim(Struct, Place, frozen=True):
    """A place that the head is on, or on its way to. trunk: turn and lean of the body for which its path is laid.

    follow: angle by which the body turns after the head.
    """

    target: Vector
    trunk: tuple[float, ...]
    follow: Radians
    mounting: Mounting

    def offset(self, trunk: Sequence[float] | Array) -> Array:
        now, laid = (
            joints.aim(self.target, {"body_yaw": turn + self.follow, "body_lean": lean}, self.mounting)
            for turn, lean in (trunk, self.trunk)
        )
        return np.array([now[0] - laid[0], now[1] - laid[1], 0.0])


class Moves(MovingParts[Run]):
    """All tracks. measured: the joints, as they were last measured.

    look: what the head goes home to look at; None: the direction that is its base.
    """

    tracks: dict[str, Track[Aim]]

    def __init__(self, clock: Clock, settings: ReachyMiniSettings) -> None:
        limits = joints.limits(settings.pace)
        super().__init__(clock, {name: Track[Aim](name, limits[name], joints.HOME[name]) for name in limits})
        self.mounting = Mounting(settings.position, radians(settings.facing))
        self.look: BlockBehavior | None = None
        self.measured: Angles = joints.summed(joints.HOME)
        self.trim = np.zeros(2)
        """Radians that the head's yaw and pitch are told more, so that it is measured where it is to be. The motors
        are springs: their controllers have no integral part, so the head rests where its weight and they agree."""
        self._error = np.zeros(2)
        """Radians by which a head that stands is off, smoothed."""
        self._settings = settings
        self._near = {**NEAR, **dict.fromkeys(("head_yaw", "head_pitch"), radians(settings.on_target))}
        self._speeds: dict[str, float] = {}
        self._seen_at: Seconds = -inf
        """When the world was seen last."""

    # -- where the plan is --------------------------------------------------------------------------------------

    def planned(self, t: Seconds) -> dict[str, tuple[float, ...]]:
        """Angles of each track at an instant. A look stays on its target while the body turns or leans."""
        return {name: track.angles(t) for name, track in self.tracks.items()}

    def commanded(self, t: Seconds) -> dict[str, float]:
        """Angle that each joint is told at an instant: with what it needs to hold the head where it is to be."""
        pose, (yaw, pitch) = joints.summed(self.planned(t)), self.trim.tolist()
        return {**pose, "head_yaw": pose["head_yaw"] + yaw, "head_pitch": pose["head_pitch"] + pitch}

    def correct(self, now: Seconds) -> None:
        """Correct the head while it stands."""
        error = np.subtract(self.tracks["head"].angles(now), self._of_track("head", now))[:2]
        moves = now < max(self.tracks[name].motion.end for name in ("head", "nod", "torso")) + self._settings.lag
        if moves or np.abs(error).max() > ASTRAY:  # errors say nothing, or it is no weight that holds the head there
            self._error = np.zeros(2)
            return
        self._error = (1.0 - SMOOTH) * self._error + SMOOTH * error
        most, enough = radians(self._settings.correction), radians(self._settings.on_target) / 2
        further = np.clip(self.trim + np.clip(GAIN * self._error, -LONGEST, LONGEST), -most, most)
        self.trim = np.where(np.abs(self._error) < enough, self.trim, further)

    # -- planning -----------------------------------------------------------------------------------------------

    def circumstances(self, world: World, pose: BodyPose | None = None) -> Circumstances:
        """Describe what a behavior begins from: where the plan has the tracks, or the joints of `pose`."""
        tracks = {**self.planned(self.clock.time()), "torso": self.tracks["torso"].going(), "nod": joints.HOME["nod"]}
        if pose is not None:
            given = {**joints.summed(tracks), **{each.joint: each.angle for each in pose.joints}}
            tracks["torso"] = (self._turn_in(given, tracks["torso"][0]), given["body_lean"])
            tracks |= {name: joints.of_track(name, given, tracks) for name in ("head", "face")}
        return Circumstances(tracks, world, self.mounting)

    @staticmethod
    def _turn_in(pose: Angles, turn: Radians) -> Radians:
        """The body's own turn in a pose: that which it has, if the head takes the body along to there."""
        if abs(turn + joints.follow(pose["head_yaw"], turn) - pose["body_yaw"]) < NOTICEABLE:
            return turn
        return joints.own_turn(pose["body_yaw"])

    def estimate(self, behavior: BlockBehavior, around: Circumstances, *, is_resting: bool) -> Estimate:
        """Estimate a behavior that begins now, or from rest in these circumstances. Raises Impossible."""
        course, here = courses.course(behavior, around), around.tracks
        name, lag, goal = course.parts[0], self._settings.lag, course.goal
        track = self.tracks[name]
        start = resting(here[name]) if is_resting else self._start(track, behavior)
        trunk, legs = courses.turned(behavior, around), course.legs
        if choreography.turns_trunk(behavior):
            from_there = resting(here["torso"]) if is_resting else self.tracks["torso"].at(self.clock.time())
            legs = _as_long_as(self.way("torso", from_there, trunk).length, legs)
        path = Path(start, legs, track.own_limits)
        near = [NEAR[each] for each in track.joints]
        times = {sync: s + settling(path, s, lag, near, FRAME) for sync, s in path.marks.items()}
        if "end" not in times:
            back = self.way(name, resting(goal), track.base)
            times["end"] = times["relax"] + back.length + settling(back, back.length, lag, near, FRAME)
        after = {**here, "torso": trunk, name: here[name] if name == "nod" else goal}
        if name == "torso":  # the head keeps looking where it does; the body turns under it
            after["head"] = (*here["head"][:2], joints.follow(here["head"][0], goal[0]))
        end = after if course.stays or name == "nod" else {**here, name: track.base}
        looks = [(here[each], after[each]) for each in course.parts] if name == "head" else []
        turned = sum(abs(b - a) for one, other in looks for a, b in zip(one[:2], other[:2], strict=True))
        return Estimate(
            behavior=behavior.id, feasible=True, degraded=course.note,
            parts=tuple(self.tracks[each].part for each in course.parts), phases=phases(course.points, times),
            head_degrees=math.degrees(turned),
            ray=joints.gaze(joints.summed(after), self.mounting) if name == "head" else None,
            pose_after=joints.message(after), pose_end=joints.message(end),
        )  # fmt: skip

    def _start(self, track: Track[Aim], behavior: BlockBehavior) -> JointMotion:
        """State in which the path of a behavior begins now."""
        return track.start_at(self.clock.time(), self._aim(behavior))

    def way(self, name: str, here: JointMotion, goal: Sequence[float], *marks: tuple[str, float]) -> Path:
        """Lay a path to rest at a goal."""
        time = courses.seconds(name, here.q.tolist(), goal)
        if not time and here.at_rest:
            goal = here.q.tolist()
        leg = Leg(goal=tuple(goal), seconds=time or (0.0 if here.at_rest else SHORTEST), marks=marks)
        return Path(here, (leg,), self.tracks[name].own_limits)

    # -- motion -------------------------------------------------------------------------------------------------

    def take_over(self, run: Run) -> None:
        if not self.runs and self._is_astray(self.clock.time()):
            self.settle()
        track, legs = self.tracks[run.track], run.course.legs
        if choreography.turns_trunk(run.behavior):
            self.tracks["torso"].base = courses.turned(run.behavior, self.circumstances(self.world))
            self.relax(("torso",))
            legs = _as_long_as(self.tracks["torso"].motion.end - self.clock.time(), legs)
        path = Path(self._start(track, run.behavior), legs, track.own_limits)
        self.take(run)
        if run.course.stays:
            track.base = run.course.goal
        self._play(run, path, self._aim(run.behavior))
        if run.track == "torso":
            self.follow()

    def _aim(self, look: BlockBehavior | None) -> Aim | None:
        """The place of a look, with a path that is laid for where the body is going to be; None: it is no look."""
        entity = self.world.entity(look.target) if isinstance(look, Looks) else None
        if entity is None:
            return None
        turn, lean = trunk = self.tracks["torso"].going()
        yaw, _ = joints.aim(entity.position, {"body_yaw": turn, "body_lean": lean}, self.mounting)
        return Aim(entity.position, trunk, joints.follow(yaw, turn), self.mounting)

    def _play(self, run: Run, path: Path, aim: Aim | None = None, at: Seconds | None = None) -> None:
        run.motion = Motion(path, self.clock.time() if at is None else at, limit=run.limit(path))
        self.tracks[run.track].play(run.motion, aim=aim)
        run.bell.ring()

    def leave(self, run: Run, point: WalkPoint, *, has_waited: bool) -> list[str]:
        """Let a behavior pass its next instant. From its goal it goes home; from a stop, on along its way."""
        run.look_anew()
        now, track = self.clock.time(), self.tracks[run.track]
        passed = run.leave_instant(now)
        if run.is_homeward and self.owns(run):
            aim = self._aim(self.look) if run.track == "head" else None
            self._play(run, self.way(run.track, track.start_at(now, aim), track.base, ("end", 1.0)), aim)
            if run.track == "torso":
                self.follow()
        elif has_waited and run.is_swing and self.owns(run):
            left = run.motion.path.after(run.motion.s(now), [point.sync for point in run.pending])
            self._play(run, Path(resting(run.motion.at(now).q), left, track.own_limits))
        return passed

    def abandon(self, run: Run) -> None:
        track = self.tracks[run.track]
        if is_shift(run.behavior):
            run.motion.brake(self.clock.time())
            self.look, track.base = None, track.going()
            if choreography.turns_trunk(run.behavior):
                self.tracks["torso"].motion.brake(self.clock.time())
                self.tracks["torso"].base = self.tracks["torso"].going()
            return
        if run.course.stays:
            self.rebase((run.track,))
        self.relax((run.track,))

    def relax(self, names: Collection[str]) -> None:
        """Send tracks home, from where they are measured if somebody or something has them elsewhere."""
        now = self.clock.time()
        for name in names:
            track, aim = self.tracks[name], self._aim(self.look) if name == "head" else None
            here, off = track.start_at(now, aim), self.off(name, self.planned(now - self._settings.lag)[name])
            if abs(off.there - off.here) > ASTRAY:
                here = resting(self._of_track(name, now))
            track.play(Motion(self.way(name, here, track.base), now), aim=aim)
            if name == "torso":
                self.follow()

    def rest_on(self, run: Run | None) -> None:
        self.look = None if run is None else choreography.with_head(run.behavior)
        if run is not None:
            self.tracks["head"].base = run.course.goal

    # -- looks --------------------------------------------------------------------------------------------------

    def see(self, world: World) -> None:
        """Take note of a changed world, and follow what is looked at."""
        if (took := self.clock.time() - self._seen_at) > 1e-3:
            before = ((each.id, self.world.entity(each.id), each.position) for each in world.entities)
            speeds = {name: math.dist(old.position, new) / took for name, old, new in before if old is not None}
            self._speeds = {name: speed and max(speed, 0.5 * self.speed(name)) for name, speed in speeds.items()}
            self._seen_at = self.clock.time()
        self.world = world
        self.follow()

    def speed(self, entity: str) -> float:
        """Speed of an entity, metres per second; 0: it stands, or nobody knows of it."""
        return self._speeds.get(entity, 0.0) if self.clock.time() - self._seen_at < FORGOTTEN else 0.0

    def follow(self) -> None:
        """Turn the head after what it looks at, or is about to look at, and the body after the head."""
        track, around = self.tracks["head"], self.circumstances(self.world)
        yaw, pitch, _ = track.base
        track.base = (yaw, pitch, joints.follow(yaw, around.tracks["torso"][0]))
        run, look, arrival = self.runs.get("head"), self.look, "end"
        with suppress(Impossible):
            if self.look is not None:
                track.base = courses.course(self.look, around).goal
        goal: tuple[float, ...] = track.base
        if run is not None and not run.is_homeward:
            try:
                look, arrival = choreography.with_head(run.behavior), run.course.arrival
                goal = courses.course(look, around).goal
            except Impossible:
                return
        aim, now = self._aim(look), self.clock.time()
        if all(abs(a - b) < NOTICEABLE for a, b in zip(goal, track.going(self.tracks["torso"].going()), strict=True)):
            return
        here = track.start_at(now, aim)
        if run is None:
            track.play(Motion(self.way("head", here, goal), now), aim=aim)
            return
        has_arrived = not run.awaits(arrival)
        marks = tuple(
            (each.sync, 0.0 if has_arrived else 1.0) for each in run.pending if each.sync in run.motion.path.marks
        )
        left = 0.0 if has_arrived else max(SHORTEST, run.motion.end - now)
        time = max(left, courses.seconds("head", here.q.tolist(), goal), 0.0 if here.at_rest else SHORTEST)
        self._play(run, Path(here, (Leg(goal=goal, seconds=time, marks=marks),), track.own_limits), aim)

    # -- measured joints ----------------------------------------------------------------------------------------

    def _of_track(self, name: str, now: Seconds) -> tuple[float, ...]:
        return joints.of_track(name, self.measured, self.planned(now - self._settings.lag))

    def off(self, name: str, there: Sequence[float]) -> Off:
        """Tell how far the measured joints of a track are off some angles."""
        names, here = self.tracks[name].joints, self._of_track(name, self.clock.time())
        return farthest(zip(names, here, there, [self._near[each] for each in names], strict=True))

    def off_run(self, run: Run, sync: str) -> Off:
        """Tell how far the measured joints are off a sync point, or off the nearest place on the way behind it.

        A look is on its target by the gaze axis: what counts are the angles that look there from where the eyes are.
        """
        if run.track == "head":
            off = self.off_target(self.look if run.is_homeward else run.behavior)
            trunk = [self.off("torso", self.tracks["torso"].going())] if "torso" in run.course.parts else []
            return max([off, *trunk], key=lambda each: each.share)
        path = run.motion.path
        mark = path.marks[sync]
        s = min(run.motion.s(self.clock.time()), mark + BEHIND)  # later it may be where a stuck joint is
        return nearest(mark, s, lambda place: self.off(run.track, path.position(place).tolist()))

    def off_target(self, look: BlockBehavior | None) -> Off:
        """Tell how far the measured gaze axis is off the target of a look; None: off where the head will rest.

        Of a target that has vanished, where it was counts.
        """
        there, here = self.tracks["head"].going(), self._of_track("head", self.clock.time())
        allowed = self._near["head_yaw"]
        if isinstance(look, Looks) and (entity := self.world.entity(look.target)) is not None:
            there = courses.look_at(look, self.measured, self.world, self.mounting)
            away = math.dist(entity.position, joints.gaze(self.measured, self.mounting).origin)
            allowed += FOLLOWING * self.speed(entity.id) / max(away, 0.1)
        aside, up = (there[0] - here[0]) * math.cos(here[1]), there[1] - here[1]
        worst = 0 if abs(aside) > abs(up) else 1
        return Off(("head_yaw", "head_pitch")[worst], math.hypot(aside, up) / allowed, here[worst], there[worst])

    def _is_astray(self, now: Seconds) -> bool:
        """True if nothing moves, and joints are not where they were sent: somebody else has moved them."""
        sent = joints.summed(self.planned(now))
        apart = [abs(self.measured[name] - sent[name]) for name in ("head_yaw", "head_pitch", "body_yaw")]
        return now >= max(track.motion.end for track in self.tracks.values()) + 1.0 and max(apart) > ASTRAY

    def settle(self) -> None:
        """Begin anew from where the joints are measured, at rest. Where tracks go home to stays."""
        now, here = self.clock.time(), self.measured
        self.trim = self._error = np.zeros(2)
        tracks = {**joints.HOME, "torso": (joints.own_turn(here["body_yaw"]), here["body_lean"])}
        tracks |= {name: joints.of_track(name, here, tracks) for name in ("head", "face")}
        for name, track in self.tracks.items():
            track.play(Motion(Path(resting(tracks[name]), (), track.own_limits), now))
        tilted = resting((0.0, 0.0, here["head_roll"]))  # nothing else brings a roll home
        self.tracks["nod"].play(Motion(self.way("nod", tilted, joints.HOME["nod"]), now))

    def stand(self, since: Seconds) -> None:
        """Go on from where the plan was at an instant, at rest: no command has come through since then.

        `GAP` of the time that has passed counts, else a stream with many gaps would never bring anything to its goal.
        """
        at = self.clock.time() - GAP
        for name, track in self.tracks.items():
            if track.motion.end <= since:
                continue
            run, motion = self.runs.get(name), track.motion
            pending = [each.sync for each in run.pending] if run is not None and run.motion is motion else []
            path = Path(resting(motion.at(since).q), motion.path.after(motion.s(since), pending), track.own_limits)
            if run is not None and run.motion is motion:
                self._play(run, path, track.aim, at)
            else:
                track.play(Motion(path, at), aim=track.aim)


def _as_long_as(seconds: Seconds, legs: Sequence[Leg]) -> tuple[Leg, ...]:
    """The leg of a look that lasts as long as the body turns under it."""
    return tuple(replace(leg, seconds=max(leg.seconds, seconds)) for leg in legs)
