"""Distractors of a gaze or a point, from rays and places: objects that it may also seem to mean. Thesis 3.3.2."""

import math
from collections.abc import Iterable, Sequence

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.body import NoPointZone, Ray
from engage_hri.schemas.units import Meters, Radians, Vector
from engage_hri.schemas.world import Entity

TOLERANCE = 1e-9
"""Slack of an angle or distance: an object exactly on the edge is inside, whatever the rounding."""


class Layout(Struct, frozen=True):
    """Objects as arrays, made once for all the rays they are tested against."""

    ids: tuple[str, ...]
    places: NDArray[np.float64]
    """Centres and footprint corners of all objects, (m, 3)."""
    owner: NDArray[np.intp]
    """Index of the object that each of the `places` belongs to, (m,)."""
    centres: NDArray[np.float64]
    """Centres of the objects, (n, 3)."""
    radii: NDArray[np.float64]
    """Radii of the objects, (n,)."""


def laid_out(objects: Sequence[Entity]) -> Layout:
    """Make the layout of these objects; a footprint is turned by the object's yaw."""
    places: list[Vector] = []
    owner: list[int] = []
    for index, entity in enumerate(objects):
        x, y, z = entity.position
        cos, sin = math.cos(entity.yaw), math.sin(entity.yaw)
        places.append(entity.position)
        places.extend((x + cos * u - sin * v, y + sin * u + cos * v, z) for u, v in entity.footprint)
        owner.extend([index] * (1 + len(entity.footprint)))
    return Layout(
        ids=tuple(entity.id for entity in objects),
        places=_vectors(places),
        owner=np.array(owner, dtype=np.intp),
        centres=_vectors([entity.position for entity in objects]),
        radii=np.array([extent(entity) for entity in objects]),
    )


def in_gaze_cones(gazes: Sequence[Ray], half_angle: Radians, layout: Layout) -> list[frozenset[str]]:
    """Ids of the objects that have their centre or a corner of their footprint in the cone around each gaze axis.

    The angle between axis and eye-to-point decides: the same set as the ellipse the cone cuts from the table
    (decision B4). A gaze that is not known exactly has as much wider a cone.
    """
    reach = layout.places - _vectors([gaze.origin for gaze in gazes])[:, None]
    along = np.einsum("gpx,gx->gp", reach, _units(gazes))
    distance = np.sqrt(np.einsum("gpx,gpx->gp", reach, reach))
    angle_rad = np.arccos(np.clip(along / np.maximum(distance, TOLERANCE), -1.0, 1.0))
    errors = np.array([gaze.error for gaze in gazes])
    inside = (angle_rad <= half_angle + errors[:, None] + TOLERANCE) | (distance <= TOLERANCE)
    return [frozenset(layout.ids[index] for index in layout.owner[each].tolist()) for each in inside]


def in_pointing_cylinders(forearms: Sequence[Ray], radius: Meters, layout: Layout) -> list[frozenset[str]]:
    """Ids of the objects in the half-cylinder ahead of each hand, around the axis from elbow to hand (decision B5).

    An object of radius r counts when its centre is within `radius` + r of the axis. A forearm that is not known
    exactly has a cylinder that widens from the elbow on, by as much as it may be beside.
    """
    tips = [forearm.tip if forearm.tip is not None else forearm.origin for forearm in forearms]
    reach, axes = layout.centres - _vectors(tips)[:, None], _units(forearms)
    along = np.einsum("fox,fx->fo", reach, axes)
    off_axis = reach - along[..., None] * axes[:, None]
    off_axis = np.sqrt(np.einsum("fox,fox->fo", off_axis, off_axis))
    from_elbow = np.einsum("fox,fx->fo", layout.centres - _vectors([each.origin for each in forearms])[:, None], axes)
    wider = np.tan([forearm.error for forearm in forearms])[:, None] * from_elbow.clip(min=0.0)
    inside = (along >= -TOLERANCE) & (off_axis <= radius + wider + layout.radii + TOLERANCE)
    return [frozenset(layout.ids[index] for index in np.flatnonzero(each).tolist()) for each in inside]


def extent(entity: Entity) -> Meters:
    """Radius of an object: the one that is given, else that of its footprint."""
    if entity.radius or not entity.footprint:
        return entity.radius
    return max(math.hypot(x, y) for x, y in entity.footprint)


def in_zone(place: Vector, zones: Iterable[NoPointZone]) -> bool:
    """True if the robot must not point at `place`."""
    return any(math.dist(place, zone.center) <= zone.radius for zone in zones)


def angle_off_axis(gaze: Ray, place: Vector) -> Radians:
    """Angle between the gaze axis and the direction from the eye to `place`."""
    reach = np.asarray(place) - np.asarray(gaze.origin)
    distance = float(np.linalg.norm(reach))
    if distance <= TOLERANCE:
        return 0.0
    return math.acos(max(-1.0, min(1.0, float(reach @ _units([gaze])[0]) / distance)))


def _vectors(vectors: Sequence[Vector]) -> NDArray[np.float64]:
    return np.array(vectors, dtype=np.float64).reshape(-1, 3)


def _units(rays: Sequence[Ray]) -> NDArray[np.float64]:
    axes = _vectors([ray.axis for ray in rays])
    return np.asarray(axes / np.sqrt(np.einsum("rx,rx->r", axes, axes))[:, None])
