"""Gaze of the simulated torso: the base gaze, the entity the eyes rest on, and following entities that move. Pure."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import inf, radians

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, HeadDirectionShift
from engage_hri.schemas.body import JointLimit
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import choreography, tracks
from engage_hri.services.control.figure.course import NECK, Aim, Course, Situation, turning_time
from engage_hri.services.control.figure.runs import Run
from engage_hri.services.control.figure.table_clearance import SHORTEST
from engage_hri.services.control.figure.tracks import PartTrack
from engage_hri.services.control.motion.motion import is_shift
from engage_hri.services.control.motion.path import JointMotion, Leg, Path

NOTICEABLE = radians(0.5)
"""Radians: a target that moves less does not move the head."""


class Fixation:
    """The base gaze and the fixation: the entity that the eyes rest on, and the instant from which they do.

    The instant of a fixation is known in advance, since the motion that leads to it is.
    """

    def __init__(self) -> None:
        self.base: BlockBehavior | None = None
        self.angles = tracks.HOME["head"]
        self.aim: Aim | None = None
        """The place that the base gaze is on."""
        self._entity = ""
        self._since: Seconds = 0.0

    @property
    def entity(self) -> str:
        """Id of the entity of the base gaze; empty: none."""
        return choreography.eye_target(self.base)

    def shift(self, behavior: BlockBehavior, course: Course) -> None:
        self.base = choreography.with_head(behavior)
        self.angles, self.aim = _target(course.on_target), course.aim

    def stay(self, angles: tuple[float, ...]) -> None:
        """Make a direction the base gaze, without an entity."""
        self.base, self.angles, self.aim = None, angles, None

    def update(self, situation: Situation) -> None:
        """Turn the base after its entity; the last direction stays when it is gone or out of view."""
        if self.base is not None:
            with suppress(Impossible):
                self.shift(self.base, choreography.plan(self.base, situation))

    def angles_at(self, trunk: Sequence[float]) -> tuple[float, ...]:
        """Angles of the base gaze with the trunk elsewhere."""
        return self.angles if self.aim is None else tuple((self.aim.offset(trunk) + self.angles).tolist())

    def fixated(self, now: Seconds) -> str:
        """Id of the entity that the eyes rest on; empty: none."""
        return self._entity if now >= self._since else ""

    def expect(self, entity: str, since: Seconds | None, now: Seconds) -> None:
        """Expect the eyes to rest on `entity` from `since` on; None: never. If they do already, nothing changes."""
        if entity and entity == self.fixated(now):
            return
        self._entity, self._since = entity, inf if since is None else since

    def follow_run(self, run: Run, now: Seconds) -> None:
        """Expect the fixation that the motion of `run` leads to: its target, or the base again."""
        marks, motion = run.motion.path.marks, run.motion
        if isinstance(run.behavior, Gaze):
            if run.awaits("stroke"):
                self.expect(choreography.eye_target(run.behavior), motion.crossing(marks["stroke"]), now)
            elif not run.awaits("relax"):
                self.expect(self.entity, motion.crossing(marks["end"]), now)
        elif isinstance(run.behavior, GazeShift | HeadDirectionShift) and run.awaits("end"):
            self.expect(choreography.eye_target(run.behavior), motion.crossing(marks["end"]), now)


def turn(track: PartTrack, goal: tuple[float, ...], now: Seconds, aim: Aim | None) -> None:
    """Turn the head to `goal`, on the place of `aim`, if it is noticeably elsewhere than where it goes."""
    if differ(goal, track.going(None if aim is None else aim.trunk)):
        track.return_to(goal, now, aim)


def way_back(here: tuple[float, ...], base: tuple[float, ...]) -> Leg:
    """Leg from a fixation back to the base gaze."""
    seconds = turning_time(here, base)
    return Leg(goal=base if seconds else here, seconds=seconds, marks=(("end", 1.0),))


def retargeted(
    run: Run, course: Course, start: JointMotion, limits: tuple[JointLimit, ...], now: Seconds
) -> Path | None:
    """Path for the rest of a gaze or shift, on its way or on its target, that has moved; None: not noticeably.

    course: to where the target is now. start, limits: of its path.
    """
    if not differ(_target(course.on_target), going_to(run.course, course)):
        return None
    left = run.motion.path.after(run.motion.s(now))
    # Of a shift whose trunk still turns, the eyes have arrived.
    legs = course.legs[-1:] if is_shift(run.behavior) and len(left) == 1 else course.legs
    seconds = turning_time(start.q.tolist(), legs[0].goal) if run.holding else _left(run, now)
    return Path(start, (replace(legs[0], seconds=max(seconds, SHORTEST)), *legs[1:]), limits)


def homeward(run: Run, base: tuple[float, ...], track: PartTrack, now: Seconds, aim: Aim | None) -> Path | None:
    """Path for the rest of a look's way home whose base has moved; None: not noticeably."""
    if not differ(base, track.going(None if aim is None else aim.trunk)):
        return None
    leg = replace(run.course.legs[-1], goal=base, seconds=_left(run, now))
    return Path(track.start_at(now, aim), (leg,), track.limits(now, aim))


def going_to(old: Course, new: Course) -> tuple[float, ...]:
    """Target of one course of the head, with the trunk where another has it."""
    assert old.aim is not None
    assert new.aim is not None
    return tuple((old.aim.offset(new.aim.trunk) + _target(old.on_target)).tolist())


def _left(run: Run, now: Seconds) -> Seconds:
    """Seconds of the leg on which the run is."""
    left = run.motion.path.after(run.motion.s(now))
    return max(left[0].seconds if left else 0.0, SHORTEST)


def differ(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return any(abs(a - b) > NOTICEABLE for a, b in zip(one, other, strict=True))


def _target(angles: Mapping[str, float]) -> tuple[float, ...]:
    return tuple(angles[joint] for joint in NECK)
