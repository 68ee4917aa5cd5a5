"""Outlines of many paths at once: how far the joints turn to the target, and whether the table is in the way.

A path is laid leg by leg, each sampled by itself. A question about many motions needs two numbers of each; here the
legs of all of them are the columns of one product. Where anything is as close to a limit as rounding, or the table is
in the way, there is no outline: that path has to be laid.
"""

from collections.abc import Sequence
from functools import cache
from itertools import accumulate

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.units import Degrees
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.aiming import UPRIGHT
from engage_hri.services.control.figure.tracks import ALONG, FINELY, limits_of
from engage_hri.services.control.motion.path import (
    LEAST,
    MARGIN,
    OUTSIDE,
    SAMPLES,
    SHARE,
    STRETCHES,
    Array,
    Leg,
)

Flags = NDArray[np.bool_]

DOUBT = 1e-10
"""Share of a limit, or metres above the table, within which rounding might decide."""
JOINTS = 3
"""Joints of an arm. A head has fewer; the others do not move."""
TRIES = 8
"""Times that are tried for a leg. One that needs still more time has to be laid."""
_POWERS = np.arange(6.0)
_VALUES = SAMPLES[:, None] ** _POWERS
_SPEEDS = _POWERS[1:] * SAMPLES[:, None] ** _POWERS[:5]
_CHANGES = _POWERS[2:] * _POWERS[1:5] * SAMPLES[:, None] ** _POWERS[:4]


class Asked(Struct, frozen=True):
    """A path from the angles `start`, at `speeds`, along `legs`.

    to_target: the number of legs to the target. is_arm: the table matters. trunk: where the trunk rests meanwhile.
    """

    start: tuple[float, ...]
    speeds: tuple[float, ...]
    legs: tuple[Leg, ...]
    to_target: int
    is_arm: bool
    parts: tuple[str, ...]
    trunk: tuple[float, ...] = UPRIGHT


def outlines(asked: Sequence[Asked]) -> list[Degrees | None]:
    """Degrees that the joints turn to the target; None: the path has to be laid, to know them or to be refused."""
    found: list[Degrees | None] = [None] * len(asked)
    if not (plain := [number for number, each in enumerate(asked) if _is_plain(each)]):
        return found
    # A leg between two angles and speeds, without acceleration at both, is a polynomial of degree five in the share
    # of its time: arrays of its terms are 6 x legs x joints.
    paths = [asked[number] for number in plain]
    ends = [leg for path in paths for leg in _ends(path)]
    first = [0, *accumulate(len(path.legs) for path in paths)]
    natural = np.maximum([leg.seconds for path in paths for leg in path.legs], LEAST)
    bounds = np.repeat(
        np.stack([_bounds(path.parts) for path in paths], axis=1), [len(path.legs) for path in paths], axis=1
    )
    terms, seconds, turned, is_sure = _laid(np.array(ends).swapaxes(0, 1), natural, bounds)
    is_clear = _are_clear(paths, first, terms, seconds)
    ways, sure = np.degrees(turned).tolist(), is_sure.tolist()
    for number, since, until, clear in zip(plain, first, first[1:], is_clear, strict=False):
        if clear and all(sure[since:until]):
            found[number] = sum(ways[since : since + asked[number].to_target])
    return found


def _is_plain(asked: Asked) -> bool:
    """True if each leg takes its time, or nothing moves at all."""
    return all(leg.seconds > 0.0 for leg in asked.legs) or (not asked.is_arm and _stays(asked))


def _stays(asked: Asked) -> bool:
    return not any(asked.speeds) and all(leg.goal == asked.start and not any(leg.velocity) for leg in asked.legs)


def _ends(asked: Asked) -> list[tuple[tuple[float, ...], ...]]:
    """Angles and speeds at the start and at the end of each leg, of as many joints as an arm has."""
    rest = (0.0,) * (JOINTS - len(asked.start))
    still = (0.0,) * JOINTS
    here, speeds = (*asked.start, *rest), (*asked.speeds, *rest)
    ends: list[tuple[tuple[float, ...], ...]] = []
    for leg in asked.legs:
        goal, out = (*leg.goal, *rest), (*leg.velocity, *rest) if leg.velocity else still
        ends.append((here, speeds, goal, out))
        here, speeds = goal, out
    return ends


def _are_clear(asked: Sequence[Asked], first: Sequence[int], terms: Array, seconds: Array) -> list[bool]:
    """True for each path that stays clear of the table, beyond doubt: all but those of arms do.

    first: the first of the legs of each path. terms, seconds: of all legs.
    """
    clear = [True] * len(asked)
    arms: dict[int, list[int]] = {}
    for number, each in enumerate(asked):
        if each.is_arm:
            arms.setdefault(len(each.legs), []).append(number)
    for count, numbers in arms.items():
        legs = np.array([first[number] for number in numbers])[:, None] + np.arange(count)
        above = _is_clear(terms[:, legs], seconds[legs], [asked[number] for number in numbers])
        for number, is_clear in zip(numbers, above.tolist(), strict=True):
            clear[number] = is_clear
    return clear


@cache
def _bounds(parts: tuple[str, ...]) -> Array:
    """Lowest and highest angles, speeds and accelerations of some parts' joints: 4 x joints."""
    each = [(limit.low, limit.high, limit.speed, limit.acceleration) for limit in limits_of(parts)]
    return np.array([*each, *[(-1.0, 1.0, 1.0, 1.0)] * (JOINTS - len(each))]).T


def _laid(ends: Array, natural: Array, bounds: Array) -> tuple[Array, Array, Array, Flags]:
    """Lay legs as `Path` does: each takes its natural time, or as many tenths more as the limits ask for.

    ends: angles and speeds at the start and at the end, bounds: of the joints; both 4 x legs x joints.
    Returns the terms of each leg, its seconds, how far all joints turn on it, and whether that is beyond doubt.
    """
    begin, into, goal, out = ends
    terms, seconds = np.zeros((6, *begin.shape)), natural.copy()  # of a leg that is not laid nothing counts
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


def _is_clear(terms: Array, seconds: Array, asked: Sequence[Asked]) -> Flags:
    """True for each path of an arm that stays clear of the table, beyond doubt.

    terms: 6 x paths x legs x joints. seconds: paths x legs. asked: of each path.
    """
    ends = seconds.cumsum(axis=1)
    is_upright = all(each.trunk == UPRIGHT for each in asked)
    at = (ALONG if is_upright else FINELY) * ends[:, -1:]
    leg = np.minimum((at[..., None] >= ends[:, None]).sum(axis=2), seconds.shape[1] - 1)
    path = np.arange(len(seconds))[:, None]
    share = np.clip((at - (ends - seconds)[path, leg]) / seconds[path, leg], 0.0, 1.0)
    angles = np.einsum("psk,kpsj->jps", share[..., None] ** _POWERS, terms[:, path, leg])
    if is_upright:
        # To which side the arm is makes no difference, the torso upright.
        return np.asarray((kinematics.above_table("left", angles) > DOUBT).all(axis=1))
    trunks = np.array([each.trunk for each in asked]).T[:, :, None]
    left, right = (kinematics.above_table(side, angles, trunks) for side in kinematics.SHOULDER)
    is_left = np.array([each.parts == ("left_arm",) for each in asked])[:, None]
    return np.asarray((np.where(is_left, left, right) > DOUBT).all(axis=1))
