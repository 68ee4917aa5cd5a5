"""A head on two servos that take set points: `engage check-body set_point_robot.py`."""

import math

from engage_hri import Head, JointLimit, Ray, SetPointBody, SimulatedServos


class SetPointRobot(SetPointBody):
    name, part, types = "set-point-robot", "head", ("gaze", "gazeShift", "head")
    joints = tuple(
        JointLimit(joint=joint, part="head", low=-1.5, high=1.5, speed=5.0, acceleration=60.0)
        for joint in ("pan", "tilt")
    )
    settling = 0.15  # seconds by which the servos lag

    async def open(self):
        self.servos = SimulatedServos(self.joints)  # your SDK

    def send(self, angles):
        self.servos.send(angles)

    def angles(self):
        return self.servos.angles()

    def aim(self, behavior, world):
        if isinstance(behavior, Head):
            return {"pan": 0.0, "tilt": -0.3}
        x, y, z = (there - here for there, here in zip(self.position(behavior, world), self.eyes, strict=True))
        return {"pan": math.atan2(y, x), "tilt": math.atan2(z, math.hypot(x, y))}

    def gaze(self, angles):
        pan, tilt = angles["pan"], angles["tilt"]
        axis = (math.cos(tilt) * math.cos(pan), math.cos(tilt) * math.sin(pan), math.sin(tilt))
        return Ray(origin=self.eyes, axis=axis)
