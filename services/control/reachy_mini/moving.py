"""The tracks of Reachy Mini: which behavior has each, where the plan has it, and how far the measured joints are off.

Nothing waits here, and nothing is sent. Time is that of a clock.
"""

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from math import radians

import numpy as np

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, HeadDirectionShift
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import MovementAuthority
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import choreography
from engage_hri.services.control.figure.course import Course
from engage_hri.services.control.motion.motion import Motion
from engage_hri.services.control.motion.path import JointMotion, Leg, Path, resting
from engage_hri.services.control.reachy_mini import courses, geometry, joints
from engage_hri.services.control.reachy_mini.courses import Circumstances
from engage_hri.services.control.reachy_mini.geometry import Angles, Mounting
from engage_hri.services.control.reachy_mini.runs import Run
from engage_hri.services.control.reachy_mini.settings import ReachyMiniSettings
from engage_hri.services.control.reachy_mini.speeds import Speeds
from engage_hri.services.control.reachy_mini.tracks import NEAR, Aim, Off, Track, Tracks, farthest
from engage_hri.services.control.reachy_mini.trim import Trim

NOTICEABLE = radians(0.3)
"""A target that moves less does not move the head."""
SHORTEST: Seconds = 0.1
"""Least time that is given to catch up with a target."""
FOLLOWING: Seconds = 0.3
"""A look on a target that moves may be so far behind it."""
ASTRAY = radians(6.0)
"""Joints that are further than this from where they were sent have been moved by somebody else."""
BEHIND: Seconds = 0.1
"""How far behind a sync point the joints may be measured to have passed it: measurements come now and then."""
GAP: Seconds = 0.15
"""Seconds without a measurement, and so without a command, after which the plan goes on from where it was."""
SAMPLES = 6
"""Places of a path between a sync point and where the plan is, at which the joints may be to have come there."""


class Moves:
    """All tracks. runs: the behavior that has a track. measured: the joints, as they were last measured.

    look: what the head goes home to look at; None: the direction that is its base.
    """

    def __init__(self, settings: ReachyMiniSettings) -> None:
        self.mounting = Mounting(settings.position, radians(settings.facing))
        self.world = World(entities=())
        self.tracks = {name: Track(name) for name in joints.TRACKS}
        self.runs: dict[str, Run] = {}
        self.look: courses.Looks | None = None
        self._limits = joints.limits(settings.pace)
        self._lag = settings.lag
        self.trim = Trim(radians(settings.correction), radians(settings.on_target))
        self._near = {**NEAR, **dict.fromkeys(("head_yaw", "head_pitch"), radians(settings.on_target))}
        self.measured: Angles = joints.summed(joints.HOME)
        self._base_of: MovementAuthority | None = None
        """Authority of the shift that has set where the head belongs."""
        self._speeds = Speeds()

    # -- where the plan is --------------------------------------------------------------------------------------

    def planned(self, t: Seconds) -> Tracks:
        """Angles of each track at an instant. A look stays on its target while the body turns or leans."""
        planned = {name: tuple(track.motion.position(t).tolist()) for name, track in self.tracks.items()}
        yaw, pitch, follow = planned["head"]
        aside, up = self._added(planned)
        planned["head"] = (yaw + aside, pitch + up, follow)
        return planned

    def commanded(self, t: Seconds) -> dict[str, float]:
        """Angle that each joint is told at an instant: with what it needs to hold the head where it is to be."""
        pose = joints.summed(self.planned(t))
        yaw, pitch = self.trim.angles
        return {**pose, "head_yaw": pose["head_yaw"] + yaw, "head_pitch": pose["head_pitch"] + pitch}

    def correct(self, now: Seconds) -> bool:
        """Correct the head while it stands. True if that changes what its motors are told."""
        if now < max(self.tracks[name].motion.end for name in ("head", "nod", "torso")) + self._lag:
            self.trim.rest()
            return False
        there, here = self.planned(now)["head"], self._of_track("head", now)
        yaw, pitch = there[0] - here[0], there[1] - here[1]
        if max(abs(yaw), abs(pitch)) > ASTRAY:  # it is no weight that holds the head there
            self.trim.rest()
            return False
        return self.trim.see((yaw, pitch))

    @property
    def end(self) -> Seconds:
        """Instant at which the plan of the last track comes to rest."""
        return max(track.motion.end for track in self.tracks.values())

    def _added(self, planned: Tracks) -> tuple[float, float]:
        """Yaw and pitch that the head needs more, since the body is elsewhere than its path supposes."""
        aim = self.tracks["head"].aim
        if aim is None or planned["torso"] == aim.body or (target := self.world.entity(aim.look.target)) is None:
            return (0.0, 0.0)
        now, laid = (
            geometry.aim(target.position, joints.summed({**planned, "torso": body}), self.mounting)
            for body in (planned["torso"], aim.body)
        )
        return (now[0] - laid[0], now[1] - laid[1])

    # -- planning -----------------------------------------------------------------------------------------------

    def circumstances(self, now: Seconds, world: World, pose: Angles | None = None) -> Circumstances:
        """Describe what a behavior begins from: where the plan has the tracks, or the joints of `pose`."""
        tracks = self.planned(now)
        torso = self.tracks["torso"]
        tracks["torso"] = torso.going
        if pose is not None:
            given = {**joints.summed({**tracks, "nod": joints.HOME["nod"]}), **pose}
            turn = tracks["torso"][0]
            tracks["torso"] = (turn, given["body_lean"])
            tracks["head"] = (given["head_yaw"], given["head_pitch"], given["body_yaw"] - turn)
            tracks["face"] = (given["right_antenna"], given["left_antenna"])
        tracks["nod"] = joints.HOME["nod"]
        base = {name: track.base for name, track in self.tracks.items()}
        return Circumstances(tracks, base, world, self.mounting)

    def path(self, course: Course, now: Seconds, start: Sequence[float] | None = None) -> Path:
        """Lay a path along a course. start: angles where it begins at rest; None: as its track moves now."""
        if start is not None:
            return Path(resting(start), course.legs, self._limits[course.parts[0]])
        return Path(self._state(course.parts[0], now), course.legs, self._limits[course.parts[0]])

    def way(self, track: str, here: JointMotion, goal: Sequence[float], *marks: tuple[str, float]) -> Path:
        """Lay a path to rest at a goal."""
        time = courses.seconds(track, here.q.tolist(), goal)
        if not time and here.at_rest:
            goal = here.q.tolist()
        leg = Leg(goal=tuple(goal), seconds=time or (0.0 if here.at_rest else SHORTEST), marks=marks)
        return Path(here, (leg,), self._limits[track])

    def _state(self, track: str, now: Seconds) -> JointMotion:
        state = self.tracks[track].motion.at(now)
        if track != "head" or (added := self._added(self.planned_raw(now))) == (0.0, 0.0):
            return state
        return JointMotion(state.q + np.array([*added, 0.0]), state.v, state.a)

    def planned_raw(self, t: Seconds) -> Tracks:
        """Angles of each track by its own path."""
        return {name: tuple(track.motion.position(t).tolist()) for name, track in self.tracks.items()}

    # -- motion -------------------------------------------------------------------------------------------------

    def take_over(self, run: Run, now: Seconds) -> None:
        """Give a behavior its track, cut the one that had it, and start its motion. Raises Impossible."""
        if not self.runs and self.is_astray(now):
            self.settle(now)
        path = self.path(run.course, now)
        track = run.track
        if (earlier := self.runs.pop(track, None)) is not None:
            if choreography.is_shift(earlier.behavior) and isinstance(run.behavior, Gaze):
                earlier.is_beneath = True
            else:
                earlier.authority.revoke("taken_over")
            earlier.bell.ring()
        self.runs[track] = run
        if choreography.is_shift(run.behavior):
            self.set_base(run)
        elif run.stays:
            self.tracks[track].base = run.course.goal
        self._play(run, path, now, self._aim_of(run.behavior, now))
        if track == "torso":
            self.follow(now)

    def _aim_of(self, behavior: BlockBehavior | None, now: Seconds) -> Aim | None:
        is_look = isinstance(behavior, Gaze | GazeShift | HeadDirectionShift)
        return Aim(behavior, self.planned_raw(now)["torso"]) if is_look else None  # type: ignore[arg-type]

    def _play(self, run: Run, path: Path, now: Seconds, aim: Aim | None = None) -> None:
        run.motion = Motion(path, now, limit=run.limit(path))
        track = self.tracks[run.track]
        track.motion, track.aim = run.motion, aim
        run.bell.ring()

    def leave(self, run: Run, now: Seconds, *, has_waited: bool) -> list[str]:
        """Let a behavior pass its next instant. From its goal it goes home; from a stop, on along its way."""
        passed, track = run.leave_instant(now), self.tracks[run.track]
        if run.is_homeward and self.owns(run):
            here = self._state(track.name, now)
            self._play(run, self.way(track.name, here, track.base, ("end", 1.0)), now, self._base_aim(track, now))
        elif has_waited and run.is_swing and self.owns(run):
            left = run.motion.path.after(run.motion.s(now), [point.sync for point in run.pending])
            self._play(run, Path(resting(run.motion.at(now).q), left, self._limits[track.name]), now)
        return passed

    def _base_aim(self, track: Track, now: Seconds) -> Aim | None:
        return self._aim_of(self.look, now) if track.name == "head" else None

    def owns(self, run: Run) -> bool:
        return self.runs.get(run.track) is run

    def release(self, run: Run) -> None:
        if self.owns(run):
            del self.runs[run.track]

    def abandon(self, run: Run, now: Seconds) -> None:
        """Send a track home whose behavior has ended early. A shift of the head stays where it stops."""
        track = self.tracks[run.track]
        if choreography.is_shift(run.behavior):
            run.motion.brake(now)
            self.look, track.base, track.aim = None, track.going, None
            return
        if run.stays:
            track.base = joints.HOME[track.name]
        self.relax((track.name,), now)

    def relax(self, names: Iterable[str], now: Seconds) -> None:
        """Send tracks home, from where they are measured if somebody or something has them elsewhere."""
        for name in names:
            track = self.tracks[name]
            here = self._state(name, now)
            off = self.off(name, now, self.planned(now - self._lag)[name])
            if abs(off.there - off.here) > ASTRAY:
                here = resting(self._of_track(name, now))
            track.motion = Motion(self.way(name, here, track.base), now)
            track.aim = self._base_aim(track, now)
            if name == "torso":
                self.follow(now)

    def rebase(self, names: Iterable[str]) -> None:
        """Make the safe pose where tracks go home to."""
        for name in names:
            self.tracks[name].base = joints.HOME[name]
            if name == "head":
                self.look = None
                if self._base_of is not None:
                    self._base_of.revoke()
                    self._base_of = None

    # -- looks --------------------------------------------------------------------------------------------------

    def is_overlaid(self) -> bool:
        return "head" in self.runs and isinstance(self.runs["head"].behavior, Gaze)

    def set_base(self, run: Run) -> None:
        """Make the goal of a shift where the head goes home to. One before it that has not ended is taken over."""
        if self._base_of is not None:
            self._base_of.revoke("taken_over")
        assert isinstance(run.behavior, GazeShift | HeadDirectionShift)
        self.look, self.tracks["head"].base, self._base_of = run.behavior, run.course.goal, run.authority

    def see(self, world: World, now: Seconds) -> None:
        """Take note of a changed world, and follow what is looked at."""
        self._speeds.see(world, now)
        self.world = world
        self.follow(now)

    def follow(self, now: Seconds) -> None:
        """Turn the head after what it looks at, or is about to look at, and the body after the head."""
        track, around = self.tracks["head"], self.circumstances(now, self.world)
        yaw, pitch, _ = track.base
        track.base = (yaw, pitch, joints.follow(yaw, around.tracks["torso"][0]))
        if self.look is not None:
            with suppress(Impossible):
                track.base = _goal(self.look, around)
        run = self.runs.get("head")
        if run is None or run.is_homeward:
            self._turn(track, track.base, now, run, self._aim_of(self.look, now), "end")
        elif isinstance(run.behavior, Gaze | GazeShift | HeadDirectionShift):
            with suppress(Impossible):
                goal = _goal(run.behavior, around)
                self._turn(track, goal, now, run, self._aim_of(run.behavior, now), run.course.arrival)

    def _turn(
        self, track: Track, goal: tuple[float, ...], now: Seconds, run: Run | None, aim: Aim | None, arrival: str
    ) -> None:  # fmt: skip
        """Turn the head to a goal if that is noticeably elsewhere than where it goes."""
        going = np.array(track.going) + np.array(
            [*self._added({**self.planned_raw(now), "torso": self.tracks["torso"].going}), 0.0]
        )
        if all(abs(a - b) < NOTICEABLE for a, b in zip(goal, going.tolist(), strict=True)):
            return
        here = self._state("head", now)
        if run is None:
            track.motion, track.aim = Motion(self.way("head", here, goal), now), aim
            return
        arrived = not run.awaits(arrival)
        marks = [(each.sync, 0.0 if arrived else 1.0) for each in run.pending if each.sync in run.motion.path.marks]
        left = max(SHORTEST, run.motion.end - now) if not arrived else 0.0
        time = max(left, courses.seconds("head", here.q.tolist(), goal), SHORTEST if not here.at_rest else 0.0)
        self._play(
            run, Path(here, (Leg(goal=goal, seconds=time, marks=tuple(marks)),), self._limits["head"]), now, aim
        )

    # -- measured joints ----------------------------------------------------------------------------------------

    def _of_track(self, name: str, now: Seconds) -> tuple[float, ...]:
        return joints.of_track(name, self.measured, self.planned(now - self._lag))

    def off(self, name: str, now: Seconds, there: Sequence[float]) -> Off:
        """Tell how far the measured joints of a track are off some angles."""
        return farthest(name, self._of_track(name, now), there, self._near)

    def off_run(self, run: Run, sync: str, now: Seconds) -> Off:
        """Tell how far the measured joints are off a sync point, or off the nearest place on the way behind it.

        A look is on its target by the gaze axis: what counts are the angles that look there from where the eyes are.
        """
        track = run.track
        if track == "head":
            look = self.look if run.is_homeward else run.behavior
            return self.off_target(look if isinstance(look, courses.Looks) else None, now)
        path = run.motion.path
        mark = path.marks[sync]
        s = min(run.motion.s(now), mark + BEHIND)  # later it may be where a stuck joint is
        places = np.linspace(mark, s, SAMPLES).tolist() if s - mark > 1e-6 else [mark]
        offs = [self.off(track, now, path.at(place).q.tolist()) for place in places]
        return min(offs, key=lambda off: off.share)

    def off_target(self, look: courses.Looks | None, now: Seconds) -> Off:
        """Tell how far the measured gaze axis is off the target of a look; None: off where the head will rest."""
        there, here = self._on_target(look), self._of_track("head", now)
        allowed = self._near["head_yaw"]
        if look is not None and (entity := self.world.entity(look.target)) is not None:
            away = math.dist(entity.position, geometry.gaze(self.measured, self.mounting).origin)
            allowed += FOLLOWING * self._speeds.of(entity.id, now) / max(away, 0.1)
        aside, up = (there[0] - here[0]) * math.cos(here[1]), there[1] - here[1]
        worst = 0 if abs(aside) > abs(up) else 1
        return Off(("head_yaw", "head_pitch")[worst], math.hypot(aside, up) / allowed, here[worst], there[worst])

    def follows(self, run: Run, now: Seconds) -> bool:
        """True if what a look is on its way to moves: then its plan is laid anew again and again, and has no end."""
        return run.track == "head" and self._speeds.of(getattr(run.behavior, "target", ""), now) > 0.0

    def _on_target(self, look: courses.Looks | None) -> tuple[Radians, Radians]:
        track = self.tracks["head"]
        yaw, pitch, _ = track.going
        if look is None:
            return yaw, pitch
        body = (self.measured["body_yaw"], self.measured["body_lean"])
        around = Circumstances({**joints.HOME, "torso": body}, {}, self.world, self.mounting)
        try:
            return courses.look_at(look, around.tracks, around)
        except Impossible:  # it has vanished: what counts is where it was
            return yaw, pitch

    def is_astray(self, now: Seconds) -> bool:
        """True if nothing moves, and joints are not where they were sent: somebody else has moved them."""
        if now < self.end + 1.0:
            return False
        sent = joints.summed(self.planned(now))
        return any(abs(self.measured[name] - sent[name]) > ASTRAY for name in ("head_yaw", "head_pitch", "body_yaw"))

    def settle(self, now: Seconds) -> None:
        """Begin anew from where the joints are measured, at rest. Where tracks go home to stays."""
        self.trim.clear()
        turn = max(joints.TRACKS["torso"][0].low, min(joints.TRACKS["torso"][0].high, self.measured["body_yaw"]))
        tracks: Tracks = {"nod": joints.HOME["nod"], "torso": (turn, self.measured["body_lean"])}
        tracks["head"] = (self.measured["head_yaw"], self.measured["head_pitch"], self.measured["body_yaw"] - turn)
        tracks["face"] = (self.measured["right_antenna"], self.measured["left_antenna"])
        tracks["nod"] = (0.0, 0.0, self.measured["head_roll"])
        for name, track in self.tracks.items():
            track.motion, track.aim = Motion(Path(resting(tracks[name]), (), self._limits[name]), now), None
        nod = self.tracks["nod"]  # nothing else brings a roll home
        nod.motion = Motion(self.way("nod", resting(tracks["nod"]), nod.base), now)

    def stand(self, since: Seconds, now: Seconds) -> None:
        """Go on from where the plan was at an instant, at rest: no command has come through since then.

        `GAP` of the time that has passed counts, else a stream with many gaps would never bring anything to its goal.
        """
        now -= GAP
        for name, track in self.tracks.items():
            if track.motion.end <= since:
                continue
            run, q, s = self.runs.get(name), track.motion.at(since).q, track.motion.s(since)
            if run is not None and run.motion is track.motion:
                left = track.motion.path.after(s, [each.sync for each in run.pending])
                self._play(run, Path(resting(q), left, self._limits[name]), now, track.aim)
            else:
                left = track.motion.path.after(s)
                track.motion = Motion(Path(resting(q), left, self._limits[name]), now)


def _goal(look: courses.Looks, around: Circumstances) -> tuple[float, ...]:
    """Angles of the head's track on the target of a look. Raises Impossible."""
    return courses.course(look, around).goal
