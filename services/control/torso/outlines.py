"""Outlines of many paths at once: how far the joints turn to the target, and whether the table is in the way.

A path is laid leg by leg, each sampled by itself. A question about many motions needs two numbers of each; here the
legs of all of them are the columns of one product. Where a leg would have to be longer than it likes, or anything is
as close to a limit as rounding, there is no outline: that path has to be laid.
"""

from collections.abc import Sequence
from itertools import groupby
from operator import itemgetter

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.body import JointLimit
from engage_hri.schemas.units import Degrees
from engage_hri.services.control.torso import kinematics
from engage_hri.services.control.torso.path import LEAST, MARGIN, SAMPLES, SHARE, Array, Leg

Flags = NDArray[np.bool_]

DOUBT = 1e-9
"""Share of a limit, or metres above the table, within which rounding might decide."""
ALONG = np.linspace(0.0, 1.0, 17)
"""Shares of a path's length at which it is held against the table, as `tracks.meets_table` does."""
_POWERS = np.arange(6.0)
_VALUES = SAMPLES[:, None] ** _POWERS
_SPEEDS = _POWERS[1:] * SAMPLES[:, None] ** _POWERS[:5]
_CHANGES = _POWERS[2:] * _POWERS[1:5] * SAMPLES[:, None] ** _POWERS[:4]


class Asked(Struct, frozen=True):
    """A path from the angles `start`, at `speeds`, along `legs`.

    to_target: the number of legs to the target. is_arm: the table matters.
    """

    start: tuple[float, ...]
    speeds: tuple[float, ...]
    legs: tuple[Leg, ...]
    to_target: int
    is_arm: bool
    limits: tuple[JointLimit, ...]


def outlines(asked: Sequence[Asked]) -> list[Degrees | None]:
    """Degrees that the joints turn to the target; None: the path has to be laid, to know them or to be refused."""
    found: list[Degrees | None] = [None] * len(asked)
    shapes = sorted((_shape(each), number) for number, each in enumerate(asked) if _is_plain(each))
    for _, group in groupby(shapes, itemgetter(0)):
        numbers = [number for _, number in group]
        for number, degrees in zip(numbers, _alike([asked[number] for number in numbers]), strict=True):
            found[number] = degrees
    return found


def _is_plain(asked: Asked) -> bool:
    """True if each leg takes its time, or nothing moves at all."""
    return all(leg.seconds > 0.0 for leg in asked.legs) or (not asked.is_arm and _stays(asked))


def _stays(asked: Asked) -> bool:
    return not any(asked.speeds) and all(leg.goal == asked.start and not any(leg.velocity) for leg in asked.legs)


def _shape(asked: Asked) -> tuple[int, int, int, bool]:
    return len(asked.start), len(asked.legs), asked.to_target, asked.is_arm


def _alike(asked: Sequence[Asked]) -> list[Degrees | None]:
    """Outlines of paths with as many joints and legs.

    Arrays below are paths x legs x joints. A leg from q with speed v to one with speed w, both without acceleration,
    is a polynomial of degree five in the share of its time.
    """
    joints, count, to_target, is_arm = _shape(asked[0])
    legs = [leg for each in asked for leg in each.legs]
    still = (0.0,) * joints
    goal = np.array([leg.goal for leg in legs]).reshape(-1, count, joints)
    out = np.array([leg.velocity or still for leg in legs]).reshape(-1, count, joints)
    seconds = np.maximum(np.array([leg.seconds for leg in legs]), LEAST).reshape(-1, count, 1)
    begin = np.concatenate((np.array([each.start for each in asked])[:, None], goal[:, :-1]), axis=1)
    into = np.concatenate((np.array([each.speeds for each in asked])[:, None], out[:, :-1]), axis=1)
    way, v, w = goal - begin, into * seconds, out * seconds
    terms = np.stack(
        (begin, v, np.zeros_like(v), 10 * way - 6 * v - 4 * w, -15 * way + 8 * v + 7 * w, 6 * way - 3 * v - 3 * w)
    )
    columns = terms.reshape(6, -1)
    values = _VALUES @ columns
    limits = [each.limits for each in asked]
    is_sure = _keeps(values, columns, seconds, limits, begin.shape)
    turned = np.abs(np.diff(values, axis=0)).sum(axis=0).reshape(begin.shape)[:, :to_target].sum(axis=(1, 2))
    if is_arm:
        is_sure = is_sure & _is_clear(terms, seconds[..., 0])
    degrees = np.degrees(turned).tolist()
    return [each if sure else None for each, sure in zip(degrees, is_sure.tolist(), strict=True)]


def _keeps(
    values: Array, columns: Array, seconds: Array, limits: Sequence[Sequence[JointLimit]], shape: tuple[int, ...]
) -> Flags:
    """True for each path all of whose legs keep the limits of their joints at their natural pace, beyond doubt."""
    low, high, speed, acceleration = (
        np.array([[getattr(limit, name) for limit in each] for each in limits])[:, None]
        for name in ("low", "high", "speed", "acceleration")
    )
    lowest, highest = values.min(axis=0).reshape(shape), values.max(axis=0).reshape(shape)
    fastest = np.abs(_SPEEDS @ columns[1:]).max(axis=0).reshape(shape) / (seconds * speed)
    hardest = np.abs(_CHANGES @ columns[2:]).max(axis=0).reshape(shape) / (seconds**2 * acceleration)
    keeps = (
        (fastest < MARGIN - DOUBT)
        & (hardest < MARGIN * SHARE - DOUBT)
        & (np.maximum(low - lowest, highest - high) < DOUBT / 2 * (high - low))
    )
    return np.asarray(keeps.all(axis=(1, 2)))


def _is_clear(terms: Array, seconds: Array) -> Flags:
    """True for each path of an arm that stays clear of the table, beyond doubt. seconds: paths x legs."""
    ends = seconds.cumsum(axis=1)
    at = ALONG * ends[:, -1:]
    leg = np.minimum((at[..., None] >= ends[:, None]).sum(axis=2), seconds.shape[1] - 1)
    path = np.arange(len(seconds))[:, None]
    share = np.clip((at - (ends - seconds)[path, leg]) / seconds[path, leg], 0.0, 1.0)
    angles = np.einsum("psk,kpsj->jps", share[..., None] ** _POWERS, terms[:, path, leg])
    return np.asarray((kinematics.above_table(*angles) > DOUBT).all(axis=1))
