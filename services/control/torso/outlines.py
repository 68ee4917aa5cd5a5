"""Outlines of many paths at once: how far the joints turn to the target, and whether the table is in the way.

A path is laid leg by leg, each sampled by itself. A question about many motions needs two numbers of each; here the
legs of all of them are the columns of one product. Where anything is as close to a limit as rounding, or the table is
in the way, there is no outline: that path has to be laid.
"""

from collections.abc import Sequence
from functools import cache
from itertools import groupby
from operator import itemgetter

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.units import Degrees
from engage_hri.services.control.torso import kinematics
from engage_hri.services.control.torso.path import (
    LEAST,
    MARGIN,
    OUTSIDE,
    SAMPLES,
    SHARE,
    STRETCHES,
    Array,
    Leg,
)
from engage_hri.services.control.torso.tracks import limits_of

Flags = NDArray[np.bool_]

DOUBT = 1e-10
"""Share of a limit, or metres above the table, within which rounding might decide."""
TRIES = 8
"""Times that are tried for a leg. One that needs still more time has to be laid."""
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
    parts: tuple[str, ...]


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

    A leg between two angles and speeds, without acceleration at both, is a polynomial of degree five in the share of
    its time: arrays of its terms are 6 x legs x joints.
    """
    joints, count, to_target, is_arm = _shape(asked[0])
    legs = [leg for each in asked for leg in each.legs]
    still = (0.0,) * joints
    goal = np.array([leg.goal for leg in legs]).reshape(-1, count, joints)
    out = np.array([leg.velocity or still for leg in legs]).reshape(-1, count, joints)
    begin = np.concatenate((np.array([[each.start] for each in asked]), goal[:, :-1]), axis=1)
    into = np.concatenate((np.array([[each.speeds] for each in asked]), out[:, :-1]), axis=1)
    bounds = np.stack([_bounds(each.parts) for each in asked for _ in each.legs], axis=1)
    ends = np.stack((begin, into, goal, out)).reshape(4, -1, joints)
    natural = np.maximum(np.array([leg.seconds for leg in legs]), LEAST)
    terms, seconds, turned, is_laid = _laid(ends, natural, bounds)
    is_sure: Flags = np.all(is_laid.reshape(-1, count), axis=1)
    if is_arm:
        is_sure &= _is_clear(terms.reshape(6, -1, count, joints), seconds.reshape(-1, count))
    degrees = np.degrees(turned.reshape(-1, count)[:, :to_target].sum(axis=1)).tolist()
    return [each if sure else None for each, sure in zip(degrees, is_sure.tolist(), strict=True)]


@cache
def _bounds(parts: tuple[str, ...]) -> Array:
    """Lowest and highest angles, speeds and accelerations of some parts' joints: 4 x joints."""
    each = [(limit.low, limit.high, limit.speed, limit.acceleration) for limit in limits_of(parts)]
    return np.array(each).T


def _laid(ends: Array, natural: Array, bounds: Array) -> tuple[Array, Array, Array, Flags]:
    """Lay legs as `Path` does: each takes its natural time, or as many tenths more as the limits ask for.

    ends: angles and speeds at the start and at the end, bounds: of the joints; both 4 x legs x joints.
    Returns the terms of each leg, its seconds, how far all joints turn on it, and whether that is beyond doubt.
    """
    begin, into, goal, out = ends
    terms, seconds = np.empty((6, *begin.shape)), natural.copy()
    turned, is_sure = np.zeros(len(begin)), np.zeros(len(begin), dtype=np.bool_)
    left = np.arange(len(begin))
    for stretch in STRETCHES[:TRIES]:
        taken = natural[left] * stretch
        way, v, w = goal[left] - begin[left], into[left] * taken[:, None], out[left] * taken[:, None]
        third, fourth, fifth = 10 * way - 6 * v - 4 * w, 8 * v + 7 * w - 15 * way, 6 * way - 3 * v - 3 * w
        tried = np.stack((begin[left], v, np.zeros_like(v), third, fourth, fifth))
        columns = tried.reshape(6, -1)
        values = (_VALUES @ columns).reshape(-1, *way.shape)
        excess = _excess(values, columns, taken, bounds[:, left])
        good = excess < -DOUBT
        done = left[good]
        terms[:, done], seconds[done], is_sure[done] = tried[:, good], taken[good], True
        turned[done] = np.abs(np.diff(values[:, good], axis=0)).sum(axis=(0, 2))
        left = left[excess > DOUBT]
        if not left.size:
            break
    return terms, seconds, turned, is_sure


def _excess(values: Array, columns: Array, seconds: Array, bounds: Array) -> Array:
    """Excess of each leg over the limits of its joints, as `Path` has it; <= 0: all are kept."""
    shape, (low, high, fastest, hardest) = values.shape[1:], bounds
    speed = np.abs(_SPEEDS @ columns[1:]).max(axis=0).reshape(shape) / (seconds[:, None] * fastest)
    change = np.abs(_CHANGES @ columns[2:]).max(axis=0).reshape(shape)
    change = change / (seconds[:, None] ** 2 * hardest)
    outside = np.maximum(low - values.min(axis=0), values.max(axis=0) - high)
    outside = outside / (high - low) - OUTSIDE
    worst = np.maximum(np.maximum(speed / MARGIN - 1.0, change / (MARGIN * SHARE) - 1.0), outside)
    return np.asarray(worst.max(axis=1))


def _is_clear(terms: Array, seconds: Array) -> Flags:
    """True for each path of an arm that stays clear of the table, beyond doubt.

    terms: 6 x paths x legs x joints. seconds: paths x legs.
    """
    ends = seconds.cumsum(axis=1)
    at = ALONG * ends[:, -1:]
    leg = np.minimum((at[..., None] >= ends[:, None]).sum(axis=2), seconds.shape[1] - 1)
    path = np.arange(len(seconds))[:, None]
    share = np.clip((at - (ends - seconds)[path, leg]) / seconds[path, leg], 0.0, 1.0)
    angles = np.einsum("psk,kpsj->jps", share[..., None] ** _POWERS, terms[:, path, leg])
    return np.asarray((kinematics.above_table(*angles) > DOUBT).all(axis=1))
