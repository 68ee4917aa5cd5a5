"""Measurements of where a body really looks and points: it does so at marks, and somebody says what it hit."""

from collections.abc import AsyncGenerator, Callable, Collection, Sequence
from contextlib import aclosing
from math import degrees
from typing import Protocol

import numpy as np

from engage_hri.schemas.behaviors import Gaze, Hand, Pointing
from engage_hri.schemas.body import Ray
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Meters, Seconds, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.calibrating.fitting import Measurement
from engage_hri.services.control.contract.body import (
    Arrived,
    BehaviorRefused,
    Body,
    BodyFailed,
    BodyState,
    MovementAuthority,
    Progress,
    within,
)

ON_TARGET = "stroke"
"""The last point that a look or a point may pass: it stands on its target from then on."""
HANDS: dict[str, Hand] = {"left_arm": "LEFT_HAND", "right_arm": "RIGHT_HAND"}
TABLE: Meters = 0.73
"""Height of the marks on the table."""
COLUMNS: tuple[Meters, ...] = (-0.45, -0.3, -0.15, 0.0, 0.15, 0.3, 0.45)
ROWS: tuple[Meters, ...] = (0.38, 0.52, 0.66)
FACES: tuple[Vector, ...] = ((1.3, -0.4, 1.2), (1.3, 0.0, 1.3), (1.3, 0.4, 1.2))
OTHER_ROWS: tuple[Meters, ...] = (0.45, 0.59)
PATIENCE: Seconds = 10.0
"""Seconds that nothing may come of a look or a point, besides `SLOWEST` times what all of it takes."""
SLOWEST = 30.0
HOME: Seconds = 60.0
"""Seconds in which a body comes home."""


class Stuck(Exception):
    """A look or a point that does not go on; the message says why it is believed to be."""


class Eyes(Protocol):
    """Source of where a part really looks or points."""

    async def place(self, part: str, mark: Entity, state: BodyState) -> Vector | None:
        """A place in metres at which it really does; None: they cannot say. state: what the body measures."""


class SimulatedEyes:
    """Eyes of a simulation, which see the truth but for a spread. spread: standard deviation along each axis."""

    def __init__(self, body: Body, spread: Meters, seed: int = 0) -> None:
        self._body = body
        self._spread = spread
        self._chance = np.random.default_rng(seed)

    async def place(self, part: str, mark: Entity, state: BodyState) -> Vector | None:
        seen = self._body.seen() or state
        ray: Ray | None = seen.gaze if part == "head" else getattr(seen, part)
        if ray is None:
            return None
        origin, axis = np.asarray(ray.origin), np.asarray(ray.axis)
        place = origin + axis * np.linalg.norm(np.subtract(mark.position, origin))
        x, y, z = (place + self._chance.normal(0.0, self._spread, 3)).tolist()
        return (x, y, z)


def marks(rows: Sequence[Meters] = ROWS, faces: Sequence[Vector] = FACES) -> World:
    """Marks in a grid on the table, and some where faces would be."""
    places = [*((x, y, TABLE) for x in rows for y in COLUMNS), *faces]
    return World(
        entities=tuple([Entity(id=f"mark-{n}", kind="object", position=place) for n, place in enumerate(places, 1)])
    )


async def measured(
    body: Body, world: World, parts: Collection[str], eyes: Eyes, tell: Callable[[str], None]
) -> list[Measurement]:
    """Make the body look and point at all of the world that it can reach; returns where it really did.

    parts: head, left_arm, right_arm. tell: told what could not be done. A part that gets stuck is measured no
    further. Raises BodyFailed: it does not come home.
    """
    body.see(world)
    found: list[Measurement] = []
    await _home(body)
    try:
        for part in parts:
            try:
                for mark in world.objects:
                    measurement = await _one(body, world, part, mark, eyes, tell)
                    found += [measurement] if measurement is not None else []
            except Stuck as stuck:
                tell(f"{stuck}; the {part} is measured no further")
    finally:
        await _home(body)
    return found


async def _home(body: Body) -> None:
    try:
        await within(HOME, body.home())
    except TimeoutError as late:
        reason = f"it is not in its safe pose {HOME:g} s after it was told to go there"
        raise BodyFailed(Fault(reason=reason, where="home", service="control")) from late


async def _one(
    body: Body, world: World, part: str, mark: Entity, eyes: Eyes, tell: Callable[[str], None]
) -> Measurement | None:
    behavior: Gaze | Pointing = Gaze(id=f"look-{mark.id}", target=mark.id)
    if part != "head":
        behavior = Pointing(id=f"point-{mark.id}", target=mark.id, mode=HANDS[part])
    estimate = body.estimate(behavior, None, world)
    if not estimate.feasible:
        return None
    planned = sum(phase.natural for phase in estimate.phases)
    authority, found = MovementAuthority(behavior, ON_TARGET), None
    try:
        async with aclosing(body.perform(behavior, authority)) as stream:
            while (progress := await _next(stream, planned, f"{part} at {mark.id}")) is not None:
                if isinstance(progress, Arrived):
                    state = body.state()
                    said = state.gaze if part == "head" else getattr(state, part)
                    if said is not None and (seen := await eyes.place(part, mark, state)) is not None:
                        joints = {angle.joint: degrees(angle.angle) for angle in state.pose.joints}
                        found = Measurement(part=part, joints=joints, said=said, seen=seen)
                    authority.extend("end")
    except (BehaviorRefused, BodyFailed) as error:
        tell(f"{part} at {mark.id}: {error}")
    return found


async def _next(stream: AsyncGenerator[Progress, None], planned: Seconds, what: str) -> Progress | None:
    """The next progress of a behavior; None: it is over. planned: seconds that it takes. Raises Stuck."""
    limit = PATIENCE + SLOWEST * planned
    try:
        return await within(limit, anext(stream, None))
    except TimeoutError as late:
        raise Stuck(f"{what}: nothing has come of it for {limit:.0f} s; {planned:.1f} s were planned") from late
