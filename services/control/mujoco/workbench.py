"""The torso at its table in MuJoCo: what its joints measure, what lies on the table, and what is wrong with it.

Time and plans are arguments; nothing here knows a loop.
"""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.control.figure.kinematics import LIMIT
from engage_hri.services.control.mujoco import model
from engage_hri.services.control.mujoco.faults import conditions, noise, obstacles, table_rise
from engage_hri.services.control.mujoco.physics import Array, Physics
from engage_hri.services.control.mujoco.room import Room
from engage_hri.services.tangram.table import tangram_table

PARTS = {joint: LIMIT[joint].part for joint in model.MOTORS}
"""The part of each joint."""


class Workbench:
    """The robot, the table and the pieces. measured: joint angles as the encoders tell them."""

    def __init__(self, plan: Mapping[str, Radians], at: Seconds, seed: int = 0) -> None:
        table = tangram_table()
        self.model = mujoco.MjModel.from_xml_string(model.scene(table))
        self.physics = Physics(self.model, model.MOTORS, LIMIT, at=at, seed=seed)
        self.physics.place({joint: plan[joint] for joint in self.physics.joints})
        self.measured: dict[str, Radians] = {}
        self.room = Room(self.physics)
        self._measure()

    # -- time ---------------------------------------------------------------------------------------------------

    def advance(self, to: Seconds, plan: Mapping[str, Radians]) -> bool:
        """Compute up to `to`, at which the servos are to be where `plan` has them. False: not all is done yet."""
        is_done = self.physics.advance(to, self._reference(plan))
        self._measure()
        return is_done

    def rise(self, at: Seconds) -> None:
        """Go on after a rest."""
        self.physics.skip(at)

    def is_at_rest(self, plan: Mapping[str, Radians]) -> bool:
        """True if nothing moves, and the plan does not, either."""
        return self.physics.is_at_rest(self._reference(plan))

    def _reference(self, plan: Mapping[str, Radians]) -> Array:
        return np.array([plan[joint] for joint in self.physics.joints])

    def calibrate(self, offsets: Mapping[str, Radians]) -> None:
        """Correct exactly these encoders by what a true angle is more than they tell."""
        self.physics.calibrate({joint: offsets.get(joint, 0.0) for joint in self.physics.joints})
        self._measure()

    def _measure(self) -> None:
        self.measured = dict(zip(self.physics.joints, self.physics.measured.tolist(), strict=True))

    # -- faults -------------------------------------------------------------------------------------------------

    def suffer(self, faults: Sequence[BodyFault]) -> None:
        """Take exactly these faults from now on."""
        physics = self.physics
        told = noise(faults, physics.joints, PARTS)
        physics.suffer(conditions(faults, physics.motors, PARTS), told)
        for box, place in obstacles(faults).items():
            physics.put(box, place)
        self._raise_table(table_rise(faults))
        self._measure()

    def _raise_table(self, by: float) -> None:
        """Put the table, with what lies on it, higher by so much than the body believes."""
        if abs(by - self.room.rise) > 1e-9:
            x, y, top = tangram_table().surface.center
            self.physics.put("high table", (x, y, top + by - model.BOARD if by else model.AWAY))
            self.room.lift(by)

    def suspicion(self, joint: str) -> str:
        """Tell what a joint that does not come has against it, as far as motor and contacts say."""
        touched = self._touched(joint)
        found = [*self.physics.complaints(joint), *([f"it is in contact with {touched}"] if touched else [])]
        return "; ".join(found)

    def _touched(self, joint: str) -> str:
        side = joint.partition("_")[0]
        parts = {"left": "left_forearm", "right": "right_forearm", "neck": "nose", "torso": "belly"}
        return next((each.thing for each in self.physics.contacts() if each.robot == parts.get(side)), "")
