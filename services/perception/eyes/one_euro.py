"""One-euro filter: the slower a value changes the more it is smoothed. Casiez, Roussel and Vogel, CHI 2012. Pure.

A head that stands shakes in pictures by a degree or two, which reads as looks to and fro; a head that turns must be
told at once, or every look begins late. So the cutoff of a low-pass grows with the speed.
"""

from math import pi

import numpy as np

from engage_hri.schemas.units import Seconds
from engage_hri.services.perception.eyes.looking import Floats


class OneEuro:
    """A filter of some values that belong together. rest: cutoff while they stand, Hz. swift: by how many Hz it grows
    with each unit a second, of their speed together."""

    SPEED = 1.0
    """Cutoff for the speed itself, Hz, as the authors have it."""

    def __init__(self, rest: float, swift: float) -> None:
        self._rest, self._swift = rest, swift
        self._at: Seconds | None = None
        self._value, self._speed = np.zeros(0), np.zeros(0)

    def feed(self, value: Floats, at: Seconds) -> Floats:
        """Take values at an instant later than the last ones. Returns them smoothed."""
        if self._at is None:
            self._at, self._value, self._speed = at, value, np.zeros_like(value)
            return value
        past = at - self._at
        self._speed = self._speed + _share(self.SPEED, past) * ((value - self._value) / past - self._speed)
        cutoff = self._rest + self._swift * float(np.linalg.norm(self._speed))
        self._at, self._value = at, self._value + _share(cutoff, past) * (value - self._value)
        return self._value


def _share(cutoff: float, past: Seconds) -> float:
    """Share of a new value that is taken after some time."""
    return 1 / (1 + 1 / (2 * pi * cutoff * past))
