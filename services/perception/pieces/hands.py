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
SHADOW, DARKEST = 0.045, 0.35
"""Share up to which all colors are darker alike in a shadow, and the darkest that it is."""
SMALLEST = 0.002
"""Square metres of a hand with its arm over the table."""
REACHES: Meters = 0.06
"""Distance from the edge that it has come at least: who leans on the edge does not reach for anything."""
RIM: Meters = 0.02
"""Width of the edge."""
AROUND = np.ones((5, 5), np.uint8)
"""Coarse pixels around one to which it reaches, smoothed as the picture is."""
LONG: Meters = 0.09
"""Distance from the longest finger's tip to where the hand ends."""
WIDE: Meters = 0.2
"""Width over which light changes alike."""
SMOOTH = 1.5
"""Coarse pixels over which colors are compared in what may be a shadow: it is dark, and noise is not."""
FINE = 2.0
"""Pixels over which a picture is smoothed where it is told what is hand and what is the table beside it."""


class HandFinder:
    """Finds hands in pictures that follow one another, laid out flat.

    is_table: where the table is. low: place of the first pixel; step: size of one. eye: place of the camera over the
    table, and height above the plane that is laid out, which is that of pieces of some thickness.
    """

    def __init__(
        self, is_table: Any, low: Floats, step: Meters, eye: Floats, height: Meters, thickness: Meters
    ) -> None:
        size = is_table.shape[1] // COARSE, is_table.shape[0] // COARSE
        self._size, self._low, self._step = size, low, step * COARSE
        self._eye, self._sunk = eye, (height + thickness - HEIGHT) / height
        self._is_table = cv2.resize(is_table, size, interpolation=cv2.INTER_AREA) > 0
        wide = 2 * round(RIM / self._step) + 1
        inner = cv2.erode(self._is_table.astype(np.uint8), np.ones((wide, wide), np.uint8), borderValue=0)
        self._rim = self._is_table & (inner == 0)
        self._before: Any = None
        """The table as it was without hands, in the light that there is now. A hand that is there from the first
        picture on is seen when it moves."""
        self._bare: Any = None
        """The same, were nothing on it."""
        self._arms: list[Any] = []
        """What comes in over the edge in this picture."""

    def cover(self, flat: Any, bare: Any, is_piece: Any) -> Any:
        """Find which pixels of the next picture hands and arms cover.

        flat: laid out, 0 where it sees nothing. bare: the same, as the bare table would look in the light around each
        pixel. is_piece: which pixels have the color of a piece.
        """
        now, lit = (self._coarse(each) for each in (flat, bare))
        is_seen = self._is_table & (self._coarse((flat[..., 1] > 0).astype(np.float32)) > 0.99)
        if self._before is None:
            self._before, self._bare = now, lit
        change = self._change(now, is_seen)
        self._before, self._bare = self._before * change, self._bare * change
        noise = float(np.median(_away(now, self._before).max(2)[is_seen])) if is_seen.any() else 0.0
        changed = self._changed(now, is_seen, max(DIFFERS, NOISY * noise))
        count, numbers, _, _ = cv2.connectedComponentsWithStats(changed)
        self._arms = [numbers == each for each in range(1, count) if ((numbers == each) & self._rim).any()]
        covered = np.any([*self._arms, np.zeros(changed.shape, bool)], 0).astype(np.uint8)
        free = cv2.dilate(covered, AROUND) == 0
        self._before[free] = now[free]  # not what only begins to come in: it would become the table
        if not self._arms:
            self._bare = lit
            return np.zeros(flat.shape[:2], bool)
        fine = self._finely(flat, covered, max(DIFFERS, NOISY * noise)) & ~is_piece
        # Around a piece that is held colors mix: a line that is thinner than any finger.
        return cv2.morphologyEx(fine.astype(np.uint8), cv2.MORPH_OPEN, AROUND) > 0

    def hands(self, tops: Any) -> list[SpottedHand]:
        """Tell hands at the ends of these arms, without what they hold. tops: pixels of the pieces that are seen."""
        holds = cv2.dilate((self._coarse(tops) > DIFFERS).astype(np.uint8), AROUND) > 0
        large = (own for own in self._arms if own.sum() * self._step**2 >= SMALLEST)
        found = [self._hand(own & (~holds | self._rim)) for own in large]
        return [each for each in found if math.dist((each.x, each.y), (each.from_x, each.from_y)) >= REACHES]

    def _coarse(self, value: Any) -> Any:
        return cv2.GaussianBlur(cv2.resize(value, self._size, interpolation=cv2.INTER_AREA), (0, 0), 1.0)

    def _change(self, now: Any, is_seen: Any) -> Any:
        """Tell how the light has changed since the picture before, by place and color.

        Of what has changed by much else than the rest it is not the light. Over `WIDE` it changes little: what is
        learned from near a hand is the light of a hand, for skin may look like wood.
        """
        ratio = now / np.maximum(self._before, 1)
        overall = np.median(ratio[is_seen], 0) if is_seen.any() else np.ones(3, np.float32)
        near = is_seen & (np.abs(ratio / overall - 1).max(2) < DIFFERS)
        weight = near.astype(np.float32)[..., None]
        total = cv2.GaussianBlur(np.concatenate([ratio * weight, weight], 2), (0, 0), WIDE / self._step)
        own = 0.02
        return (total[..., :3] + own * overall) / (total[..., 3:] + own)

    def _changed(self, now: Any, is_seen: Any, least: float) -> Any:
        """Find where something is on the table that was not there before, and is no shadow."""
        soft, before = (cv2.GaussianBlur(each, (0, 0), SMOOTH) for each in (now, self._before))
        differs = is_seen & (_away(now, self._before).max(2) > least) & ~_is_shadow(soft, before)
        differs &= _away(now, self._bare).max(2) >= least  # what lay there was taken away
        return cv2.morphologyEx(differs.astype(np.uint8), cv2.MORPH_CLOSE, AROUND)

    def _finely(self, flat: Any, coarse: Any, least: float) -> Any:
        """Find which pixels of what comes in are not the table beside it: what is coarse reaches beyond its edges."""
        size = flat.shape[1::-1]
        seen, bare = cv2.GaussianBlur(flat, (0, 0), FINE), cv2.resize(self._bare, size)
        is_table = (_away(seen, bare).max(2) < least) | _is_shadow(seen, bare)
        return (cv2.resize(coarse, size, interpolation=cv2.INTER_NEAREST) > 0) & ~is_table

    def _hand(self, own: Any) -> SpottedHand:
        """The hand at the end of what comes in over the edge."""
        places = (np.argwhere(own) + 0.5) * self._step + self._low
        entry = (np.argwhere(own & self._rim) + 0.5) * self._step + self._low
        comes = entry.mean(0)
        away = np.linalg.norm(places - comes, axis=1)
        middle = places[np.linalg.norm(places - places[away.argmax()], axis=1) < LONG].mean(0)
        x, y = self._eye + self._sunk * (middle - self._eye)
        return SpottedHand(float(x), float(y), float(comes[0]), float(comes[1]))


def _away(now: Any, before: Any) -> Any:
    """Share by which each color differs."""
    return np.abs(now - before) / np.maximum(np.maximum(now, before), 5)


def _is_shadow(now: Any, before: Any) -> Any:
    """Tell where all colors are darker alike.

    What there is little of, as of blue in orange, counts as little: noise makes more of it, not less.
    """
    shade = (now * before).sum(2) / np.maximum((before * before).sum(2), 1)
    differs = np.abs(now - shade[..., None] * before).max(2)
    return (shade < 1) & (shade > DARKEST) & (differs < SHADOW * shade * before.max(2))
