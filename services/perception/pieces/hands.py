"""Hands over a table in pictures of it: what comes in over its edge, and was not there before. Pure.

Skin may look like wood and a sleeve like anything, so a hand is not known by its color, nor by its form, which a
piece that it holds changes. It is known by where it comes from: something differs from the table as it was, and that
goes on to the edge. A shadow differs too, but alike in all colors. Pieces come and go: what lies by itself is
no hand, and is part of the table from then on; under a hand the table is remembered as it was.
"""

import math
from typing import Any

import cv2
import numpy as np

from engage_hri.schemas.units import Meters
from engage_hri.services.perception.eyes.looking import Floats
from engage_hri.services.perception.pieces.spotting import HEIGHT, SpottedHand

COARSE = 4
"""Pixels of the table that are judged together, each way: half a centimetre is fine enough for a hand."""
DIFFERS, NOISY = 0.1, 6.0
"""Share by which what has changed differs at least, and in multiples of what differs by noise."""
SHADOW = 1.06, 0.35
"""Ratio of colors up to which a change is one of brightness, and the darkest that a shadow is."""
SMALLEST = 0.002
"""Square metres of a hand with its arm over the table."""
REACHES: Meters = 0.06
"""Distance from the edge that it has come at least: who leans on the edge does not reach for anything."""
RIM: Meters = 0.02
"""Width of the edge."""
LONG: Meters = 0.09
"""Distance from the longest finger's tip to where the hand ends."""


class HandFinder:
    """Finds hands in pictures that follow one another, laid out flat.

    is_table: where the table is. low: place of the first pixel; step: size of one. eye: place of the camera over the
    table, and height above the plane that is laid out.
    """

    def __init__(self, is_table: Any, low: Floats, step: Meters, eye: Floats, height: Meters) -> None:
        size = is_table.shape[1] // COARSE, is_table.shape[0] // COARSE
        self._size, self._low, self._step = size, low, step * COARSE
        self._eye, self._sunk = eye, (height - HEIGHT) / height
        self._is_table = cv2.resize(is_table, size, interpolation=cv2.INTER_AREA) > 0
        wide = 2 * round(RIM / self._step) + 1
        inner = cv2.erode(self._is_table.astype(np.uint8), np.ones((wide, wide), np.uint8), borderValue=0)
        self._rim = self._is_table & (inner == 0)
        self._before: Any = None
        """The table as it was without hands, as shares of how it looks bare. A hand that is there from the first
        picture on is seen when it moves."""

    def find(self, shares: Any, seen: Any) -> tuple[list[SpottedHand], Any]:
        """Find the hands in the next picture. shares: of each pixel, of how the bare table would look there.

        seen: which pixels the picture has. Returns also which pixels hands and arms cover.
        """
        now = cv2.GaussianBlur(cv2.resize(shares, self._size, interpolation=cv2.INTER_AREA), (0, 0), 1.0)
        is_seen = self._is_table & (cv2.resize(seen, self._size, interpolation=cv2.INTER_AREA) == 1)
        if self._before is None:
            self._before = now
        changed = self._changed(now, is_seen)
        count, numbers, boxes, _ = cv2.connectedComponentsWithStats(changed)
        found, covered = [], np.zeros(changed.shape, np.uint8)
        for number in range(1, count):
            own = numbers == number
            if not (own & self._rim).any():
                continue
            covered |= own.astype(np.uint8)  # also what only begins to come in: else it would become the table
            if boxes[number, cv2.CC_STAT_AREA] * self._step**2 >= SMALLEST:
                hand = self._hand(own)
                if math.dist((hand.x, hand.y), (hand.from_x, hand.from_y)) >= REACHES:
                    found.append(hand)
        free = cv2.dilate(covered, np.ones((5, 5), np.uint8)) == 0
        self._before[free] = now[free]
        return found, cv2.resize(covered, shares.shape[1::-1], interpolation=cv2.INTER_NEAREST)

    def _changed(self, now: Any, is_seen: Any) -> Any:
        """Find where something is on the table that was not there before, and is no shadow."""
        ratio = now / np.maximum(self._before, 0.05)
        away = np.abs(now - self._before) / np.maximum(np.maximum(now, self._before), 0.05)
        most = away.max(2)
        noise = float(np.median(most[is_seen])) if is_seen.any() else 0.0
        low, high = ratio.min(2), ratio.max(2)
        alike, darkest = SHADOW
        is_shadow = (high < alike * low) & (high < 1) & (low > darkest)
        least = max(DIFFERS, NOISY * noise)
        is_bare = np.abs(now - 1).max(2) < least  # what lay there was taken away
        differs = is_seen & (most > least) & ~is_shadow & ~is_bare
        return cv2.morphologyEx(differs.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))

    def _hand(self, own: Any) -> SpottedHand:
        """The hand at the end of what comes in over the edge."""
        places = (np.argwhere(own) + 0.5) * self._step + self._low
        entry = (np.argwhere(own & self._rim) + 0.5) * self._step + self._low
        comes = entry.mean(0)
        away = np.linalg.norm(places - comes, axis=1)
        middle = places[np.linalg.norm(places - places[away.argmax()], axis=1) < LONG].mean(0)
        x, y = self._eye + self._sunk * (middle - self._eye)
        return SpottedHand(float(x), float(y), float(comes[0]), float(comes[1]))
