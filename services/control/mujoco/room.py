"""The things in the room: the pieces on the table follow the world, unless the robot has pushed them."""

import math
from math import cos, sin

import mujoco

from engage_hri.schemas.units import Meters, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.mujoco.model import THICKNESS
from engage_hri.services.control.mujoco.physics import Physics
from engage_hri.services.tangram.table import tangram_table

MOVED: Meters = 0.01
"""A piece that the world has this much elsewhere than before was moved by somebody."""


class Room:
    """The pieces on the table. rise: metres by which the table is higher than it seems."""

    def __init__(self, physics: Physics) -> None:
        self._physics = physics
        self._pieces = [piece.id for piece in tangram_table().pieces]
        self._seen: dict[str, Vector] = {}
        self.rise: Meters = 0.0

    def lay(self, world: World) -> None:
        """Lay the pieces where the world has them, as far as that has moved them since."""
        for entity in world.entities:
            before = self._seen.get(entity.id)
            if entity.id in self._pieces and (before is None or math.dist(before, entity.position) > MOVED):
                self._seen[entity.id] = entity.position
                self._put(entity)
        mujoco.mj_forward(self._physics.model, self._physics.data)

    def lift(self, rise: Meters) -> None:
        """Lift the pieces with the table."""
        for piece in self._pieces:
            self._physics.data.joint(piece).qpos[2] += rise - self.rise
        self.rise = rise
        mujoco.mj_forward(self._physics.model, self._physics.data)

    def _put(self, entity: Entity) -> None:
        joint = self._physics.data.joint(entity.id)
        x, y, z = entity.position
        half = entity.yaw / 2
        joint.qpos[:] = (x, y, z + self.rise + THICKNESS / 2, cos(half), 0.0, 0.0, sin(half))
        joint.qvel[:] = 0.0
