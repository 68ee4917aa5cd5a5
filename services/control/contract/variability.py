"""Deviations of the simulated body, drawn from a seed. Pure, and independent of the order of asking."""

import math
from hashlib import blake2b

from msgspec import Struct

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body_faults import BodyFault, amount_of
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.config import Variability


class Deviations(Struct, frozen=True):
    """The faults that are on, by the configuration or since, and the seed of their chance."""

    seed: int = 0
    faults: tuple[BodyFault, ...] = ()

    def of(self, kind: str, behavior: str = "", parts: tuple[str, ...] = ()) -> list[tuple[BodyFault, float]]:
        """Faults of a kind that concern this behavior and one of these parts, each with its amount, or 0.

        behavior, parts: empty: whichever.
        """
        return [
            (fault, amount_of(fault) or 0.0)
            for fault in self.faults
            if fault.kind == kind
            and (not behavior or fault.behavior in ("", behavior))
            and (not parts or not fault.part or fault.part in parts)
        ]


def configured(variability: Variability) -> Deviations:
    """Say a section `control.variability` in faults."""
    faults = [BodyFault(kind="slow", part=slow.part, amount=slow.factor) for slow in variability.slow]
    faults += [
        BodyFault(kind="stall", part=stall.part, amount=stall.seconds, before=stall.before, behavior=stall.behavior)
        for stall in variability.stall
    ]
    faults += [BodyFault(kind="overheated", part=part) for part in variability.overheated]
    faults += [BodyFault(kind="displaced", part=it.joint, amount=it.angle) for it in variability.displaced]
    faults += [BodyFault(kind="miscalibrated", part=it.part, amount=it.angle) for it in variability.miscalibrated]
    if variability.noise:
        faults.append(BodyFault(kind="noise", amount=variability.noise))
    if variability.mute:
        faults.append(BodyFault(kind="mute" if variability.mute == "silent" else "voiceless"))
    if variability.lost:
        faults.append(BodyFault(kind="lost", amount=variability.lost))
    return Deviations(variability.seed, tuple(faults))


def chance(seed: int, *what: str) -> float:
    """A number in [0, 1), always the same for the same arguments."""
    digest = blake2b("\0".join((str(seed), *what)).encode(), digest_size=8).digest()
    return int.from_bytes(digest) / 2**64


def normal(seed: int, *what: str) -> float:
    """A number from the standard normal distribution (Box and Muller), always the same for the same arguments."""
    radius = math.sqrt(-2.0 * math.log(1.0 - chance(seed, *what, "radius")))
    return radius * math.cos(2.0 * math.pi * chance(seed, *what, "angle"))


def rate(deviations: Deviations, parts: tuple[str, ...], behavior: str, occasion: int) -> float:
    """Speed at which `parts` do `behavior` the `occasion`-th time, 1 = as estimated. The slowest part decides."""
    noise = sum(amount for _, amount in deviations.of("noise", behavior))
    slow = max((factor for _, factor in deviations.of("slow", behavior, parts)), default=1.0)
    return math.exp(-noise * normal(deviations.seed, behavior, str(occasion))) / slow if noise else 1.0 / slow


def stall(deviations: Deviations, parts: tuple[str, ...], behavior: BlockBehavior) -> BodyFault | None:
    """The stall that is due in `behavior`; None: none."""
    return next((fault for fault, _ in deviations.of("stall", behavior.id, parts)), None)


def overheating(deviations: Deviations, parts: tuple[str, ...], behavior: BlockBehavior) -> BodyFault | None:
    """The fault by which a motor gives out in `behavior`; None: none."""
    return next((fault for fault, _ in deviations.of("overheated", behavior.id, parts)), None)


def is_lost(deviations: Deviations, message: int, at: Seconds) -> bool:
    """True if the `message`-th sync point message gets lost."""
    share = max((share for _, share in deviations.of("lost")), default=0.0)
    return share > 0.0 and chance(deviations.seed, "lost", str(message), f"{at:.6f}") < share
