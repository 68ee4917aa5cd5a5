"""A robot whose motors take set points: an angle for each joint, many times a second, and no motion of their own.

Hobby servos and most SDKs are like this. A goal that is sent to such motors at once is a jump: they race to it as
fast as they can, and past it. A motion that is planned anew from standing, when another behavior takes over, is a
jerk. So somebody has to plan the motion, keep its position and speed, and send a set point at each instant. That is
the same for all of these robots, and so it is here: a driver says where a behavior has its target, sends set points,
and reads angles.

    class PanTilt(SetPointBody):
        def aim(self, behavior, world): ...      # joint angles on target
        def send(self, angles): ...              # one set point for each joint
        def angles(self): ...                    # as measured

`SimulatedServos` stands for the SDK until there is a robot.
"""

import asyncio
import math
from abc import abstractmethod
from collections.abc import AsyncIterator, Awaitable, Sequence
from contextlib import asynccontextmanager

import numpy as np

from engage_hri.schemas.body import JointLimit
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.bases.one_part_motion import Angles, OrdinaryBody
from engage_hri.services.control.motion.motion import Motion
from engage_hri.services.control.motion.path import JointMotion, Leg, Path, resting


class SetPointBody(OrdinaryBody):
    """A robot with one part whose motors take set points: derive a driver from it.

    What a driver says of its robot is in `OrdinaryBody`. `rate` is also the number of set points per second.
    """

    rate = 100.0

    def __init__(self) -> None:
        super().__init__()
        self._motion: Motion | None = None
        """Of the set points, which are ahead of the joints; None: nothing was sent yet."""
        self._ends: Seconds = 0.0
        self._begun = asyncio.Event()

    @abstractmethod
    def send(self, angles: Angles) -> Awaitable[None] | None:
        """Send one set point. It may be a coroutine; then the next one waits for it.

        angles: the angle of each joint, radians. It is within the limits of the joints.

        Raises:
            BodyFailed: the motors take none.
        """

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        async with super().connected():
            sending = asyncio.create_task(self._send_set_points(), name=f"set points of {self.name}")
            try:
                yield
            finally:
                sending.cancel()
                await asyncio.gather(sending, return_exceptions=True)

    def go(self, goal: Angles, seconds: Seconds) -> None:
        now = asyncio.get_running_loop().time()
        names = [limit.joint for limit in self.joints]
        leg = Leg(goal=tuple(goal[name] for name in names), seconds=seconds)
        path = Path(self._set_point(now), [leg], self.joints)
        self._motion, self._ends = Motion(path, now), now + path.length
        self._begun.set()

    def _set_point(self, now: Seconds) -> JointMotion:
        """Position and speed of the set points. The first motion begins where the joints are measured."""
        if self._motion is None:
            measured = self.angles()
            return resting([measured[limit.joint] for limit in self.joints])
        return self._motion.at(min(now, self._ends))

    async def _send_set_points(self) -> None:
        """Send where the motion is by now, until it has ended. A motor that stands needs no set points."""
        loop = asyncio.get_running_loop()
        while True:
            await self._begun.wait()
            now = loop.time()
            if now >= self._ends:
                self._begun.clear()  # before the last one, which is sent below: a motion may begin meanwhile
            wanted = self._set_point(now).q.tolist()
            try:
                sent = self.send({limit.joint: angle for limit, angle in zip(self.joints, wanted, strict=True)})
                if sent is not None:
                    await sent
            except Exception as error:  # of the motors, or a mistake of the driver
                self._failure = error
            await asyncio.sleep(1.0 / self.rate)


STIFFNESS = 30.0
"""Of the control loop of a simulated servo, radians per second: a small step takes a hobby servo some 0.15 s."""


class SimulatedServos:
    """Servos that take set points and report angles, without a robot: each follows its set point as a damped spring.

    They lag behind a set point that moves, as real ones do: by `2 / STIFFNESS` seconds.
    """

    def __init__(self, joints: Sequence[JointLimit]) -> None:
        """joints: one servo for each of them, which starts at 0."""
        self._names = [limit.joint for limit in joints]
        self._since: Seconds | None = None
        self._wanted = self._at = np.zeros(len(self._names))
        self._speed = np.zeros(len(self._names))

    def send(self, angles: Angles) -> None:
        """Take set points. angles: one for each joint, radians."""
        self._go_on()
        self._wanted = np.array([angles[name] for name in self._names])

    def angles(self) -> Angles:
        """Report the angle of each joint, radians."""
        self._go_on()
        return dict(zip(self._names, self._at.tolist(), strict=True))

    def _go_on(self) -> None:
        """Let the time pass since the last call. The motion of a damped spring is known in closed form."""
        now = asyncio.get_running_loop().time()
        took = now - (now if self._since is None else self._since)
        off, decay = self._at - self._wanted, math.exp(-STIFFNESS * took)
        pull = self._speed + STIFFNESS * off
        self._at = self._wanted + (off + pull * took) * decay
        self._speed = (self._speed - STIFFNESS * pull * took) * decay
        self._since = now
