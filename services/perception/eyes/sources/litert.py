"""Faces in pictures, by the models of MediaPipe's face mesh on LiteRT: a detector, and the mesh of each face.

The detector is asked where no face is known, and now and then for who has come, in parts of the picture as well if
there is nobody near; a known face is followed by its own points. Both models want faces as their cards say: colors
in 0..1 (mesh) or -1..1 (detector), a face upright in a square half as large again as its points. They are those in
the wheel of mediapipe 0.10.21 (`packages.py`).
"""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.perception import FACE_POINTS
from engage_hri.schemas.units import Probability
from engage_hri.services.perception.eyes.looking import Floats, missing
from engage_hri.services.runtime.parcels import DETECTOR, MESH

Image = NDArray[np.uint8]
"""Rows of pixels, red, green and blue."""
DETECTED = 128
"""Pixels of the side of a picture that the detector takes."""
MESHED = 192
EVERY = 5
"""Pictures after which the detector looks for who has come."""
SURE = 0.5
"""Confidence from which on there is a face."""
SAME = 0.3
"""Share of two boxes that they have in common, from which on they are one face."""
REFINED = 4
"""Squares that are tried for a new face, each by the points that were found in the one before."""
LARGER = 1.5
LEFT_EYE, RIGHT_EYE = 263, 33
"""Outer corners of the eyes, of the person."""
ANCHORS = np.array(
    [
        ((x + 0.5) / n, (y + 0.5) / n)
        for n, k in ((16, 2), (8, 6))
        for y in range(n)
        for x in range(n)
        for _ in range(k)
    ]
)


class Crop(NamedTuple):
    """A square of a picture with a face upright in it. middle: pixels. side: pixels. angle: radians, clockwise."""

    middle: Floats
    side: float
    angle: float

    @property
    def axes(self) -> Floats:
        """Directions to the right and down, in rows."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, s], [-s, c]])


class FaceFinder:
    """Finds faces in pictures that follow one another. folder: with the models. most: faces at once."""

    def __init__(self, folder: Path, most: int) -> None:
        """Load the models. Raises InputRefused."""
        try:
            import cv2
            from ai_edge_litert.interpreter import Interpreter
        except ImportError as error:
            raise missing("eyes", error) from error
        for name in (DETECTOR, MESH):
            if not (folder / name).is_file():
                raise InputRefused(
                    Fault(reason=f"there is no {folder / name}", where="eyes", advice="engage eyes install")
                )
        self._cv2: Any = cv2
        self._detect, self._mesh = (_Net(Interpreter(str(folder / name), num_threads=1)) for name in (DETECTOR, MESH))
        self._most, self._known, self._count = most, list[Crop](), 0

    def find(self, image: Image) -> list[tuple[Floats, Probability]]:
        """Find the faces of the next picture. Returns the points of each, and the confidence that it is one."""
        known, self._known = self._known, []
        found: list[tuple[Floats, Probability]] = []
        for crop in known:
            self._take(image, crop, found)
        if len(found) < self._most and (self._count % EVERY == 0 or not found):
            for crop in self._sought(image, is_alone=not found):
                self._take(image, crop, found)
        self._count += 1
        return found

    def _take(self, image: Image, crop: Crop, found: list[tuple[Floats, Probability]]) -> None:
        """Add the face in a square, if there is one that is not among those that were found, and room for it."""
        if len(found) == self._most or any(_is_same(crop, old) for old in self._known):
            return
        points, confidence = self._meshed(image, crop)
        if confidence >= SURE and not any(_is_same(around(points), old) for old in self._known):
            self._known.append(around(points))
            found.append((points, confidence))

    def _refined(self, image: Image, crop: Crop) -> Crop | None:
        """The square of a new face: the mean of those that are sure, by how sure they are; None: none is.

        Each but the first is by the points that were found in the one before: the detector knows no more than the
        eyes, and of a head that is turned aside and down at once these lie askew. All are sure to the last digit, so
        to take the surest would be chance, and another one in a page.
        """
        for upright in (False, True):
            each = crop._replace(angle=0.0) if upright else crop
            tried = list[tuple[Crop, float]]()
            for _ in range(REFINED):
                points, confidence = self._meshed(image, each)
                tried.append((each, max(confidence - SURE, 0.0)))
                each = around(points)
            if any(weight for _, weight in tried):
                return _mean(tried)
        return None

    def _sought(self, image: Image, *, is_alone: bool) -> Iterator[Crop]:
        """Look for faces: in the whole picture, and now and then in parts of it, in which who is far is larger.

        is_alone: nobody is known. Then all parts are looked at, unless somebody is near; else one after the other.
        """
        near = [crop for found in self._detected(image) if (crop := self._refined(image, found)) is not None]
        yield from near
        if self._count % EVERY == 0:
            parts = [*_parts(image)]
            if near or not is_alone:
                parts = [parts[self._count // EVERY % len(parts)]]
            for left, top, side in parts:
                for crop in self._detected(image[top : top + side, left : left + side]):
                    moved = crop._replace(middle=crop.middle + np.array([left, top]))
                    if (new := self._refined(image, moved)) is not None:
                        yield new

    def _detected(self, image: Image) -> Iterator[Crop]:
        """Squares in which faces may be, the surest first."""
        height, width = image.shape[:2]
        side = max(width, height)
        wide, tall = max(1, DETECTED * width // side), max(1, DETECTED * height // side)
        across, down = (DETECTED - wide) // 2, (DETECTED - tall) // 2
        small = np.zeros((DETECTED, DETECTED, 3), np.uint8)
        small[down : down + tall, across : across + wide] = self._cv2.resize(
            image, (wide, tall), interpolation=self._cv2.INTER_AREA
        )
        left, top = across * side / DETECTED, down * side / DETECTED
        boxes, scores = self._detect(small.astype(np.float32) / 127.5 - 1)
        if boxes.shape[-1] == 1:
            boxes, scores = scores, boxes
        score, box = scores.ravel(), boxes.reshape(-1, 8, 2) / DETECTED
        sure = np.flatnonzero(score > 0)  # a logarithm of chances: 0 is one half
        sure = sure[np.argsort(-score[sure])]
        while len(sure):
            middle = box[sure, 0] + ANCHORS[sure]
            near = np.abs(middle - middle[0]).max(1) < box[sure[0], 1].max() / 2
            chosen = sure[near]
            weights = 1 / (1 + np.exp(-score[chosen]))
            eyes = np.average(box[chosen, 2:4] + ANCHORS[chosen][:, None], axis=0, weights=weights)
            centre = np.average(middle[near], axis=0, weights=weights)
            size = np.average(box[chosen, 1], axis=0, weights=weights).max()
            across = eyes[1] - eyes[0]
            yield Crop(
                centre * side - [left, top], float(size * side * LARGER), float(np.arctan2(across[1], across[0]))
            )
            sure = sure[~near]

    def _meshed(self, image: Image, crop: Crop) -> tuple[Floats, Probability]:
        # OpenCV counts pixels by their middles.
        scale = crop.side / MESHED
        back = np.column_stack([crop.axes.T * scale, crop.middle - crop.axes.T @ [crop.side / 2, crop.side / 2]])
        shift = np.column_stack([back[:, :2], back[:, 2] + back[:, :2] @ [0.5, 0.5] - 0.5])
        patch = self._cv2.warpAffine(
            image, shift, (MESHED, MESHED), flags=self._cv2.INTER_LINEAR | self._cv2.WARP_INVERSE_MAP,
            borderMode=self._cv2.BORDER_REPLICATE,
        )  # fmt: skip
        values, score = self._mesh(patch.astype(np.float32) / 255)
        if values.size == 1:
            values, score = score, values
        mesh = values.reshape(FACE_POINTS, 3).astype(np.float64)
        points = np.column_stack([mesh[:, :2] @ back[:, :2].T + back[:, 2], mesh[:, 2] * scale])
        return points, float(1 / (1 + np.exp(-float(score.ravel()[0]))))


class _Net:
    """A model that is loaded."""

    def __init__(self, interpreter: Any) -> None:
        self._interpreter = interpreter
        interpreter.allocate_tensors()
        self._input = interpreter.get_input_details()[0]["index"]
        self._outputs = [each["index"] for each in interpreter.get_output_details()]

    def __call__(self, image: NDArray[np.float32]) -> Iterable[Any]:
        self._interpreter.set_tensor(self._input, image[None])
        self._interpreter.invoke()
        return [self._interpreter.get_tensor(each) for each in self._outputs]


def around(points: Floats) -> Crop:
    """The square around the points of a face."""
    across = points[LEFT_EYE, :2] - points[RIGHT_EYE, :2]
    angle = float(np.arctan2(across[1], across[0]))
    axes = Crop(np.zeros(2), 0.0, angle).axes
    turned = points[:, :2] @ axes.T
    low, high = turned.min(0), turned.max(0)
    return Crop(axes.T @ ((low + high) / 2), float((high - low).max()) * LARGER, angle)


def _mean(crops: Sequence[tuple[Crop, float]]) -> Crop:
    """A square between several, by their weights."""
    each = [[*crop.middle, crop.side, *crop.axes[0]] for crop, _ in crops]
    x, y, side, across, down = np.average(each, axis=0, weights=[weight for _, weight in crops]).tolist()
    return Crop(np.array([x, y]), side, float(np.arctan2(down, across)))


def _parts(image: Image) -> Iterator[tuple[int, int, int]]:
    """Squares that cover a picture, each with a half of the next: left, top, side. A far face is large in one."""
    height, width = image.shape[:2]
    side = min(width, height) * 2 // 3
    for top in range(0, height - side + 1, side // 2):
        for left in range(0, width - side + 1, side // 2):
            yield left, top, side


def _is_same(one: Crop, other: Crop) -> bool:
    """Tell whether two squares hold one face. What they have in common is taken as if both stood upright."""
    low = np.maximum(one.middle - one.side / 2, other.middle - other.side / 2)
    high = np.minimum(one.middle + one.side / 2, other.middle + other.side / 2)
    common = float(np.prod(np.maximum(high - low, 0)))
    return common > SAME * (one.side**2 + other.side**2 - common)
