"""Tables with pieces on them, drawn with a known truth: light, shadows, walls of pieces, noise, blur, and a hand.

Nothing of what finds the pieces is used. Pictures are drawn from the back to the front, three times as fine as they
are wanted: the floor, the table with its grain, the shadows on it, the walls of the pieces, their tops, a hand.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from engage_hri.services.tangram.table import tangram_table

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]
Pose = tuple[float, float, float]
"""x, y, and the turn in radians."""
TABLE = tangram_table()
TOP, THICK = TABLE.surface.center[2], TABLE.thickness
PAINT = {
    "orange": (235, 130, 30), "white": (235, 235, 230), "blue": (40, 80, 190), "green": (40, 140, 60),
    "purple": (110, 50, 150), "red": (200, 35, 40), "pink": (240, 140, 175), "yellow": (240, 205, 40),
}  # fmt: skip
WOOD, FLOOR = (165, 130, 95), (90, 90, 92)
SKINS = ((205, 155, 130), (225, 180, 160), (150, 105, 80), (85, 58, 45))
FINE = 2
"""How many times as fine a picture is drawn as it is wanted."""
STARTS: dict[str, Pose] = {
    each.id: (each.start.x, each.start.y, math.radians(each.start.yaw)) for each in TABLE.pieces
}
GOALS: dict[str, Pose] = {each.id: (each.goal.x, each.goal.y, math.radians(each.goal.yaw)) for each in TABLE.pieces}
FOOTPRINTS = {each.id: np.array(each.footprint) for each in TABLE.pieces}
COLORS = {each.id: each.color for each in TABLE.pieces}


PUSHES = 200
TOUCHING = 0.0002
"""Metres by which pieces may overlap that count as touching."""


class Eye(NamedTuple):
    """A camera. at: metres. down, left, lean: degrees."""

    at: tuple[float, float, float] = (0.05, 0.0, 1.17)
    down: float = 38.0
    left: float = 0.0
    lean: float = 0.0
    field: float = 70.0
    width: int = 1280
    height: int = 720

    def __call__(self, points: Any) -> Floats:
        """Pixels of places in the robot's frame, by turns about one axis after the other."""
        x, y, z = (np.atleast_2d(points) - self.at).T
        a, b, c = np.radians([self.left, self.down, self.lean])
        x, y = x * np.cos(a) + y * np.sin(a), y * np.cos(a) - x * np.sin(a)
        x, z = x * np.cos(b) - z * np.sin(b), z * np.cos(b) + x * np.sin(b)
        right, down = -y, -z
        right, down = right * np.cos(c) + down * np.sin(c), down * np.cos(c) - right * np.sin(c)
        focal = self.width / 2 / math.tan(math.radians(self.field) / 2)
        return np.column_stack([self.width / 2 + focal * right / x, self.height / 2 + focal * down / x])


class Light(NamedTuple):
    """Light on a table. strength: 1 is that of the picture from which colors are learned. noise: of a pixel."""

    strength: float = 1.0
    noise: float = 4.0
    blur: float = 0.8


EYE, EVEN = Eye(), Light()
"""The eyes of the robot, and the light in which colors are learned."""


class Hand(NamedTuple):
    """A hand over the table, which comes from the person's side. at: of the middle of its palm."""

    at: tuple[float, float]
    turn: float = 0.0
    skin: int = 0
    above: float = 0.06


def corners(id: str, pose: Pose) -> Floats:
    x, y, turn = pose
    c, s = math.cos(turn), math.sin(turn)
    return np.asarray(FOOTPRINTS[id] @ np.array([[c, s], [-s, c]]) + [x, y])


def drawn(
    poses: Mapping[str, Pose],
    eye: Eye = EYE,
    light: Light = EVEN,
    hands: Sequence[Hand] = (),
    seed: int = 0,
    take: int = 0,
) -> Picture:
    """A picture, red, green and blue. seed: of sun and grain; take: of the noise."""
    rng = np.random.default_rng(seed)
    sun = np.array([*rng.uniform(-0.6, 0.6, 2), 1.0])
    sun /= np.linalg.norm(sun)
    size = (eye.height * FINE, eye.width * FINE)
    image = np.full((*size, 3), FLOOR, np.uint8)
    lit, wood = np.full(size, 255, np.uint8), np.zeros(size, np.uint8)

    def on(height: float, outline: Any) -> Any:
        """An outline as OpenCV fills it: sixteenths of fine pixels, counted from the middle of the first."""
        pixels = eye(np.column_stack([outline, np.full(len(outline), height)])) * FINE - 0.5
        return np.rint(pixels * 16).astype(np.int32)

    def fill(target: Any, outline: Any, value: Any) -> None:
        cv2.fillPoly(target, [outline], value, cv2.LINE_8, 4)

    def light_on(mask: Any, soft: float) -> Any:
        return cv2.GaussianBlur(shrunk(mask), (0, 0), soft)[..., None] / 255

    def shrunk(large: Any) -> Any:
        return cv2.resize(large, (eye.width, eye.height), interpolation=cv2.INTER_AREA).astype(np.float32)

    for target, value in ((image, WOOD), (wood, 255)):
        fill(target, on(TOP, np.array(TABLE.surface.footprint) + TABLE.surface.center[:2]), value)
    for id, pose in poses.items():
        fill(lit, hull(on(TOP, corners(id, pose)), on(TOP, corners(id, pose) - sun[:2] / sun[2] * THICK)), 0)
    for id in sorted(poses, key=lambda id: -math.dist(eye.at[:2], poses[id][:2])):
        outline, paint = corners(id, poses[id]), np.array(PAINT[COLORS[id]], float)
        for a, b in zip(outline, np.roll(outline, -1, 0), strict=True):
            normal = np.array([b[1] - a[1], a[0] - b[0]]) / np.linalg.norm(b - a)
            if normal @ (np.array(eye.at[:2]) - a) > 0:
                shade = 0.45 + 0.55 * max(0.0, float(normal @ sun[:2])) / sun[2]
                wall = np.concatenate([on(TOP, [a, b]), on(TOP + THICK, [b, a])])
                fill(image, wall, tuple(paint * shade))
                fill(lit, wall, 255)
                fill(wood, wall, 0)
        for target, value in ((image, tuple(paint)), (lit, 255), (wood, 0)):
            fill(target, on(TOP + THICK, outline), value)
    albedo, grained, bright = shrunk(image), shrunk(wood)[..., None] / 255, light_on(lit, 1.5)
    streaks = cv2.resize(rng.normal(0, 0.035, (90, 12)).astype(np.float32), (eye.width, eye.height))[..., None]
    albedo *= 1 + streaks * grained
    for hand in hands:
        dark, cover = np.full(size, 255, np.uint8), np.zeros(size, np.uint8)
        for part in _outlines(hand):
            fill(dark, on(TOP + THICK, part - sun[:2] / sun[2] * hand.above), 0)
            fill(cover, on(TOP + hand.above, part), 255)
        share = shrunk(cover)[..., None] / 255
        albedo = albedo * (1 - share) + np.array(SKINS[hand.skin], np.float32) * (0.9 + 2 * streaks) * share
        bright = np.minimum(bright, light_on(dark, 4)) * (1 - share) + share
    x, y = np.linspace(-1, 1, eye.width)[None, :, None], np.linspace(-1, 1, eye.height)[:, None, None]
    gx, gy = rng.uniform(-0.12, 0.12, 2)
    tint = np.array([1, rng.uniform(0.94, 1.0), rng.uniform(0.86, 1.0)])
    shown = albedo * ((0.45 + 0.55 * bright) * (1 + gx * x + gy * y) * tint * light.strength).astype(np.float32)
    shown = cv2.GaussianBlur(shown, (0, 0), light.blur)
    shown += light.noise * np.random.default_rng([seed, take]).standard_normal(shown.shape, np.float32)
    return np.asarray(np.clip(shown, 0, 255), np.uint8)


def hull(*outlines: Any) -> Any:
    return cv2.convexHull(np.concatenate(outlines))[:, 0]


def _outlines(hand: Hand) -> list[Floats]:
    """A palm, four fingers, a thumb, and a forearm from the far side, in the plane of the hand."""
    round_ = np.linspace(0, math.tau, 24, endpoint=False)
    palm = np.column_stack([0.045 * np.cos(round_), 0.040 * np.sin(round_)])
    parts = [palm, np.array([[0.02, -0.03], [0.5, -0.04], [0.5, 0.04], [0.02, 0.03]])]
    for y, length in ((-0.030, 0.060), (-0.010, 0.072), (0.010, 0.070), (0.029, 0.055)):
        parts.append(
            np.array([[-0.03 - length, y - 0.008], [0, y - 0.009], [0, y + 0.009], [-0.03 - length, y + 0.008]])
        )
    parts.append(np.array([[-0.05, 0.055], [0.01, 0.03], [0.02, 0.045], [-0.045, 0.070]]))
    c, s = math.cos(hand.turn), math.sin(hand.turn)
    return [part @ np.array([[c, s], [-s, c]]) + hand.at for part in parts]


def layout(rng: np.random.Generator) -> dict[str, Pose]:
    """A table on the way to the figure: pieces laid by hand where they belong, one perhaps wrongly, others strewn."""
    ids = [*GOALS]
    built = {TABLE.base, *rng.permutation(ids)[: int(rng.integers(0, len(ids) + 1))].tolist()}
    poses: dict[str, Pose] = {}
    for id in ids:
        if id in built:
            x, y, turn = GOALS[id]
            poses[id] = (x + rng.normal(0, 0.0015), y + rng.normal(0, 0.0015), turn + math.radians(rng.normal(0, 2)))
    poses = _pushed(poses)
    waiting = [id for id in ids if id not in built]
    if waiting and rng.random() < 0.5:
        poses = _pushed(poses | _laid_wrongly(waiting[0], poses, rng))
    for id in waiting:
        if id in poses:
            continue
        for _ in range(500):
            pose = (
                float(rng.uniform(0.36, 0.80)),
                float(rng.uniform(-0.40, 0.40)),
                float(rng.uniform(-np.pi, np.pi)),
            )
            shown = EYE(np.column_stack([corners(id, pose), np.full(len(FOOTPRINTS[id]), TOP)]))
            if (shown.min(0) < 10).any() or (shown.max(0) > [1270, 710]).any():
                continue  # beyond the edge of the picture
            if all(_apart(id, pose, other, where) > 0.012 for other, where in poses.items()):
                poses[id] = pose
                break
    return poses


def _pushed(poses: Mapping[str, Pose]) -> dict[str, Pose]:
    """The same pieces where none is in another: each pair that overlaps pushes itself apart, as thick pieces do."""
    lying = dict(poses)
    for _ in range(PUSHES):
        overlaps = [(a, b, _into(a, lying[a], b, lying[b])) for a, b in combinations(lying, 2)]
        if not any(way.any() for *_, way in overlaps):
            break
        for a, b, (dx, dy) in overlaps:
            for id, share in ((a, -0.55), (b, 0.55)):
                x, y, turn = lying[id]
                lying[id] = (x + share * dx, y + share * dy, turn)
    return lying


def _into(id: str, pose: Pose, other: str, where: Pose) -> Floats:
    """The least way by which another piece has to go to be out of this one; zero if it is."""
    mine, theirs = corners(id, pose), corners(other, where)
    least, way = math.inf, np.zeros(2)
    for outline, sign in ((mine, 1.0), (theirs, -1.0)):
        for a, b in zip(outline, np.roll(outline, -1, 0), strict=True):
            normal = sign * np.array([b[1] - a[1], a[0] - b[0]]) / np.linalg.norm(b - a)
            deep = float((mine @ normal).max() - (theirs @ normal).min())
            if deep < TOUCHING:
                return np.zeros(2)
            if deep < least:
                least, way = deep, deep * normal
    return way


def _laid_wrongly(id: str, poses: Mapping[str, Pose], rng: np.random.Generator) -> dict[str, Pose]:
    """A piece whose edge is laid on an edge of another piece, of the same length, where nothing lies."""
    found = []
    for other, where in poses.items():
        theirs = corners(other, where)
        for a, b in zip(theirs, np.roll(theirs, -1, 0), strict=True):
            for p, q in zip(FOOTPRINTS[id], np.roll(FOOTPRINTS[id], -1, 0), strict=True):
                if abs(math.dist(a, b) - math.dist(p, q)) < 0.001:
                    turn = math.atan2(*(a - b)[::-1]) - math.atan2(*(q - p)[::-1]) + math.radians(rng.normal(0, 2))
                    c, s = math.cos(turn), math.sin(turn)
                    middle = (p + q) / 2 @ np.array([[c, s], [-s, c]])
                    x, y = (a + b) / 2 - middle + rng.normal(0, 0.0015, 2)
                    if all(_apart(id, (x, y, turn), each, at) > 0 or each == other for each, at in poses.items()):
                        found.append((float(x), float(y), turn))
    return {id: found[int(rng.integers(len(found)))]} if found else {}


def _apart(id: str, pose: Pose, other: str, where: Pose) -> float:
    """Distance of two pieces, at their outlines."""
    a, b = corners(id, pose), corners(other, where)
    if cv2.intersectConvexConvex(a.astype(np.float32), b.astype(np.float32))[0] > 0:
        return 0.0
    dense = [
        np.concatenate([np.linspace(p, q, 12) for p, q in zip(c, np.roll(c, -1, 0), strict=True)]) for c in (a, b)
    ]
    return float(np.linalg.norm(dense[0][:, None] - dense[1], axis=2).min())
