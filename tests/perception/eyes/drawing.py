"""Pictures of triangles, drawn in numpy: what is nearest at each pixel, and how light falls on it.

Camera axes: x to the right of the picture, y down, z away from the camera; metres.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Picture = NDArray[np.uint8]
"""Rows of pixels, red, green and blue."""


class Lens(NamedTuple):
    """A camera without distortion. focal: its focal length, in pixels."""

    width: int
    height: int
    focal: float

    @property
    def middle(self) -> Floats:
        return np.array([self.width / 2, self.height / 2])


class Nearest(NamedTuple):
    """What is seen at those pixels at which something is seen.

    pixels: rows and columns. triangle: its number. shares: of its three corners.
    """

    pixels: tuple[Ints, Ints]
    triangle: Ints
    shares: Floats

    def of(self, triangles: Ints, values: Floats) -> Floats:
        """Values of the corners, as they are at these pixels."""
        return np.asarray(np.einsum("nk,nkc->nc", self.shares, values[triangles[self.triangle]]))


def nearest(points: Floats, triangles: Ints, lens: Lens) -> Nearest:
    """Find the nearest triangle at each pixel, of those that turn their face to the camera. points: in its axes."""
    depth = points[:, 2]
    flat = points[:, :2] / np.maximum(depth, 1e-3)[:, None] * lens.focal + lens.middle - 0.5
    corners = flat[triangles]
    areas = _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen = np.flatnonzero((areas < -1e-9) & (depth[triangles] > 0.05).all(1))
    corners, areas = corners[seen], areas[seen]
    size = np.array([lens.width, lens.height])
    low = np.clip(np.ceil(corners.min(1)).astype(int), 0, size)
    high = np.clip(np.floor(corners.max(1)).astype(int) + 1, 0, size)
    wide, tall = np.maximum(high - low, 0).T
    each = np.repeat(np.arange(len(seen)), wide * tall)
    step = np.arange(len(each)) - np.repeat(np.cumsum(wide * tall) - wide * tall, wide * tall)
    x, y = low[each, 0] + step % wide[each], low[each, 1] + step // wide[each]
    a, b, c = (corners[:, k] for k in range(3))
    # The share of a corner grows evenly over the picture: a value, and a slope in each direction.
    slopes = np.stack([np.stack([b[:, 1] - c[:, 1], c[:, 0] - b[:, 0]], 1),
                       np.stack([c[:, 1] - a[:, 1], a[:, 0] - c[:, 0]], 1)], 1) / areas[:, None, None]  # fmt: skip
    start = -(slopes * c[:, None]).sum(2)
    first, second = (start[each, k] + slopes[each, k, 0] * x + slopes[each, k, 1] * y for k in (0, 1))
    inside = (first >= -1e-9) & (second >= -1e-9) & (first + second <= 1 + 1e-9)
    each, x, y, first, second = each[inside], x[inside], y[inside], first[inside], second[inside]
    shares = np.stack([first, second, 1 - first - second], 1)
    nearness = shares / depth[triangles[seen[each]]]
    order = np.argsort(nearness.sum(1), kind="stable")
    winner = np.full((lens.height, lens.width), -1)
    winner[y[order], x[order]] = order  # the last of several stays: the nearest
    rows, columns = np.nonzero(winner >= 0)
    won = winner[rows, columns]
    return Nearest((rows, columns), seen[each[won]], nearness[won] / nearness[won].sum(1, keepdims=True))


def normals(points: Floats, triangles: Ints) -> Floats:
    """Directions in which a surface looks at its points."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    sides = np.cross(b - a, c - a)
    found = np.zeros_like(points)
    for axis in range(3):
        for corner in range(3):
            found[:, axis] += np.bincount(triangles[:, corner], sides[:, axis], len(points))
    return np.asarray(found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-12))


def shadows(points: Floats, triangles: Ints, seen: Floats, light: Floats, fine: int = 256) -> Floats:
    """Share of a far light that comes to some places, 0..1. light: direction towards it."""
    side = np.cross(light, [0.0, 1.0, 0.0])
    axes = np.stack([side / np.linalg.norm(side), np.cross(light, side / np.linalg.norm(side)), -light])
    far, middle = 50.0, seen.mean(0)
    turned, place = (points - middle) @ axes.T, (seen - middle) @ axes.T
    lens = Lens(fine, fine, far * fine / 2 / max(np.abs(place[:, :2]).max(), 1e-6))
    turned[:, 2] += far
    lit = nearest(turned, triangles, lens)
    depth = np.full((fine, fine), np.inf)
    depth[lit.pixels] = lit.of(triangles, turned[:, 2:])[:, 0]
    at = place[:, :2] / far * lens.focal + lens.middle - 0.5
    share = np.zeros(len(seen))
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            column, row = np.clip(np.rint(at + np.array([dx, dy])).astype(int), 0, fine - 1).T
            share += place[:, 2] + far < depth[row, column] + 0.008
    return share / 9


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
