"""Pieces in one picture of a table: which pixels have which color, and where the forms lie that have it.

The picture is laid out flat, as if seen from straight above at the height of the tops of the pieces. Light is not
what it was when the colors were learned: it is brighter or darker, of another tint, uneven, and pieces and hands
throw shadows. So each pixel is compared with the colors as they would look under the light that the table has around
it, in shadows of several depths, and as a camera clips what is too bright. What is like none of them (a sleeve, a
hand) says nothing: it covers.

A form is laid wherever much of its color is (all turns, on a coarse lattice), and then moved until its edges lie on
the edges in the picture. There each edge has the colors on both of its sides to compare, whatever the light. A piece
has walls: those that look at the camera are seen below its top. So an edge on that side may be found in two places,
and the other edges say in which. What the edges leave open is the doubt; a piece of which too little is seen to say
where it lies is not told.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from engage_hri.schemas.tables import Form, TaskTable
from engage_hri.schemas.units import Meters, Radians
from engage_hri.services.perception.eyes.camera import StatedCamera
from engage_hri.services.perception.eyes.looking import Floats
from engage_hri.services.perception.pictures import Image
from engage_hri.services.perception.pieces.colors import TABLE, Palette
from engage_hri.services.perception.pieces.hands import HandFinder
from engage_hri.services.perception.pieces.spotting import SpottedHand, SpottedPiece

Labels = NDArray[np.int8]
STEP: Meters = 0.0015
"""Size of a pixel of the table that is laid out flat."""
MARGIN: Meters = 0.02
WIDE: Meters = 0.08
"""Width over which light is taken for even: wider than a hand."""
UNKNOWN = -1
SHADES = (1.15, 1.0, 0.86, 0.74, 0.63, 0.54, 0.46, 0.4, 0.34)
"""Light of a pixel, as shares of that around it."""
NOISE, TINT = 6.0, 0.07
"""Deviation of a pixel from its color: of 255, and as a share."""
FAR = 3.0
"""Deviations from which on a pixel has none of the colors."""
SKIP = 4
"""Pixels between the places of the lattice."""
PAD = 80
"""Pixels around a picture in which nothing is, so that forms may reach over its edge."""
TURN: Radians = math.radians(15.0)
SPACING: Meters = 0.003
"""Distance of the points of an edge at which the picture is compared on both sides."""
REACH: Meters = 0.006
"""Distance to which an edge is looked for."""
SIDE: Meters = 0.003
"""Length over which the color beside an edge is taken."""
CLEAR: Meters = 0.0015
"""Distance from an edge within which colors of both sides mix."""
TOLERANCE: Meters = 0.001
"""Residual from which on a point of an edge counts less: half as much here."""
CORRELATED = 8.0
"""How many points of an edge err alike: what blurs a picture, and grains of a table, are larger than `SPACING`."""
ROUNDS = 7
BESIDE = np.array([[0.004, 0.0, 0.0], [-0.004, 0.0, 0.0], [0.0, 0.004, 0.0], [0.0, -0.004, 0.0]])
"""Steps to places beside, and their turns."""
SMALL: Meters = 0.0001
"""Step after which the next would change nothing."""
UNEVEN = 0.15
"""Share by which the brightness of a piece's wall differs from that of its top."""
LEAST_SEEN, MOST_FOREIGN, MOST_BEYOND = 0.35, 0.2, 0.45
"""Share of a form that must have its color, and may have another; of its surroundings that may have its color."""
BARE = 0.06
"""Share by which the place of a piece that is away may differ from the color of the table."""
LEAST, SAME = 1.0, 1.3
"""Score of what is a piece at all; and of one that is where it was, so that it is not looked for. At most it is 2."""
RIVAL = 0.2
"""Difference of scores up to which all pixels around decide: a trapezoid is nearly a triangle, and the foot of a wall
looks like the edge of a top."""
LEAST_AGREED, CLOSE = 0.4, 0.05
"""Share of the colors around that a piece explains at least; and difference of it up to which it is not known which
of two places is that of the piece."""
AGAIN = 10
"""Pictures after which a piece is looked for everywhere, whatever its score."""
PLACE_KNOWN: Meters = 0.003
TURN_KNOWN: Radians = math.radians(3.0)
"""Standard deviations of place and turn from which on it is not known where a piece lies."""


class _Laid(NamedTuple):
    """A form at a place. score: how well it explains the colors there. hidden: share of it of which none is known."""

    pose: Floats
    score: float
    seen: float = 0.0
    support: float = 0.0
    spread: float = math.inf
    turn_spread: float = math.inf
    hidden: float = 0.0


class FoundOnTable(NamedTuple):
    """Pieces and hands in a picture. bare: ids of pieces where the bare table is seen now that were seen before."""

    pieces: tuple[SpottedPiece, ...]
    bare: tuple[str, ...]
    hands: tuple[SpottedHand, ...]


class _Seen(NamedTuple):
    """A picture, laid out flat. value: 1 where a color is, -1 where another one is. tops: the same, less on walls.

    covered: 1 where a hand is.
    """

    flat: Any
    value: Any
    tops: Any
    covered: Any


class FlatTable:
    """A table before a camera: pictures of it are laid out flat, pixels of `STEP`, rows along x, columns along y."""

    def __init__(self, table: TaskTable, camera: StatedCamera, width: int, height: int) -> None:
        """Look at it with a camera. width, height: of its pictures, pixels."""
        eye = camera.place(np.zeros(3))
        x, y, z = table.surface.center
        corners = np.array(table.surface.footprint) + np.array([x, y])
        self.low = corners.min(0) - MARGIN
        self.rows, self.columns = (int(n) for n in np.ceil((corners.max(0) + MARGIN - self.low) / STEP))
        top = z + table.thickness
        square = np.array([[0, 0], [self.columns, 0], [self.columns, self.rows], [0, self.rows]], np.float32)
        places = np.column_stack([square[:, ::-1] * STEP + self.low, np.full(4, top)])
        pixels = camera.pixels(places, width, height)
        # OpenCV counts pixels by their middles.
        self._map = cv2.getPerspectiveTransform(square - np.float32(0.5), (pixels - 0.5).astype(np.float32))
        inside = np.zeros((self.rows, self.columns), np.uint8)
        cv2.fillConvexPoly(inside, np.rint(self.at(corners)[:, ::-1]).astype(np.int32), 1)
        self.is_table = np.asarray(cv2.erode(inside, np.ones((5, 5), np.uint8)), np.uint8)  # its edge is of no color
        self.eye, self.height = np.array(eye[:2], float), eye[2] - top
        self.sunk = (eye[2] - top) / (eye[2] - z)
        """Scale about the eye that brings an outline on the table to where the plane of the tops shows it."""

    def laid_out(self, image: Image) -> NDArray[np.float32]:
        """The table in a picture, from above. Zero beside the table, and where the picture does not reach."""
        soft = cv2.GaussianBlur(image, (0, 0), 0.8)
        shape = (self.columns, self.rows)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        flat = cv2.warpPerspective(soft, self._map, shape, flags=flags)
        return np.asarray(flat * self.is_table[..., None], np.float32)

    def at(self, points: Floats) -> Floats:
        """Rows and columns of places on the table, with their fractions."""
        return np.asarray((points - self.low) / STEP)


def light(flat: NDArray[np.float32], table: Sequence[float]) -> NDArray[np.float32]:
    """Light around each pixel, by color, as a share of that under which the table had its color."""
    ratio = cv2.blur(flat, (5, 5))[::4, ::4] / np.array(table, np.float32)
    seen = ratio.min(2) > 0.02
    overall = np.median(ratio[seen], 0) if seen.any() else np.ones(3, np.float32)
    near = (np.abs(ratio / overall - 1).max(2) < 0.2) & seen
    weight = near.astype(np.float32)[..., None]
    total = cv2.GaussianBlur(np.concatenate([ratio * weight, weight], 2), (0, 0), WIDE / STEP / 4)
    own = 0.02
    local = (total[..., :3] + own * overall) / (total[..., 3:] + own)
    return np.asarray(cv2.resize(local, flat.shape[1::-1], interpolation=cv2.INTER_LINEAR), np.float32)


def labeled(flat: NDArray[np.float32], around: NDArray[np.float32], palette: Palette) -> Labels:
    """Color of each pixel: its number in the palette, or `UNKNOWN`. around: the light there."""
    names = [*palette]
    soft = cv2.GaussianBlur(flat, (0, 0), 0.8)
    labels = np.full(flat.shape[:2], UNKNOWN, np.int8)
    ground = _distance(soft.reshape(-1, 3), around.reshape(-1, 3), palette[TABLE]).reshape(labels.shape)
    is_seen = _summed(soft) > 0
    ground[~is_seen] = np.inf
    labels[ground < FAR] = names.index(TABLE)
    rest = np.nonzero((ground > FAR / 3) & is_seen)
    pixels, lights, best = soft[rest], around[rest], np.minimum(ground[rest], FAR)
    found = labels[rest]
    for number, name in enumerate(names):
        if name != TABLE:
            distance = _distance(pixels, lights, palette[name])
            nearer = distance < best
            best, found = np.where(nearer, distance, best), np.where(nearer, number, found)
    labels[rest] = found
    return labels


def _distance(pixels: Any, lights: Any, color: Sequence[float]) -> Any:
    """Deviations of pixels from a color, in the shade in which it is nearest."""
    least = np.full(len(pixels), np.inf, np.float32)
    full = lights * np.array(color, np.float32)
    for shade in SHADES:
        expected = np.minimum(full * np.float32(shade), 255)
        spread = NOISE**2 + (TINT * expected) ** 2
        least = np.minimum(least, _summed((pixels - expected) ** 2 / spread))
    return np.sqrt(least / 3)


def _summed(colors: Any) -> Any:
    """Red, green and blue added: four times as fast as `sum`, whose loop is over these three."""
    return colors[..., 0] + colors[..., 1] + colors[..., 2]


class _Shape:
    """A form, with the points at which it is compared with a picture. All in its own frame."""

    def __init__(self, form: Form) -> None:
        self.form, self.outline = form, np.array(form.footprint)
        after = np.roll(self.outline, -1, 0)
        along = after - self.outline
        length = np.linalg.norm(along, axis=1, keepdims=True)
        normals = np.column_stack([along[:, 1], -along[:, 0]]) / length
        points, sides = [], []
        for start, step, size, normal in zip(self.outline, along / length, length[:, 0], normals, strict=True):
            clear = min(0.004, size / 4)
            for way in np.linspace(clear, size - clear, max(2, round((size - 2 * clear) / SPACING) + 1)):
                points.append(start + way * step)
                sides.append(normal)
        self.points, self.normals = np.array(points), np.array(sides)
        low, high = self.outline.min(0), self.outline.max(0)
        apart = max(0.003, math.sqrt(float(np.prod(high - low)) / 100))
        lattice = np.stack(np.meshgrid(*(np.arange(a, b, apart) for a, b in zip(low, high, strict=True))), -1)
        lattice = lattice.reshape(-1, 2) + apart / 2
        depth = ((lattice[:, None] - self.outline) * normals).sum(2).max(1)
        self.inside = lattice[depth < -0.0025]
        self.beyond, self.beyond_normals = self.points + 0.004 * self.normals, self.normals

    def is_same(self, pose: Floats, other: Floats) -> bool:
        """Tell whether two poses are one, as far as it is known where a piece lies."""
        turn = math.remainder(pose[2] - other[2], math.tau / self.form.turns_alike)
        return math.dist(pose[:2], other[:2]) <= 2 * PLACE_KNOWN and abs(turn) <= 2 * TURN_KNOWN


def _turning(angle: float) -> Floats:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s], [-s, c]])


class PieceFinder:
    """Finds the pieces of a table in pictures of one camera."""

    def __init__(self, table: TaskTable, flat: FlatTable, palette: Palette) -> None:
        self._flat, self._palette = flat, palette
        self._names = [*palette]
        self._shapes = [_Shape(form) for form in table.pieces]
        self._hands = HandFinder(flat.is_table, flat.low, STEP, flat.eye, flat.height, table.thickness)
        self._last: dict[str, Floats] = {}
        """Pose in which each was seen last."""
        self._count = 0

    def find(self, image: Image) -> FoundOnTable:
        """Find the pieces in the next picture, and the hands."""
        flat = self._flat.laid_out(image)
        around = light(flat, self._palette[TABLE])
        labels = labeled(flat, around, self._palette)
        is_piece = (labels != UNKNOWN) & (labels != self._names.index(TABLE))
        covered = self._hands.cover(flat, around * np.array(self._palette[TABLE], np.float32), is_piece)
        labels[covered] = UNKNOWN
        found, tone = [], _summed(cv2.GaussianBlur(flat, (0, 0), 1.0))
        for color in {shape.form.color: None for shape in self._shapes}:
            shapes = [shape for shape in self._shapes if shape.form.color == color]
            found += self._of_color(flat, tone, labels, covered, self._names.index(color), shapes)
        ids = {piece.id for piece in found}
        away = [shape for shape in self._shapes if shape.form.id not in ids]
        bare = [shape.form.id for shape in away if self._is_bare(flat, around, covered, shape)]
        self._last |= {piece.id: np.array([piece.x, piece.y, piece.yaw]) for piece in found}
        self._count += 1
        tops = np.zeros(labels.shape, np.float32)
        for shape in self._shapes:
            if shape.form.id in ids:
                self._fill(tops, shape, self._last[shape.form.id], 1.0)
        return FoundOnTable(tuple(found), tuple(bare), tuple(self._hands.hands(tops)))

    def _is_bare(self, flat: Any, around: Any, covered: Any, shape: _Shape) -> bool:
        """Tell whether the table is seen where a form lay last.

        Skin may be like it in another light: on average it has to be like it in this one.
        """
        if (pose := self._last.get(shape.form.id)) is None:
            return False
        places = shape.inside @ _turning(pose[2]) + pose[:2]
        if self._sampled(covered, places).any():
            return False
        seen, lights = (self._sampled(each, places).mean(0) for each in (flat, around))
        expected = np.minimum(lights * np.array(self._palette[TABLE]), 255)
        return bool((np.abs(seen - expected) < BARE * expected + NOISE / 2).all())

    def _of_color(
        self, flat: Any, tone: Any, labels: Labels, covered: Any, number: int, shapes: Iterable[_Shape]
    ) -> list[SpottedPiece]:
        """Find the pieces of one color: the one that explains most first; what it explains is no other's."""
        value = np.where(labels == number, 1.0, np.where(labels == UNKNOWN, 0.0, -1.0)).astype(np.float32)
        tops = self._tops(tone, value)
        found, left = list[tuple[SpottedPiece, _Shape, Floats]](), value.copy()
        seen = _Seen(flat, value, tops, covered)
        looks_everywhere = (self._count + number) % AGAIN == 0
        waiting = {shape.form.id: shape for shape in shapes}
        best = {id: self._where_it_was(seen, shape) for id, shape in waiting.items()}
        while waiting:
            for id, shape in waiting.items():
                if looks_everywhere or best[id].score < SAME:
                    best[id] = max(best[id], self._anywhere(seen, shape), key=lambda laid: laid.score)
            id = max(waiting, key=lambda each: best[each].score)
            shape, laid = waiting.pop(id), best[id]
            if laid.score <= LEAST:
                break
            x, y, yaw = laid.pose.tolist()
            found.append((SpottedPiece(id, x, y, yaw, laid.seen, laid.spread, laid.turn_spread), shape, laid.pose))
            self._fill(left, shape, laid.pose, -1.0)  # what it explains is no other's
            seen = seen._replace(value=left, tops=np.minimum(tops, left))
            best = {each: self._judged(seen, shape, best[each]) for each, shape in waiting.items()}
            looks_everywhere = False
        return [each for each, shape, pose in found if self._agreement(value, left, shape, pose) > LEAST_AGREED]

    # -- where a form may lie ---------------------------------------------------------------------------------------

    def _where_it_was(self, seen: _Seen, shape: _Shape) -> _Laid:
        """Lay a form where it was seen last. Its score is 0 if that is nowhere."""
        last = self._last.get(shape.form.id)
        return _Laid(np.zeros(3), 0.0) if last is None else self._moved(seen, shape, last)

    def _anywhere(self, seen: _Seen, shape: _Shape) -> _Laid:
        """Lay a form where it explains its color best, of all places."""
        tried = [
            _Laid(np.zeros(3), 0.0),
            *(self._moved(seen, shape, each) for each in self._likely(seen.tops, shape)),
        ]
        best = max(tried, key=lambda laid: laid.score)
        if best.score <= 0:
            return best
        # One edge of a top and the foot of another wall may agree on a place beside the right one.
        wall = np.array([*(best.pose[:2] - self._sunk(best.pose[:2])), 0.0])
        tried += [self._moved(seen, shape, best.pose + step) for step in (*BESIDE, wall, -wall)]
        least = max(laid.score for laid in tried) - RIVAL
        agreed = [
            (self._agreement(seen.value, seen.value, shape, laid.pose), laid)
            for laid in tried
            if laid.score > max(0.0, least - laid.hidden)  # what is hidden might have its color
        ]
        most, best = max(agreed, key=lambda each: each[0])
        as_well = (laid for agreement, laid in agreed if agreement > most - CLOSE)
        is_sure = all(shape.is_same(laid.pose, best.pose) for laid in as_well)
        return best if is_sure else best._replace(score=0.0)

    def _agreement(self, value: Any, left: Any, shape: _Shape, pose: Floats) -> float:
        """Judge how well a form there explains all colors around, by its top and its walls: share of what is known
        that it explains, less what it does not. The color of a wall in its shade may be that of another piece.

        left: value, less what other pieces explain.
        """
        outline, top = self._silhouette(shape, pose), self._flat.at(shape.outline @ _turning(pose[2]) + pose[:2])
        low = np.floor(outline.min(0) - MARGIN / STEP).astype(int).clip(0)
        high = np.ceil(outline.max(0) + MARGIN / STEP).astype(int)
        value, left = (each[low[1] : high[1], low[0] : high[0]] for each in (value, left))
        covers, is_top = np.zeros(value.shape, np.uint8), np.zeros(value.shape, np.uint8)
        for mask, points in ((covers, outline), (is_top, top[:, ::-1])):
            cv2.fillConvexPoly(mask, np.rint(points - low - 0.5).astype(np.int32), 1)
        own = int(((value > 0) & (covers > 0)).sum())
        against = int(((value < 0) & (is_top > 0)).sum() + ((left > 0) & (covers == 0)).sum())
        return (own - against) / max(own + against, 1)

    def _tops(self, tone: Any, value: Any) -> Any:
        """Values in which walls count less than tops: most of what is seen of a piece is its top, and walls are
        darker or brighter.
        """
        mask = cv2.morphologyEx((value > 0).astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
        count, numbers, boxes, _ = cv2.connectedComponentsWithStats(mask)
        tops = value.copy()
        for number in range(1, count):
            left, top, wide, tall, _ = boxes[number]
            box = np.s_[top : top + tall, left : left + wide]
            own = numbers[box] == number
            usual = float(np.median(tone[box][own]))
            tops[box][own & (np.abs(tone[box] - usual) > UNEVEN * usual + 3 * NOISE)] = 0.2
        return tops

    def _likely(self, value: Any, shape: _Shape, most: int = 4) -> list[Floats]:
        """Poses on a coarse lattice in which a form explains its color best."""
        mask = (value > 0.5).astype(np.uint8)
        mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
        count, _, boxes, _ = cv2.connectedComponentsWithStats(mask)
        turns = np.arange(0, math.tau / shape.form.turns_alike - 1e-6, TURN)
        padded = np.pad(value, PAD)
        poses: list[tuple[float, tuple[int, int, float]]] = []
        for box in boxes[1:count]:
            left, top, wide, tall, area = (int(each) for each in box)
            if area * STEP**2 < 1e-4:  # a square centimetre
                continue
            pixels = np.stack(
                np.meshgrid(np.arange(top, top + tall + 1, SKIP), np.arange(left, left + wide + 1, SKIP)), -1
            ).reshape(-1, 2)
            for turn in turns:
                scores = self._explained(padded, shape, pixels, turn)
                best = int(scores.argmax())
                poses.append((float(scores[best]), (*pixels[best].tolist(), turn)))
        poses.sort(key=lambda each: -each[0])
        chosen: list[Floats] = []
        for score, (row, column, turn) in poses:
            if score < 0.1 or len(chosen) >= most:
                break
            place = self._flat.low + (np.array([row, column]) + 0.5) * STEP
            if all(
                math.dist(place, other[:2]) > 0.015
                or abs(math.remainder(turn - other[2], math.tau / shape.form.turns_alike)) > TURN
                for other in chosen
            ):
                chosen.append(self._nearer(padded, shape, row, column, turn))
        return chosen

    def _nearer(self, padded: Any, shape: _Shape, row: int, column: int, turn: Radians) -> Floats:
        """Look between the places of the lattice, twice as near each time."""
        place, score = np.array([row, column]), -math.inf
        for skip in (SKIP // 2, SKIP // 4):
            near = np.stack(np.meshgrid(*[np.arange(-2, 3) * skip] * 2), -1).reshape(-1, 2)
            turns = turn + np.arange(-2, 3) * TURN * skip / SKIP / 2
            middle = place
            for each in turns:
                scores = self._explained(padded, shape, middle + near, each)
                best = int(scores.argmax())
                if scores[best] > score:
                    score, place, turn = float(scores[best]), middle + near[best], float(each)
        return np.array([*(self._flat.low + (place + 0.5) * STEP), turn])

    def _explained(self, padded: Any, shape: _Shape, pixels: Any, turn: Radians) -> Any:
        """Judge forms at pixels, with one turn, by their color: it is inside, and not beyond their walls."""
        rotation = _turning(turn)
        middle = self._flat.low + pixels[len(pixels) // 2] * STEP
        facing = self._faces_eye(middle, shape.beyond_normals @ rotation)
        beyond = shape.beyond @ rotation + middle
        beyond = np.where(facing[:, None], self._sunk(beyond), beyond) - middle
        inside = self._around(padded, pixels, shape.inside @ rotation).mean(1)
        return inside - np.maximum(self._around(padded, pixels, beyond), 0).mean(1)

    def _around(self, padded: Any, pixels: Any, offsets: Floats) -> Any:
        """Values at offsets around each of some pixels."""
        rows, columns = np.rint(offsets / STEP).astype(np.int64).T + PAD
        near = rows * padded.shape[1] + columns
        base = pixels[:, 0].astype(np.int64) * padded.shape[1] + pixels[:, 1]
        return padded.ravel()[base[:, None] + near]

    def _faces_eye(self, points: Floats, normals: Floats) -> Any:
        return ((self._flat.eye - points) * normals).sum(-1) > 0

    def _sunk(self, points: Floats) -> Floats:
        """Places at which the foot of a wall is seen whose upper edge has these points."""
        return np.asarray(self._flat.eye + self._flat.sunk * (points - self._flat.eye))

    def _sampled(self, value: Any, points: Floats) -> Any:
        rows, columns = np.moveaxis(np.rint(self._flat.at(points) - 0.5).astype(np.int32), -1, 0)
        inside = (rows >= 0) & (columns >= 0) & (rows < self._flat.rows) & (columns < self._flat.columns)
        found = value[rows * inside, columns * inside]
        return np.where(inside if found.ndim == inside.ndim else inside[..., None], found, 0.0)

    # -- where exactly ----------------------------------------------------------------------------------------------

    def _moved(self, seen: _Seen, shape: _Shape, pose: Floats) -> _Laid:
        """Move a form onto the edges near it."""
        information, residual = np.zeros((3, 3)), TOLERANCE
        for round_ in range(ROUNDS):
            rotation = _turning(pose[2])
            points, normals = shape.points @ rotation + pose[:2], shape.normals @ rotation
            away, weight = self._edges(seen.flat, points, normals)
            # Where a hand is on either side, the edge may be that of the hand.
            weight[
                (self._sampled(seen.covered, points) > 0) | (self._sampled(seen.covered, points + SIDE * normals) > 0)
            ] = 0
            weight = weight / (1 + (away / (TOLERANCE * (2 if round_ < ROUNDS / 2 else 1))) ** 2) ** 2
            arm = points - pose[:2]
            rows = np.column_stack([normals, normals[:, 1] * arm[:, 0] - normals[:, 0] * arm[:, 1]])
            information = (rows * weight[:, None]).T @ rows
            step = np.linalg.solve(information + np.diag([1e-3, 1e-3, 1e-7]), rows.T @ (weight * away))
            pose = pose + np.clip(step, [-0.006, -0.006, -0.15], [0.006, 0.006, 0.15])
            residual = max(0.0004, math.sqrt(float((weight * away**2).sum() / max(weight.sum(), 1e-9))))
            if round_ >= ROUNDS / 2 and np.abs(step[:2]).max() < SMALL:
                break
        covariance = np.linalg.inv(information / CORRELATED + np.diag([1e-6, 1e-6, 1e-10])) * residual**2
        support = float(((weight > 0.1) & (np.abs(away) < 2 * TOLERANCE)).mean())
        laid = _Laid(
            pose, 0.0, 0.0, support, math.sqrt(covariance[0, 0] + covariance[1, 1]), math.sqrt(covariance[2, 2])
        )
        return self._judged(seen, shape, laid)

    def _edges(self, flat: Any, points: Floats, normals: Floats) -> tuple[Floats, Floats]:
        """Look for the edge at each point along its normal. Returns how far outside it is, and its weight."""
        facing = self._faces_eye(points, normals)
        sunk = self._sunk(points)
        wall = np.where(facing, ((sunk - points) * normals).sum(1), 0.0)
        steps = np.arange(-REACH - SIDE - CLEAR, REACH + SIDE + CLEAR + 1e-9, 0.00075)
        offsets = steps + np.where(steps > 0, wall[:, None], 0.0) * (steps > 0)
        # Along a wall the steps are wider, so that each profile has as many.
        stretch = (REACH + wall)[:, None] / REACH
        offsets = np.where(steps > 0, np.minimum(steps, REACH) * stretch + np.maximum(steps - REACH, 0), steps)
        at = self._flat.at(points[:, None] + offsets[..., None] * normals[:, None]) - 0.5
        profile = cv2.remap(
            flat, at[..., 1].astype(np.float32), at[..., 0].astype(np.float32), cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
        )  # fmt: skip
        within = (steps < -CLEAR) & (steps > -CLEAR - SIDE)
        without = (offsets > wall[:, None] + CLEAR) & (offsets < wall[:, None] + CLEAR + SIDE)
        inner = profile[:, within].mean(1)
        outer = (profile * without[..., None]).sum(1) / np.maximum(without.sum(1), 1)[:, None]
        contrast = inner - outer
        strength = np.linalg.norm(contrast, axis=1)
        share = ((profile - outer[:, None]) * contrast[:, None]).sum(2) / np.maximum(strength, 1)[:, None] ** 2
        # The first crossing of one half, from inside to outside, within reach.
        first, last = int(np.searchsorted(steps, -REACH)), int(np.searchsorted(steps, REACH))
        inside = share[:, first:last] >= 0.5
        crosses = inside & (share[:, first + 1 : last + 1] < 0.5)
        near = np.abs(steps[first:last])[None]
        cost = np.where(crosses, near, np.inf)
        index = cost.argmin(1)
        each = np.arange(len(points))
        is_found = crosses[each, index]
        a, b = share[each, first + index], share[each, first + index + 1]
        part = np.where(is_found, (a - 0.5) / np.where(is_found, a - b, 1.0), 0.0)
        start, stop = offsets[each, first + index], offsets[each, first + index + 1]
        away = start + part * (stop - start)
        away = np.where(np.abs(away) <= np.abs(away - wall), away, away - wall)
        limit = 0.12 * np.maximum(np.linalg.norm(inner, axis=1), np.linalg.norm(outer, axis=1)) + 8
        weight = np.where(is_found & (strength > limit), np.where(facing, 0.3, 1.0), 0.0)
        return np.where(weight > 0, away, 0.0), weight

    def _judged(self, seen: _Seen, shape: _Shape, laid: _Laid) -> _Laid:
        """Judge by the colors whether a form lies there."""
        rotation = _turning(laid.pose[2])
        places = shape.inside @ rotation + laid.pose[:2]
        inside, top = self._sampled(seen.value, places), self._sampled(seen.tops, places)
        points, normals = shape.beyond @ rotation + laid.pose[:2], shape.beyond_normals @ rotation
        points = np.where(self._faces_eye(points, normals)[:, None], self._sunk(points), points)
        beyond = float((self._sampled(seen.value, points) > 0).mean())
        own, foreign = float((inside > 0).mean()), float((inside < 0).mean())
        is_there = own >= LEAST_SEEN and foreign <= MOST_FOREIGN and beyond <= MOST_BEYOND
        is_known = laid.spread <= PLACE_KNOWN and laid.turn_spread <= TURN_KNOWN
        score = float((top > 0.5).mean()) + laid.support - foreign - beyond
        hidden = 1 - own - foreign
        return laid._replace(score=score if is_there and is_known else 0.0, seen=own, hidden=hidden)

    def _fill(self, value: Any, shape: _Shape, pose: Floats, filling: float) -> None:
        """Fill what a piece explains, its top and its walls."""
        cv2.fillConvexPoly(value, np.rint(self._silhouette(shape, pose, 1.03)).astype(np.int32), filling)

    def _silhouette(self, shape: _Shape, pose: Floats, scale: float = 1.0) -> Floats:
        """Outline in which a piece is seen, its top and its walls: columns and rows."""
        top = shape.outline * scale @ _turning(pose[2]) + pose[:2]
        outline = cv2.convexHull(self._flat.at(np.concatenate([top, self._sunk(top)])).astype(np.float32))
        return np.asarray(outline[:, 0, ::-1], float)


def learned(image: Image, table: TaskTable, flat: FlatTable) -> Palette:
    """Learn the colors of pieces, and of the table, from a picture in which each lies where the task begins."""
    laid = flat.laid_out(image)
    samples: dict[str, list[Any]] = {}
    free = np.ones(laid.shape[:2], np.uint8)
    for form in table.pieces:
        place = np.array([form.start.x, form.start.y])
        shape = np.array(form.footprint) @ _turning(math.radians(form.start.yaw))
        mask = np.zeros(laid.shape[:2], np.uint8)
        inner, outer = flat.at(shape * 0.6 + place), flat.at(shape * 1.6 + place)
        cv2.fillConvexPoly(mask, np.rint(inner[:, ::-1]).astype(np.int32), 1)
        cv2.fillConvexPoly(free, np.rint(outer[:, ::-1]).astype(np.int32), 0)
        samples.setdefault(form.color, []).append(laid[mask > 0])
    free[laid.max(2) == 0] = 0
    colors = {name: np.median(np.concatenate(each), 0) for name, each in samples.items()}
    colors[TABLE] = np.median(laid[free > 0], 0)
    return {name: (float(r), float(g), float(b)) for name, (r, g, b) in colors.items()}
