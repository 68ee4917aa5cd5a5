"""Checks of the numbers in a configuration, for its `__post_init__`. Each raises ValueError with field and value.

place: prefix of the field's name in the message: `simulation.`.
"""

from collections.abc import Callable, Iterable
from math import isfinite


def positive(config: object, names: Iterable[str], place: str = "") -> None:
    _require(config, names, place, lambda value: value > 0, "be positive")


def not_negative(config: object, names: Iterable[str], place: str = "") -> None:
    _require(config, names, place, lambda value: value >= 0, "not be negative")


def shares(config: object, names: Iterable[str], place: str = "") -> None:
    _require(config, names, place, lambda value: 0 <= value <= 1, "be in 0..1")


def inner_shares(config: object, names: Iterable[str], place: str = "") -> None:
    """Require numbers between 0 and 1, without the two ends."""
    _require(config, names, place, lambda value: 0 < value < 1, "be in (0, 1)")


def _require(config: object, names: Iterable[str], place: str, holds: Callable[[float], bool], rule: str) -> None:
    for name in names:
        value = getattr(config, name)
        if not isfinite(value):
            raise ValueError(f"{place}{name} must be a finite number, not {value}")
        if not holds(value):
            raise ValueError(f"{place}{name} must {rule}, not {value}")
