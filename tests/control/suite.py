"""What the contract suite is made of: a world, behaviors, and a stage with the authority in the hand of the test."""

import asyncio
import math
from collections.abc import AsyncIterator, Sequence

import pytest

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.behaviors import (
    BlockBehavior,
    FaceLexeme,
    Gaze,
    GazeShift,
    Gesture,
    Head,
    Mark,
    Pointing,
    Posture,
    PostureShift,
    Speech,
    Wait,
)
from engage_hri.schemas.body import Ray
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.body import (
    Arrived,
    Body,
    MovementAuthority,
    Progress,
    Reached,
)

WORLD = World(
    entities=(
        Entity(id="human", kind="person", position=(1.3, 0.0, 1.2)),
        Entity(id="near-right", kind="object", position=(0.45, -0.25, 0.73), radius=0.03),
        Entity(id="far-left", kind="object", position=(0.70, 0.30, 0.73), radius=0.03),
    )
)
BEHAVIORS: tuple[BlockBehavior, ...] = (
    Gaze(id="gaze", target="near-right"),
    GazeShift(id="gazeShift", target="far-left"),
    Pointing(id="pointing", target="far-left"),
    Gesture(id="gesture", lexeme="BEAT"),
    Head(id="head", lexeme="NOD"),
    Head(id="nods", lexeme="NOD", repetition=3),
    FaceLexeme(id="faceLexeme", lexeme="SMILE"),
    Posture(id="posture", lexeme="LEAN_FORWARD"),
    PostureShift(id="postureShift", lexeme="TURN_LEFT"),
    Speech(id="speech", text="This piece, please.", marks=(Mark("m", 5),)),
    Wait(id="wait", duration=0.5),
)
HOLDS = {name: row.holds for name, row in TYPES.items() if row.holds}
"""Where each type can wait, as the realizer knows it."""
ONE_INSTANT = {name: row.one_instant for name, row in TYPES.items() if row.one_instant}
"""Points of a type that always coincide, as the realizer knows it."""
PATIENCE = 30.0
ON_AXIS = math.radians(1.0)
"""Greatest angle between the gaze axis and its target."""


def default(points: Sequence[str]) -> tuple[str, ...]:
    """Without `stroke:2` and on, which a body may tell of or not."""
    return tuple(sync for sync in points if not sync.startswith("stroke:"))


def times(progress: Sequence[Progress]) -> dict[str, float]:
    """When each sync point was passed."""
    return {item.sync: item.at for item in progress if isinstance(item, Reached)}


async def performed(body: Body, behavior: BlockBehavior, through: str = "end") -> list[Progress]:
    authority = MovementAuthority(behavior, through)
    return [progress async for progress in body.perform(behavior, authority)]


class Stage:
    """A behavior under way, with the authority in the test's hand."""

    def __init__(self, body: Body, behavior: BlockBehavior, through: str = "start") -> None:
        self.authority = MovementAuthority(behavior, through)
        self.progress: list[Progress] = []
        self._body, self._behavior = body, behavior
        self.task = asyncio.create_task(self._perform(), name=f"stage {behavior.id}")

    async def _perform(self) -> None:
        async for progress in self._body.perform(self._behavior, self.authority):
            self.progress.append(progress)

    @property
    def passed(self) -> list[str]:
        return [item.sync for item in self.progress if isinstance(item, Reached)]

    @property
    def waits_at(self) -> list[str]:
        return [item.sync for item in self.progress if isinstance(item, Arrived)]

    async def over(self) -> list[Progress]:
        await asyncio.wait_for(self.task, PATIENCE)
        return self.progress


class Suite:
    """Base of the contract suite. tolerance: the stated error of the body's estimates, seconds per sync point."""

    tolerance = 1e-6
    behaviors: tuple[BlockBehavior, ...] = BEHAVIORS
    world = WORLD

    def make(self) -> Body:
        raise NotImplementedError

    @pytest.fixture
    async def body(self) -> AsyncIterator[Body]:
        body = self.make()
        async with body.connected():
            body.see(self.world)
            yield body

    def holds(self, body: Body, behavior: BlockBehavior) -> tuple[str, ...]:
        """Where it can wait; in a speech where the body says so, at marks between two words."""
        if not isinstance(behavior, Speech):
            return HOLDS.get(type_name(behavior), ())
        return tuple(phase.to for phase in body.estimate(behavior, None, self.world).phases if phase.hold)

    def position(self, entity: str) -> Vector:
        found = self.world.entity(entity)
        assert found is not None
        return found.position

    def able(self, body: Body) -> list[BlockBehavior]:
        able = [behavior for behavior in self.behaviors if type_name(behavior) in body.capabilities.types]
        assert able, "a body that can do none of the suite's behaviors"
        return able


def aside(ray: Ray, point: Vector) -> float:
    """Radians between a ray and the direction from its origin to a point."""
    way = [there - here for here, there in zip(ray.origin, point, strict=True)]
    along = sum(a * b for a, b in zip(ray.axis, way, strict=True))
    return math.acos(max(-1.0, min(1.0, along / math.hypot(*way))))


def poses_agree(one: object, other: object) -> bool:
    angles = [{angle.joint: angle.angle for angle in pose.joints} for pose in (one, other)]  # type: ignore[attr-defined]
    return all(abs(angles[0][joint] - angles[1][joint]) < 0.01 for joint in angles[0])
