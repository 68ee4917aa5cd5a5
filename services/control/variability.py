"""Deviations of the simulated body, drawn from a seed. Pure, and independent of the order of asking."""

import math
from hashlib import blake2b

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.config import Stall, Variability


def chance(seed: int, *what: str) -> float:
    """A number in [0, 1), always the same for the same arguments."""
    digest = blake2b("\0".join((str(seed), *what)).encode(), digest_size=8).digest()
    return int.from_bytes(digest) / 2**64


def normal(seed: int, *what: str) -> float:
    """A number from the standard normal distribution (Box and Muller), always the same for the same arguments."""
    radius = math.sqrt(-2.0 * math.log(1.0 - chance(seed, *what, "radius")))
    return radius * math.cos(2.0 * math.pi * chance(seed, *what, "angle"))


def rate(variability: Variability, parts: tuple[str, ...], behavior: str, occasion: int) -> float:
    """Speed at which `parts` do `behavior` the `occasion`-th time, 1 = as estimated. The slowest part decides."""
    noise = math.exp(-variability.noise * normal(variability.seed, behavior, str(occasion)))
    return noise / max((slow.factor for slow in variability.slow if slow.part in parts), default=1.0)


def stall(variability: Variability, parts: tuple[str, ...], behavior: BlockBehavior) -> Stall | None:
    """The stall that is due in `behavior`; None: none."""
    return next(
        (stall for stall in variability.stall if stall.part in parts and stall.behavior in ("", behavior.id)), None
    )


def overheated_part(variability: Variability, parts: tuple[str, ...]) -> str:
    """Name of the part whose motor fails; empty: none."""
    return next((part for part in parts if part in variability.overheated), "")


def is_lost(variability: Variability, message: int, at: Seconds) -> bool:
    """True if the `message`-th sync point message gets lost."""
    return variability.lost > 0.0 and chance(variability.seed, "lost", str(message), f"{at:.6f}") < variability.lost
