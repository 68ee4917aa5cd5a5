"""Gaze targets: things, faces and surfaces in the direction of a head, chosen by their angle from the gaze.

An angle is measured to the thing's extent: 0 when the gaze goes through its footprint, or the sphere of its radius.
A covered thing stays where it was last seen, with a confidence that decays (thesis 5.4.2).

Of a direction whose deviation is stated, each thing is as likely as it would be to find a head so that looks at it,
and so is that it looks at none. What is not likely enough to be named alone is named with its rivals, as one of them
(decision 0238).
"""

import math
from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import NamedTuple

from engage_hri.schemas.units import FARTHEST, Meters, Probability, Radians, Seconds, Vector, minus
from engage_hri.schemas.world import Entity, World
from engage_hri.services.recognition.config import GAZE_MARGIN, RecognitionConfig
from engage_hri.services.recognition.perceive.attending import Offset

FACE_RADIUS: Meters = 0.12
"""Radius of the faces of people and of the robot, around the point between the eyes: half a head. Ours."""
ROBOT_FACE: Vector = (0.05, 0.0, 1.17)
"""Place of the robot's eyes as long as its `RobotState` does not say it: that of the torso at the tangram table."""
MEMORY: Seconds = 10.0
"""Time in which the confidence in the place of a covered thing halves. Ours."""
Targets = tuple[str, ...]
Spread = tuple[Radians, Radians]
"""Standard deviations of a direction, to the side and up."""
AWAY: Targets = ()
SURFACE = "table"
"""Id of the surface that a thing lies on when none is seen under it."""
NOTHING = 4e-4
"""Likelihood of a look at no thing, for each square degree: as often as at each thing, somewhere in 50 by 50 degrees.
Of deviations of 3 and 5 degrees a thing is as likely up to 2.5 of them beside the gaze, of larger ones up to less."""
FACE = 5.0
"""How many times as likely a look at a face is as one at a thing: who talks looks at faces."""
FARTHEST_OFF = 3.5
"""Deviations from the gaze up to which anything is asked how likely it is."""
LEAST_SPREAD: Radians = 0.02
"""Least deviation that is believed of a gaze: eyes wander on what they look at."""
SURE: Probability = 0.9
"""Share of all likelihood that what is named has together."""
ALONE: Probability = 0.95
"""Share from which on a thing is named alone; once it is, `SURE` is enough."""
KEPT: Probability = 0.75
"""Share with which what was named before stays: less than `SURE`, that a look between two things does not flutter."""
MOST_NAMED = 3
"""Things that are named together at most. Of more, it is what they lie on that is looked at."""
SAME_ANGLE: Radians = 1e-6
"""Resolution of angles: where they are equal, the nearer thing is in front."""
ROUNDING: Meters = 1e-9


class GazeTarget(NamedTuple):
    """Targets of a gaze, and the confidence that it is on them. one_of: on one of them, it is not known on which."""

    targets: Targets
    confidence: Probability
    one_of: bool = False


class _Thing:
    """An entity that a gaze can be on. radius: of its sphere, 0 for an outline. bound: of a sphere around it."""

    def __init__(self, entity: Entity) -> None:
        self.entity = entity
        self.radius = 0.0 if entity.footprint else entity.radius or (FACE_RADIUS if entity.kind == "person" else 0.0)
        self.bound = _extent(entity.footprint) if entity.footprint else self.radius
        self.hidden_since: Seconds | None = None
        """Time at which the thing was covered; None while it is in view."""

    @cached_property
    def outline(self) -> tuple[Vector, ...]:
        """Corners of the footprint in the world. Computed when a gaze comes near: most things are never looked at."""
        x, y, z = self.entity.position
        cos, sin = math.cos(self.entity.yaw), math.sin(self.entity.yaw)
        return tuple((x + cos * u - sin * v, y + sin * u + cos * v, z) for u, v in self.entity.footprint)

    def is_under(self, x: Meters, y: Meters) -> bool:
        return _is_inside([(corner[0] - x, corner[1] - y) for corner in self.outline])


@lru_cache(maxsize=256)
def _extent(footprint: tuple[tuple[float, float], ...]) -> Meters:
    return max(math.hypot(x, y) for x, y in footprint)


class _Candidate(NamedTuple):
    """A thing in the cone, ordered by angle from the gaze to its extent, then by distance from the eye."""

    angle: Radians
    distance: Meters
    targets: Targets
    confidence: Probability


class _Gaze:
    """A ray from the eyes; the coordinates of what is in front, in units of its depth, across the ray."""

    def __init__(self, eye: Vector, direction: Vector) -> None:
        self.eye = eye
        self.axis = x, y, z = unit(direction)
        # Two axes across the gaze, to its left and up; straight up and down any will do.
        side = (-y, x, 0.0) if max(abs(x), abs(y)) > 1e-9 else (0.0, 1.0, 0.0)
        length = math.hypot(*side)
        self._left = a, b, c = side[0] / length, side[1] / length, side[2] / length
        self._up = (y * c - z * b, z * a - x * c, x * b - y * a)

    def across(self, place: Vector) -> tuple[float, float] | None:
        """Coordinates of a place across the ray: distance from (0, 0) is the tangent of its angle. None if behind."""
        from_eye = minus(place, self.eye)
        depth = _dot(from_eye, self.axis)
        if depth <= 1e-9:
            return None
        return _dot(from_eye, self._left) / depth, _dot(from_eye, self._up) / depth

    def angle_to(self, thing: _Thing) -> Radians:
        """Angle from the ray to the nearest point of the thing."""
        corners = self._corners(thing)
        if corners:
            return math.atan(_to_polygon(corners))
        center = thing.entity.position
        distance = math.dist(center, self.eye)
        if distance <= thing.radius:
            return 0.0
        along = _dot(minus(center, self.eye), self.axis)
        angle = math.acos(max(-1.0, min(1.0, along / max(distance, 1e-9))))
        return max(0.0, angle - math.asin(thing.radius / max(distance, 1e-9)))

    def likelihood(self, thing: _Thing, spread: Spread) -> float:
        """Likelihood of this direction, for each square degree, of one who looks anywhere at the thing."""
        corners = self._corners(thing)
        if not corners:
            center = self.across(thing.entity.position)
            if center is None:
                return 0.0
            reach = math.tan(math.asin(min(0.99, thing.radius / math.dist(thing.entity.position, self.eye))))
            corners = [(center[0] - reach, center[1] - reach), (center[0] + reach, center[1] + reach)]
        found = 1.0
        for sides, each in zip(zip(*corners, strict=True), spread, strict=True):
            low, high = (math.degrees(math.atan(side)) for side in (min(sides), max(sides)))
            found *= _share_between(low, high, math.degrees(max(each, LEAST_SPREAD)))
        return found

    def _corners(self, thing: _Thing) -> list[tuple[float, float]]:
        """Corners of the thing's outline across the ray; none: it has none, or one of them is behind."""
        corners = [self.across(corner) for corner in thing.outline]
        seen = [corner for corner in corners if corner is not None]
        return seen if len(seen) == len(corners) else []

    def meets(self, surface: _Thing) -> bool:
        """True if the ray goes through the surface's footprint."""
        height = surface.entity.position[2] - self.eye[2]
        if height * self.axis[2] <= 0.0:
            return False
        far = height / self.axis[2]
        return surface.is_under(self.eye[0] + far * self.axis[0], self.eye[1] + far * self.axis[1])


class GazeTargets:
    """Things, faces and surfaces that gazes can be on. robot: its face is known without being seen."""

    def __init__(self, robot: str, config: RecognitionConfig) -> None:
        self._robot = robot
        self._by_table = config.gaze_resolution == "table"
        self._least = config.least_confidence
        self._half_angle = math.radians(config.sensing.gaze_half_angle)
        self._margin = math.radians(GAZE_MARGIN)
        self._known: dict[str, _Thing] = {}
        self._surfaces: list[_Thing] = []
        self._spheres: dict[str, tuple[float, float, float, Meters, _Thing]] | None = None
        """Center and radius of a sphere around each thing but surfaces, by id; None if outdated."""
        self.see_face(robot, ROBOT_FACE)

    def see(self, world: World, at: Seconds) -> None:
        """Take a view of the world. Things that are missing, or seen with too little confidence, are covered."""
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
        """Take the place of a face. at: time of the observation, from which the confidence decays; None: never."""
        if actor not in self._known and at is not None:
            self._forget_faded(at)
        thing = self._thing(Entity(id=actor, kind="person", position=position))
        thing.hidden_since = at
        self._known[actor] = thing
        if self._spheres is not None and actor in self._spheres:
            self._spheres[actor] = (*position, thing.bound, thing)
        else:
            self._spheres = None

    def place(self, id: str) -> Vector | None:
        """Place of what a gaze can be on; None: it is not known."""
        thing = self._known.get(id)
        return None if thing is None else thing.entity.position

    def beside_robot(self, eyes: Vector, direction: Vector) -> Offset:
        """Angles of a direction to the left and up of the line from these eyes to the robot's face."""
        there, (left, up) = _bearing(direction), _bearing(minus(self._known[self._robot].entity.position, eyes))
        return math.remainder(there[0] - left, 360.0), there[1] - up

    def towards(self, eyes: Vector, beside: Offset) -> Vector:
        """Direction with these angles (`beside_robot`)."""
        left, up = _bearing(minus(self._known[self._robot].entity.position, eyes))
        left, up = math.radians(left + beside[0]), math.radians(max(-90.0, min(90.0, up + beside[1])))
        return math.cos(left) * math.cos(up), math.sin(left) * math.cos(up), math.sin(up)

    def offset_of_robot(self, gaze: tuple[Vector, Vector]) -> Offset:
        """Offset of the robot's face from the direction of a gaze. gaze: place of the eyes, and direction."""
        ray, face = _Gaze(*gaze), self._known[self._robot].entity.position
        away, (x, y, z) = minus(face, ray.eye), ray.axis
        angle = math.degrees(math.acos(max(-1.0, min(1.0, _dot(away, ray.axis) / max(math.hypot(*away), 1e-9)))))
        flat = math.hypot(x, y)
        level = (x / flat, y / flat) if flat > 0.0 else (1.0, 0.0)
        left = level[0] * away[1] - level[1] * away[0]
        up = flat * away[2] - z * (level[0] * away[0] + level[1] * away[1])
        bearing = math.atan2(up, left)
        return angle * math.cos(bearing), angle * math.sin(bearing)

    def forget_face(self, actor: str) -> None:
        if self._known.pop(actor, None) is not None:
            self._spheres = None

    def _forget_faded(self, at: Seconds) -> None:
        """Drop things covered for so long that no gaze can be on them. Surfaces stay, for things may lie on them."""
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
        return _Thing(entity)

    def target(
        self,
        looker: str,
        gaze: tuple[Vector, Vector],
        *,
        present: Targets | None,
        at: Seconds,
        sure: Probability,
        spread: Spread | None = None,
    ) -> GazeTarget:
        """Target of `looker`'s gaze: what is likely enough, or the nearest by angle in the cone where no deviation
        is stated; else the surface it meets, else `AWAY`.

        gaze: place of the eyes and direction. present: target before, which stays unless another thing is nearer by
        the margin. sure: confidence of the pose. spread: deviations of the direction, if they are stated.
        """
        ray = _Gaze(*gaze)
        if spread is not None:
            return self._likely(looker, ray, spread, present=present or AWAY, at=at, sure=sure)
        found: list[_Candidate] = []
        nearest = self._half_angle
        for least, _, thing in self._around(ray, self._half_angle + self._margin):
            if least > nearest + self._margin:
                break
            confidence = sure * self._confidence(thing, at)
            if confidence >= self._least and thing.entity.id != looker:
                targets = (self._reported(thing.entity),)
                angle = ray.angle_to(thing)
                if angle <= self._half_angle + (self._margin if targets == present else 0.0):
                    distance = math.dist(thing.entity.position, ray.eye)
                    confidence = self._sureness(confidence, angle)
                    found.append(_Candidate(round(angle / SAME_ANGLE) * SAME_ANGLE, distance, targets, confidence))
                    nearest = min(nearest, angle)
        if found:
            best = min(found)
            kept = min((one for one in found if one.targets == present), default=best)
            best = kept if kept.angle - best.angle < self._margin else best
            return GazeTarget(best.targets, best.confidence)
        return self._beneath(ray, at, sure)

    def _beneath(self, ray: _Gaze, at: Seconds, sure: Probability) -> GazeTarget:
        """The surface that a gaze meets, or `AWAY`."""
        for surface in self._surfaces:
            confidence = sure * self._confidence(surface, at)
            if confidence >= self._least and ray.meets(surface):
                return GazeTarget((surface.entity.id,), confidence)
        return GazeTarget(AWAY, sure)

    def _likely(
        self, looker: str, ray: _Gaze, spread: Spread, *, present: Targets, at: Seconds, sure: Probability
    ) -> GazeTarget:
        """Target of a gaze with a stated deviation: the fewest things of which one is `SURE` to be looked at."""
        likely: dict[str, float] = {}
        surest: Probability = 0.0
        for _, _, thing in self._around(ray, min(FARTHEST_OFF * max(*spread, LEAST_SPREAD), 1.5)):
            seen = sure * self._confidence(thing, at)
            if seen >= self._least and thing.entity.id != looker:
                name = self._reported(thing.entity)
                weight = FACE if thing.entity.kind == "person" else 1.0
                likely[name] = likely.get(name, 0.0) + weight * ray.likelihood(thing, spread)
                surest = max(surest, seen)
        beneath = self._beneath(ray, at, sure)
        whole = sum(likely.values()) + NOTHING
        if whole <= 2 * NOTHING:
            return beneath._replace(confidence=beneath.confidence * NOTHING / whole)
        for name in beneath.targets:
            likely[name] = likely.get(name, 0.0) + NOTHING
        named, share = _fewest(likely, whole)
        before = sum(likely.get(name, 0.0) for name in present) / whole
        if before >= (SURE if len(present) == 1 else KEPT) and len(named) > 1:
            named, share = [*present], before
        if len(named) > MOST_NAMED:
            on = dict[str, float]()
            for name, much in likely.items():
                surface = self._surface_of(name) or name
                on[surface] = on.get(surface, 0.0) + much
            named, share = _fewest(on, whole, alone=SURE)
        return GazeTarget(tuple(sorted(named)), surest * share, len(named) > 1)

    def _surface_of(self, id: str) -> str:
        """The surface that a thing lies on; empty: none, it is a face, or a surface itself."""
        thing = self._known.get(id)
        if thing is None or thing.entity.kind != "object":
            return ""
        x, y, _ = thing.entity.position
        return next((surface.entity.id for surface in self._surfaces if surface.is_under(x, y)), SURFACE)

    def _around(self, gaze: _Gaze, half: Radians) -> list[tuple[Radians, int, _Thing]]:
        """Things that may be in the cone, as (least possible angle, number, thing), in order."""
        if self._spheres is None:
            self._surfaces = [thing for thing in self._known.values() if thing.entity.kind == "surface"]
            others = [thing for thing in self._known.values() if thing.entity.kind != "surface"]
            self._spheres = {thing.entity.id: (*thing.entity.position, thing.bound, thing) for thing in others}
        (eye_x, eye_y, eye_z), (right, up, ahead) = gaze.eye, gaze.axis
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
        return thing.entity.confidence * math.exp2(-age / MEMORY)

    def _sureness(self, seen: Probability, angle: Radians) -> Probability:
        """Confidence that a gaze is on what is `seen` this surely, at this angle: the least at the edge."""
        return seen - (seen - self._least) * min(1.0, angle / self._half_angle)

    def _reported(self, entity: Entity) -> str:
        """Id to report for the entity: at resolution `table` that of the surface on which an object lies."""
        return (self._surface_of(entity.id) if self._by_table else "") or entity.id


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _bearing(direction: Vector) -> Offset:
    """Angles of a direction: to the left of ahead, and up."""
    x, y, z = unit(direction)
    return math.degrees(math.atan2(y, x)), math.degrees(math.atan2(z, math.hypot(x, y)))


def _is_inside(corners: list[tuple[float, float]]) -> bool:
    """True if (0, 0) is inside the polygon."""
    inside = False
    for (x, y), (u, v) in zip(corners, corners[1:] + corners[:1], strict=True):
        if (y > 0.0) != (v > 0.0) and x - y * (u - x) / (v - y) > 0.0:
            inside = not inside
    return inside


def _fewest(likely: Mapping[str, float], whole: float, alone: Probability = ALONE) -> tuple[list[str], Probability]:
    """The fewest names that have together `SURE` of all likelihood, or the one that has `alone`; and their share."""
    named, share = list[str](), 0.0
    for name in sorted(likely, key=lambda name: (-likely[name], name)):
        if share < (alone if len(named) == 1 else SURE):
            named.append(name)
            share += likely[name] / whole
    return named, share


def _share_between(low: float, high: float, spread: float) -> float:
    """Density at 0 of what falls with a deviation around a place that is anywhere between two."""
    width = max(high - low, 1e-3)
    far, near = (math.erf(side / (spread * math.sqrt(2))) for side in (high, low))
    return (far - near) / (2 * width)


def _to_polygon(corners: list[tuple[float, float]]) -> Radians:
    """Distance of (0, 0) from the polygon, 0 inside."""
    if _is_inside(corners):
        return 0.0
    nearest = math.inf
    for (x, y), (u, v) in zip(corners, corners[1:] + corners[:1], strict=True):
        dx, dy = u - x, v - y
        square = dx * dx + dy * dy
        s = 0.0 if square == 0.0 else max(0.0, min(1.0, -(x * dx + y * dy) / square))
        nearest = min(nearest, math.hypot(x + s * dx, y + s * dy))
    return nearest


def unit(vector: Vector) -> Vector:
    """The vector with length 1. It is not 0."""
    longest = max(map(abs, vector))
    x, y, z = (part / longest for part in vector)
    length = math.hypot(x, y, z)
    return x / length, y / length, z / length


def is_direction(vector: Vector) -> bool:
    return all(map(math.isfinite, vector)) and any(vector)


def is_place(vector: Vector) -> bool:
    return all(abs(part) <= FARTHEST for part in vector)
