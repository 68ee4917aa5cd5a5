"""Laying a piece where somebody drops it: at the neighbor whose edge it nearly touches, as a hand would. Pure."""

import math

from msgspec.structs import replace

from engage_hri.schemas.footprints import SIDES, overlap, poses_touching
from engage_hri.schemas.units import Meters, Vector
from engage_hri.schemas.world import Entity, World

NEAR: Meters = 0.045
"""Distance from where a piece is dropped to where it touches another, below which it is laid there."""


def laid(world: World, thing: str, x: Meters, y: Meters) -> Entity | None:
    """The thing as it lies after it was dropped at a place of its surface; None: the world has no such object."""
    piece = world.entity(thing)
    if piece is None or piece.kind != "object":
        return None
    place: Vector = (x, y, piece.position[2])
    dropped = replace(piece, position=_on_surface(world, place))
    others = [each for each in world.objects if each.id != thing and each.footprint]
    best: tuple[float, Entity] | None = None
    for other in others if piece.footprint else ():
        for side in SIDES:
            for pose in poses_touching(dropped, other, side):
                far = math.dist((pose.x, pose.y), (x, y))
                there = replace(dropped, position=(pose.x, pose.y, place[2]), yaw=math.radians(pose.yaw))
                if (
                    far < NEAR
                    and (best is None or far < best[0])
                    and not any(overlap(there, each) for each in others)
                ):
                    best = (far, there)
    return dropped if best is None else best[1]


def _on_surface(world: World, place: Vector) -> Vector:
    """The place, or the nearest one on the surface that is at its height."""
    x, y, z = place
    for surface in world.entities:
        if surface.kind == "surface" and surface.footprint and abs(surface.position[2] - z) < 0.1:
            xs = [surface.position[0] + corner[0] for corner in surface.footprint]
            ys = [surface.position[1] + corner[1] for corner in surface.footprint]
            return (min(max(x, min(xs)), max(xs)), min(max(y, min(ys)), max(ys)), z)
    return place
