"""Attention of the head of one person to the robot, and where this head points when it surely attends. Pure.

    attending = Attending()
    much = attending.judge(offset, at, is_free=True)

An offset is where the robot's face is, seen from a head: degrees to its left and upwards of the direction in which
the head points. Heads of people who attend to a robot point some twenty degrees beside its camera: they look at its
middle, at what it holds, or with the eyes alone (recordings of ROS4HRI's hri_engagement, where a cone of 20 degrees
tells the engaged from the disengaged, and one of 10 finds neither). So the cone is wide at first. But each person has
a habit: a head that keeps still for a second in the sure part of the cone, and is on nothing else, attends; its mean
offset is learned. From then on this head attends when it points anywhere between the robot's face and the learned
offset, or a little beside. That is less than the wide cone to all other sides, and more to the one of the habit.

Where it is known from elsewhere what somebody looks at, the habit is not guessed but measured (`sure_looks.py`): what
is told of looks at the robot is its habit, too, and all other looks are mended by it.
"""

import math

from engage_hri.schemas.units import Degrees, Probability, Seconds
from engage_hri.services.recognition.perceive.sure_looks import Angles, SureLooks

FULL_ATTENTION: Degrees = 20.0
"""Angle between a head and the line to the robot's face up to which the head attends to it, by these recordings, as
long as no more is known of the person."""
NO_ATTENTION: Degrees = 30.0
"""Angle from which on it does not."""
FULL_BESIDE: Degrees = 8.0
"""Angle beside what has been learned up to which the head attends."""
NONE_BESIDE: Degrees = 14.0
"""Angle from which on it does not."""
SURE: Probability = 0.5
"""Attention by the wide cone from which on a head that keeps still is learned from."""
STILL: Degrees = 4.0
"""Angle by which a head that keeps still may move."""
STILL_FOR: Seconds = 1.0
"""Time for which it has to: a head that only passes is not learned from."""
LEARNED_AFTER: Seconds = 2.0
"""Time of keeping still after which all of the habit counts; before, in proportion."""
HABIT_MEMORY: Seconds = 20.0
"""Time of keeping still over which the habit is the mean: it changes slowly, with the person's posture."""
LONGEST_STEP: Seconds = 0.5
"""Time from one pose to the next for which the head is taken to have kept still."""
Offset = Angles


def attention(angle: Degrees, full: Degrees = FULL_ATTENTION, none: Degrees = NO_ATTENTION) -> Probability:
    """Attention of a head to the robot: 1 up to an angle of `full`, 0 from `none` on, in between in proportion."""
    return max(0.0, min(1.0, (none - angle) / (none - full)))


class Attending:
    """Habit of one person, and how much their head attends to the robot."""

    def __init__(self) -> None:
        self.habit: Offset = (0.0, 0.0)
        """Mean offset of the head while it surely attended, no longer than `FULL_ATTENTION`."""
        self.sure = SureLooks()
        """Looks of which it is known at what they are."""
        self._learned_for: Seconds = 0.0
        """Time of keeping still from which the habit is known."""
        self._anchor: Offset | None = None
        """Offset from when on the head keeps still."""
        self._still_since = self._judged_at = -math.inf

    def judge(self, offset: Offset, at: Seconds, *, is_free: bool) -> Probability:
        """Judge how much the head attends to the robot, 0 to 1, and learn.

        offset: of the robot's face, seen from the head. at: of the pose. is_free: the gaze is on nothing else.
        """
        self._learn(offset, at, is_free=is_free)
        measured = self.sure.at_robot
        known = 1.0 if measured else min(1.0, self._learned_for / LEARNED_AFTER)
        habit = measured or self.habit
        full = FULL_ATTENTION + known * (FULL_BESIDE - FULL_ATTENTION)
        none = NO_ATTENTION + known * (NONE_BESIDE - NO_ATTENTION)
        return attention(_beside(offset, (known * habit[0], known * habit[1])), full, none)

    def _learn(self, offset: Offset, at: Seconds, *, is_free: bool) -> None:
        step, self._judged_at = at - self._judged_at, at
        angle = math.hypot(*offset)
        if not is_free or attention(angle) < SURE:
            self._anchor = None
            return
        if self._anchor is None or step > LONGEST_STEP or math.dist(self._anchor, offset) > STILL:
            self._anchor, self._still_since = offset, at
        if at - self._still_since < STILL_FOR:
            return
        self._learned_for = min(HABIT_MEMORY, self._learned_for + step)
        weight, bound = step / self._learned_for, FULL_ATTENTION / max(angle, FULL_ATTENTION)
        left, up = self.habit
        self.habit = left + weight * (bound * offset[0] - left), up + weight * (bound * offset[1] - up)


def _beside(offset: Offset, habit: Offset) -> Degrees:
    """Distance of an offset from the line between none and the habit."""
    square = habit[0] ** 2 + habit[1] ** 2
    along = 0.0 if square == 0.0 else (offset[0] * habit[0] + offset[1] * habit[1]) / square
    along = max(0.0, min(1.0, along))
    return math.hypot(offset[0] - along * habit[0], offset[1] - along * habit[1])
