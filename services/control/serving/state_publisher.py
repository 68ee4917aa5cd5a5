"""Publisher of what the body shows as it moves: its state. It decides how often it looks, and nothing else."""

from collections.abc import Callable
from math import inf

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.body import BodyPose, JointAngle, RobotSeen, RobotState
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.control.contract.body import Body, Idle, Seen
from engage_hri.services.control.contract.calibration import Calibration
from engage_hri.services.runtime.loop import Timer

IDLE: Seconds = 1.0
"""Interval of `RobotState` messages while nothing moves."""
MOVING: Seconds = 0.25
"""Longest interval while anything moves. Whoever needs more listens to `keys.ROBOT_MOTION`."""
EPSILON: Seconds = 1e-6


class Shown:
    """Looks at the body many times a second while it moves, and tells what has changed.

    Whether somebody listens to `keys.ROBOT_MOTION` changes nothing else: the eyes are watched as often in any case.
    """

    def __init__(
        self,
        bus: Bus,
        body: Body,
        rate: float,
        on_look: Callable[[str], None],
        calibration: Calibration | None = None,
    ) -> None:
        """rate: looks a second while anything moves. on_look: told at each of them what the eyes rest on.

        calibration: says how far what is measured may be beside.
        """
        self._calibration = calibration or Calibration()
        self._bus = bus
        self._body = body
        self._on_look = on_look
        self._interval = 1.0 / rate
        self._next = Timer(self.look)
        self._looked: Seconds = -inf
        self._is_beside = False
        """True if it was told last that the body is elsewhere than it measures."""
        self._told: tuple[Seconds, tuple[str, str, bool]] = (-inf, ("", "", False))
        """Time of the last message on `keys.ROBOT_STATE`; what it looked at and said, and whether it moved."""

    def look(self) -> None:
        """Publish the state of the body, and set the timer for the next time: soon if the body moves."""
        self._next.set(self._bus.now() + IDLE)
        with self._bus.containing("the state of the body"):
            self._look()

    def _look(self) -> None:
        now, state = self._bus.now(), self._body.state()
        self._looked = now
        self._on_look(state.looking_at)
        widened = self._calibration.widened
        message = RobotState(
            at=self._bus.stamp(now), pose=state.pose, gaze=widened(state.gaze, "head"),
            left_arm=widened(state.left_arm, "left_arm"), right_arm=widened(state.right_arm, "right_arm"),
            looking_at=state.looking_at, speaking=state.speaking,
        )  # fmt: skip
        (at, before), news = self._told, (state.looking_at, state.speaking, state.moving)
        if news != before or now >= at + (MOVING if state.moving else IDLE) - EPSILON:
            self._told = now, news
            self._bus.publish(keys.ROBOT_STATE, message)
        self._tell_seen(now)
        wait = self._interval if state.moving else IDLE
        if self._bus.is_heard(keys.ROBOT_MOTION):
            idle = self._body.idle()
            self._bus.publish(keys.ROBOT_MOTION, self._with_idle(message, idle))
            if idle.added and not state.moving:
                wait = max(self._interval, min(MOVING, idle.quick_at - now))
        self._next.set(now + wait)

    def _with_idle(self, state: RobotState, idle: Idle) -> RobotState:
        """The state with what the body adds to it by itself."""
        if not idle.added:
            return state
        pose = BodyPose(
            joints=tuple([JointAngle(it.joint, it.angle + idle.added.get(it.joint, 0.0)) for it in state.pose.joints])
        )
        rays = {
            field: self._calibration.widened(self._body.ray_at(part, pose), part) or getattr(state, field)
            for field, part in (("gaze", "head"), ("left_arm", "left_arm"), ("right_arm", "right_arm"))
        }
        return replace(state, pose=pose, **rays)

    def _tell_seen(self, now: Seconds) -> None:
        """Publish where a simulated body really is, as long as that is not where it measures."""
        seen = self._body.seen()
        if seen is not None or self._is_beside:
            rays = seen or Seen()
            message = RobotSeen(
                at=self._bus.stamp(now), gaze=rays.gaze, left_arm=rays.left_arm, right_arm=rays.right_arm
            )
            self._bus.publish(keys.ROBOT_SEEN, message)
        self._is_beside = seen is not None

    def look_soon(self) -> None:
        """Bring the next look forward, as something has begun to move."""
        due = self._looked + self._interval
        if self._next.at is None or self._next.at > due:
            self._next.set(due)

    def close(self) -> None:
        """Look no more."""
        self._next.set(None)
