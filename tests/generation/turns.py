"""The robot's turns alone, and who is in sight of it."""

from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.deadlines import Sight
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.turns.robot_turns import RobotTurns


def robot_turns(sight: Sight | None = None, **config: object) -> RobotTurns:
    return RobotTurns("robot", GenerationConfig(**config), sight=sight)  # type: ignore[arg-type]


def seen(*people: str) -> World:
    """A world in which these people are in sight."""
    persons = tuple(Entity(id=id, kind="person", position=(1.0, 0.0, 1.2)) for id in people)
    return World(entities=persons)
