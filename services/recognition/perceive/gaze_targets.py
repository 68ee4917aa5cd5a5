"""What lies in the direction of a head, and the angle from the gaze to each thing, face and surface.

An angle is measured to the thing's extent: 0 when the gaze goes through its footprint, or the sphere of its radius.
What is covered stays where it was last seen, with a confidence that decays (thesis 5.4.2).
"""

import math
from functools import cached_property, lru_cache
from typing import NamedTuple

from engage_hri.schemas.units import FARTHEST, Meters, Probability, Radians, Seconds, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.recognition.config import RecognitionConfig

Targets = tuple[str, ...]
AWAY: Targets = ()
SURFACE = "table"
"""What a thing lies on when no surface is seen under it."""
SAME_ANGLE: Radians = 1e-6
"""Closer angles are the same; then the nearer thing is in front."""
ROUNDING: Meters = 1e-9


class Seen(NamedTuple):
    """What a gaze is on, and how sure it is that it is there."""

    targets: Targets
    confidence: Probability


class _Thing:
    """radius: of a sphere, 0 for what has an outline. bound: of a sphere around all of it."""

    def __init__(self, entity: Entity, face_radius: Meters) -> None:
        self.entity = entity
        self.radius = 0.0 if entity.footprint else entity.radius or (face_radius if entity.kind == "person" else 0.0)
        self.bound = _extent(entity.footprint) if entity.footprint else self.radius
        self.hidden_since: Seconds | None = None
        """When it was covered; None while it is in view."""

    @cached_property
    def outline(self) -> tuple[Vector, ...]:
        """The corners of its footprint where it is. Made when a gaze comes near: most things are never looked at."""
        x, y, z = self.entity.position
        cos, sin = math.cos(self.entity.yaw), math.sin(self.entity.yaw)
        return tuple((x + cos * u - sin * v, y + sin * u + cos * v, z) for u, v in self.entity.footprint)


@lru_cache(maxsize=256)
def _extent(footprint: tuple[tuple[float, float], ...]) -> Meters:
    return max(math.hypot(x, y) for x, y in footprint)


class _Candidate(NamedTuple):
    """How far from the gaze, to its extent, and how near to the eye; then what it is."""

    angle: Radians
    distance: Meters
    targets: Targets
    confidence: Probability


class _Gaze:
    """A ray from the eyes; the coordinates of what is in front, in units of its depth, across the ray."""

    def __init__(self, eye: Vector, direction: Vector) -> None:
        longest = max(map(abs, direction))
        scaled = [part / longest for part in direction]
        length = math.hypot(*scaled)
        self.eye = eye
        self.axis = x, y, z = scaled[0] / length, scaled[1] / length, scaled[2] / length
        # Any two axes across the gaze: from the one of the world's that is the least along it.
        side = (0.0, -z, y) if abs(x) <= min(abs(y), abs(z)) else (z, 0.0, -x) if abs(y) <= abs(z) else (-y, x, 0.0)
        length = math.hypot(*side)
        self._right = a, b, c = side[0] / length, side[1] / length, side[2] / length
        self._up = (y * c - z * b, z * a - x * c, x * b - y * a)

    def across(self, place: Vector) -> tuple[float, float] | None:
        """Where a place appears: its distance from (0, 0) is the tangent of its angle. None: it is not in front."""
        from_eye = (place[0] - self.eye[0], place[1] - self.eye[1], place[2] - self.eye[2])
        depth = _dot(from_eye, self.axis)
        if depth <= 1e-9:
            return None
        return _dot(from_eye, self._right) / depth, _dot(from_eye, self._up) / depth

    def angle_to(self, thing: _Thing) -> Radians:
        """To the nearest point of the thing."""
        corners = [self.across(corner) for corner in thing.outline]
        if corners and None not in corners:
            return _to_polygon([corner for corner in corners if corner is not None])
        center = thing.entity.position
        distance = math.dist(center, self.eye)
        if distance <= thing.radius:
            return 0.0
        along = sum((one - eye) * axis for one, eye, axis in zip(center, self.eye, self.axis, strict=True))
        angle = math.acos(max(-1.0, min(1.0, along / max(distance, 1e-9))))
        return max(0.0, angle - math.asin(thing.radius / max(distance, 1e-9)))

    def meets(self, surface: _Thing) -> bool:
        """Does it go through the surface's footprint?"""
        height = surface.entity.position[2] - self.eye[2]
        if height * self.axis[2] <= 0.0:
            return False
        far = height / self.axis[2]
        x, y = self.eye[0] + far * self.axis[0], self.eye[1] + far * self.axis[1]
        return _is_inside([(corner[0] - x, corner[1] - y) for corner in surface.outline])


class GazeTargets:
    """The things around, for gazes to be on. robot: its face is known without being seen."""

    def __init__(self, robot: str, config: RecognitionConfig) -> None:
        self._robot = robot
        self._by_table = config.gaze_resolution == "table"
        self._least = config.least_confidence
        self._sensing = config.sensing
        self._half_angle = math.radians(config.sensing.gaze_half_angle)
        self._margin = math.radians(config.sensing.gaze_margin)
        self._known: dict[str, _Thing] = {}
        self._surfaces: list[_Thing] = []
        self._spheres: dict[str, tuple[float, float, float, Meters, _Thing]] | None = None
        """Around each thing that is no surface: center and radius; None: to be made anew."""
        self.see_face(robot, config.sensing.robot_face)

    def see(self, world: World, at: Seconds) -> None:
        """What is missing, or there with too little confidence, is covered."""
        self._spheres = None
        self._forget_faded(at)
        seen = {one.id: one for one in world.entities if one.kind != "hand" and one.confidence >= self._least}
        for id, thing in self._known.items():
            if id not in seen and thing.hidden_since is None and id != self._robot:
                thing.hidden_since = at
        for id, entity in seen.items():
            before = self._known.get(id)
            if before is None or before.entity != entity:
                self._known[id] = self._thing(entity)
            else:
                before.hidden_since = None

    def see_face(self, actor: str, position: Vector, at: Seconds | None = None) -> None:
        """at: when; the place is the less certain the longer ago. None: it stays certain."""
        if actor not in self._known and at is not None:
            self._forget_faded(at)
        thing = self._thing(Entity(id=actor, kind="person", position=position))
        thing.hidden_since = at
        self._known[actor] = thing
        if self._spheres is not None and actor in self._spheres:
            self._spheres[actor] = (*position, thing.bound, thing)
        else:
            self._spheres = None

    def forget_face(self, actor: str) -> None:
        if self._known.pop(actor, None) is not None:
            self._spheres = None

    def _forget_faded(self, at: Seconds) -> None:
        """What has been covered for so long that no gaze can be on it. Things may still lie on a covered surface."""
        faded = [
            id
            for id, thing in self._known.items()
            if thing.hidden_since is not None
            and thing.entity.kind != "surface"
            and self._confidence(thing, at) < self._least
        ]
        for id in faded:
            del self._known[id]

    def _thing(self, entity: Entity) -> _Thing:
        return _Thing(entity, self._sensing.face_radius)

    def target(
        self, looker: str, gaze: tuple[Vector, Vector], *, present: Targets | None, at: Seconds, sure: Probability
    ) -> Seen:
        """What `looker`'s gaze is on: the nearest by angle in the cone, else the surface it meets, else `AWAY`.

        gaze: from where and in which direction. present: what it was on before; that stays, unless something else is
        nearer by the margin. sure: of the pose.
        """
        ray = _Gaze(*gaze)
        found: list[_Candidate] = []
        nearest = self._half_angle
        for least, _, thing in self._around(ray):
            if least > nearest + self._margin:
                break
            confidence = sure * self._confidence(thing, at)
            if confidence >= self._least and thing.entity.id != looker:
                targets = (self._reported(thing.entity),)
                angle = ray.angle_to(thing)
                if angle <= self._half_angle + (self._margin if targets == present else 0.0):
                    distance = math.dist(thing.entity.position, ray.eye)
                    found.append(_Candidate(round(angle / SAME_ANGLE) * SAME_ANGLE, distance, targets, confidence))
                    nearest = min(nearest, angle)
        if found:
            best = min(found)
            kept = min((one for one in found if one.targets == present), default=best)
            best = kept if kept.angle - best.angle < self._margin else best
            return Seen(best.targets, best.confidence)
        for surface in self._surfaces:
            confidence = sure * self._confidence(surface, at)
            if confidence >= self._least and ray.meets(surface):
                return Seen((surface.entity.id,), confidence)
        return Seen(AWAY, sure)

    def _around(self, gaze: _Gaze) -> list[tuple[Radians, int, _Thing]]:
        """All that may be in the cone, each with the least that its angle may be: the nearest first."""
        if self._spheres is None:
            self._surfaces = [thing for thing in self._known.values() if thing.entity.kind == "surface"]
            others = [thing for thing in self._known.values() if thing.entity.kind != "surface"]
            self._spheres = {thing.entity.id: (*thing.entity.position, thing.bound, thing) for thing in others}
        (eye_x, eye_y, eye_z), (right, up, ahead) = gaze.eye, gaze.axis
        half = self._half_angle + self._margin
        cos_square, sin, near = math.cos(half) ** 2, math.sin(half), []
        for number, (x, y, z, bound, thing) in enumerate(self._spheres.values()):
            x, y, z = x - eye_x, y - eye_y, z - eye_z
            along, square = x * right + y * up + z * ahead, x * x + y * y + z * z
            reach = bound + along * sin + ROUNDING
            if reach < 0.0 or (square - along * along) * cos_square > reach * reach:
                continue  # its center is farther than the bound from the cone
            across = math.sqrt(abs(square - along * along))
            width = math.asin(min(1.0, bound / max(math.sqrt(square), ROUNDING)))
            if (least := math.atan2(across, along) - width) <= half:
                near.append((least, number, thing))
        return sorted(near)

    def _confidence(self, thing: _Thing, at: Seconds) -> Probability:
        age = 0.0 if thing.hidden_since is None else max(0.0, at - thing.hidden_since)
        return thing.entity.confidence * math.exp2(-age / self._sensing.memory)

    def _reported(self, entity: Entity) -> str:
        """At resolution `table` a thing cannot be told from what it lies on."""
        if entity.kind != "object" or not self._by_table:
            return entity.id
        x, y, _ = entity.position
        for surface in self._surfaces:
            if _is_inside([(corner[0] - x, corner[1] - y) for corner in surface.outline]):
                return surface.entity.id
        return SURFACE


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _is_inside(corners: list[tuple[float, float]]) -> bool:
    """Is (0, 0) inside the polygon?"""
    inside = False
    for (x, y), (u, v) in zip(corners, corners[1:] + corners[:1], strict=True):
        if (y > 0.0) != (v > 0.0) and x - y * (u - x) / (v - y) > 0.0:
            inside = not inside
    return inside


def _to_polygon(corners: list[tuple[float, float]]) -> Radians:
    """The angle whose tangent is the distance of (0, 0) from the polygon, 0 inside."""
    if _is_inside(corners):
        return 0.0
    nearest = math.inf
    for (x, y), (u, v) in zip(corners, corners[1:] + corners[:1], strict=True):
        dx, dy = u - x, v - y
        square = dx * dx + dy * dy
        s = 0.0 if square == 0.0 else max(0.0, min(1.0, -(x * dx + y * dy) / square))
        nearest = min(nearest, math.hypot(x + s * dx, y + s * dy))
    return math.atan(nearest)


def is_direction(vector: Vector) -> bool:
    return all(map(math.isfinite, vector)) and any(vector)


def is_place(vector: Vector) -> bool:
    return all(abs(part) <= FARTHEST for part in vector)
