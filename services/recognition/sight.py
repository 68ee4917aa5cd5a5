"""What lies in the direction of a head: things, faces and surfaces as arrays, and the angle from the gaze to each.

An angle is measured to the thing's extent: 0 when the gaze meets its footprint, or the sphere of its radius. What is
covered stays where it was last seen, with a confidence that decays (thesis 5.4.2).
"""

import math
from typing import NamedTuple

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from schemas.units import Probability, Seconds, Vector
from schemas.world import Entity, World
from services.recognition.config import GazeResolution, RecognitionConfig

Floats = NDArray[np.float64]
Targets = tuple[str, ...]
AWAY: Targets = ()
SURFACE = "table"
"""What a thing lies on when no surface is seen under it."""
FARTHEST = 1e6
"""Metres. No place is farther off; nor is it one that is no number."""
SAME_ANGLE = 1e-6
"""Radians. Closer ones are the same; then the nearer thing is in front."""


class Seen(NamedTuple):
    """What a gaze is on, and how sure it is that it is there."""

    targets: Targets
    confidence: Probability


class _Known(Struct):
    """hidden_since: when it was covered; None while it is in view."""

    entity: Entity
    hidden_since: Seconds | None = None


class _Layout(Struct, frozen=True):
    """Everything that can be looked at, n entities. The edges of footprints, m, are in the order of their owners."""

    ids: tuple[str, ...]
    targets: tuple[str, ...]
    """What a look at each is reported as."""
    centers: Floats
    radii: Floats
    surface: NDArray[np.bool_]
    confidence: Floats
    hidden_since: Floats
    """Infinity while in view."""
    outlined: NDArray[np.intp]
    """Which entities have a footprint, (k,)."""
    first: NDArray[np.intp]
    """Index of the first edge of each of those, (k,)."""
    owner: NDArray[np.intp]
    """Which of those each edge belongs to, (m,)."""
    corners: Floats
    edges: Floats
    """From each corner to the next, (m, 3)."""
    lengths: Floats
    """Squared."""


class Sight:
    """The things around, for gazes to be on. robot: its face is known without being seen."""

    def __init__(self, robot: str, config: RecognitionConfig) -> None:
        self._robot = robot
        self._resolution: GazeResolution = config.gaze_resolution
        self._least = config.least_confidence
        self._sensing = config.sensing
        self._half_angle = math.radians(config.sensing.gaze_half_angle)
        self._margin = math.radians(config.sensing.gaze_margin)
        self._known: dict[str, _Known] = {}
        self._layout: _Layout | None = None
        self.see_face(robot, config.sensing.robot_face)

    def see(self, world: World, at: Seconds) -> None:
        """What is missing, or there with too little confidence, is covered."""
        self._layout = None
        seen = {one.id: one for one in world.entities if one.kind != "hand" and one.confidence >= self._least}
        for id, known in self._known.items():
            if id not in seen and known.hidden_since is None and id != self._robot:
                known.hidden_since = at
        self._known.update((id, _Known(entity)) for id, entity in seen.items())

    def see_face(self, actor: str, position: Vector, at: Seconds | None = None) -> None:
        """at: when; the place is the less certain the longer ago. None: it stays certain."""
        before = self._known.get(actor)
        self._known[actor] = _Known(Entity(id=actor, kind="person", position=position), at)
        if self._layout is None or before is None:
            self._layout = None
            return
        row = self._layout.ids.index(actor)
        self._layout.centers[row] = position
        self._layout.hidden_since[row] = math.inf if at is None else at

    def target(
        self,
        looker: str,
        position: Vector,
        direction: Vector,
        *,
        present: Targets | None,
        at: Seconds,
        sure: Probability,
    ) -> Seen:
        """What `looker`'s gaze is on: the nearest by angle in the cone, else the surface it meets, else `AWAY`.

        present: what it was on before; that stays, unless something else is nearer by the margin. sure: of the pose.
        """
        layout = self._layout = self._layout or self._laid_out()
        angles, distances = _angles(layout, np.array(position), np.array(direction))
        age = np.maximum(0.0, at - layout.hidden_since)
        confidence = sure * layout.confidence * np.exp2(-age / self._sensing.memory)
        was = np.array([(name,) == present for name in layout.targets])
        limits = np.where(layout.surface, SAME_ANGLE, self._half_angle) + np.where(was, self._margin, 0.0)
        visible = (angles <= limits) & (confidence >= self._least)
        visible &= np.array([id != looker for id in layout.ids])
        if not visible.any():
            return Seen(AWAY, sure)
        if not layout.surface[visible].all():
            visible &= ~layout.surface
        angles = np.where(visible, angles, np.inf)
        best = int(np.lexsort((distances, np.round(angles / SAME_ANGLE)))[0])
        if (was & visible).any():
            kept = int(np.argmin(np.where(was, angles, np.inf)))
            if angles[kept] - angles[best] < self._margin:
                best = kept
        return Seen((layout.targets[best],), float(confidence[best]))

    def _laid_out(self) -> _Layout:
        entities = [known.entity for known in self._known.values()]
        hidden = [known.hidden_since for known in self._known.values()]
        outlines = [_outline(entity) for entity in entities]
        outlined = [index for index, outline in enumerate(outlines) if len(outline)]
        sizes = [len(outlines[index]) for index in outlined]
        corners = np.concatenate([outlines[index] for index in outlined]) if outlined else np.zeros((0, 3))
        edges = [np.roll(outlines[index], -1, axis=0) - outlines[index] for index in outlined]
        edge = np.concatenate(edges) if edges else np.zeros((0, 3))
        return _Layout(
            ids=tuple(self._known),
            targets=tuple(self._reported(entity, entities) for entity in entities),
            centers=np.array([entity.position for entity in entities], dtype=float),
            radii=np.array([self._radius(entity) for entity in entities]),
            surface=np.array([entity.kind == "surface" for entity in entities]),
            confidence=np.array([entity.confidence for entity in entities]),
            hidden_since=np.array([math.inf if since is None else since for since in hidden]),
            outlined=np.array(outlined, dtype=np.intp),
            first=np.cumsum([0, *sizes[:-1]], dtype=np.intp) if sizes else np.zeros(0, dtype=np.intp),
            owner=np.repeat(np.arange(len(sizes)), sizes),
            corners=corners,
            edges=edge,
            lengths=(edge**2).sum(axis=1),
        )

    def _reported(self, entity: Entity, entities: list[Entity]) -> str:
        """At resolution `table` a thing cannot be told from what it lies on."""
        if entity.kind != "object" or self._resolution == "object":
            return entity.id
        below = (one.id for one in entities if one.kind == "surface" and _lies_on(entity, one))
        return next(below, SURFACE)

    def _radius(self, entity: Entity) -> float:
        """Of the sphere; 0 for what has an outline."""
        if entity.kind == "person":
            return entity.radius or self._sensing.face_radius
        return 0.0 if entity.footprint else entity.radius


def _outline(entity: Entity) -> Floats:
    """The corners of the footprint where the entity lies, (k, 3)."""
    x, y, z = entity.position
    cos, sin = math.cos(entity.yaw), math.sin(entity.yaw)
    corners = [(x + cos * u - sin * v, y + sin * u + cos * v, z) for u, v in entity.footprint]
    return np.array(corners, dtype=float).reshape(-1, 3)


def _lies_on(thing: Entity, surface: Entity) -> bool:
    corners = _outline(surface)
    crossings = _crosses(corners, np.roll(corners, -1, axis=0) - corners, np.array([thing.position]))
    return bool(crossings.sum() % 2)


def _crosses(corners: Floats, edges: Floats, points: Floats) -> NDArray[np.bool_]:
    """Does the line from each point along x cross its edge? Odd numbers of crossings are inside. z is ignored."""
    below, above = corners[:, 1] > points[:, 1], (corners + edges)[:, 1] > points[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        meets = corners[:, 0] + (points[:, 1] - corners[:, 1]) / edges[:, 1] * edges[:, 0]
    crosses: NDArray[np.bool_] = (below != above) & (points[:, 0] < meets)
    return crosses


def _angles(layout: _Layout, eye: Floats, direction: Floats) -> tuple[Floats, Floats]:
    """Angle from the gaze to the extent of each entity, radians; and the distance of its center, metres."""
    axis = direction / np.abs(direction).max()
    axis /= np.linalg.norm(axis)
    reach = layout.centers - eye
    distances = np.maximum(np.linalg.norm(reach, axis=1), 1e-9)
    angles = np.arccos(np.clip(reach @ axis / distances, -1.0, 1.0))
    angles = np.maximum(0.0, angles - np.arcsin(np.minimum(1.0, layout.radii / distances)))
    if len(layout.outlined):
        inside = _meets(layout, eye, axis)
        angles[layout.outlined] = np.where(inside, 0.0, _to_edges(layout, eye, axis))
    return angles, distances


def _to_edges(layout: _Layout, eye: Floats, axis: Floats) -> Floats:
    """The least angle from the gaze to the outline of each entity that has one, (k,).

    On the edge c + s e, seen from the eye, the cosine is (a + s b) / |c + s e|; its derivative is 0 at one s.
    """
    corners = layout.corners - eye
    a, b = corners @ axis, layout.edges @ axis
    square, along = (corners**2).sum(axis=1), (corners * layout.edges).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.nan_to_num((a * along - b * square) / (b * along - a * layout.lengths), posinf=1.0, neginf=0.0)
    s = np.clip(s, 0.0, 1.0)
    at_s = (a + s * b) / np.sqrt(np.maximum(square + 2.0 * s * along + s * s * layout.lengths, 1e-18))
    at_corner = a / np.sqrt(np.maximum(square, 1e-18))
    nearest = np.maximum.reduceat(np.maximum(at_s, at_corner), layout.first)
    angles: Floats = np.arccos(np.clip(nearest, -1.0, 1.0))
    return angles


def _meets(layout: _Layout, eye: Floats, axis: Floats) -> NDArray[np.bool_]:
    """Whose footprint the gaze goes through, (k,)."""
    height: Floats = layout.centers[layout.outlined, 2] - eye[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = height / axis[2]
    ahead = np.isfinite(t) & (t > 0.0)
    points = eye + np.where(ahead, t, 0.0)[:, None] * axis
    crossings = _crosses(layout.corners, layout.edges, points[layout.owner])
    inside: NDArray[np.bool_] = ahead & (np.add.reduceat(crossings.astype(np.intp), layout.first) % 2 == 1)
    return inside


def is_direction(vector: Vector) -> bool:
    return all(map(math.isfinite, vector)) and any(vector)


def is_place(vector: Vector) -> bool:
    return all(abs(part) < FARTHEST for part in vector)
