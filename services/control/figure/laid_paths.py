"""Paths of courses, each laid once: the same question to the body costs its thinking only the first time.

A path follows from where it starts, at which speed, its legs and its parts, and whether the table is in its way from
where the trunk is meanwhile, and from nothing else. All of that is the
key by which it is known, to the last bit: a body that has moved starts elsewhere, an entity that has moved makes
other legs, and their path is a new one. So nothing here can be out of date.
"""

from functools import lru_cache

import numpy as np

from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import tracks
from engage_hri.services.control.figure.course import Course
from engage_hri.services.control.motion.path import JointMotion, Leg, Path
from engage_hri.services.control.motion.track import Trunk

KEPT = 128
"""Paths that are kept, the latest used. A fragment asks for some ten, and its behaviors then move along them."""


def laid_path(start: JointMotion, course: Course, *, is_free: bool = False) -> Path:
    """The path along `course`. Raises Impossible.

    is_free: for a trunk that moves, without the ranges of joints (`tracks.limits_of`); who asks minds the table.
    """
    # What is on a place is planned such that it is clear there wherever the trunk is; its way home is laid anew.
    trunks = course.trunks if course.aim is None else course.trunks[:1]
    state = (np.asarray(each, dtype=np.float64).tobytes() for each in (start.q, start.v, start.a))
    path, is_blocked = _laid(*state, course.legs, course.parts, course.joints, is_free, trunks)
    if is_blocked and not is_free:
        raise Impossible("CANNOT_CREATE_BEHAVIOR", "the table is in the way of the arm")
    return path


@lru_cache(KEPT)
def _laid(
    q: bytes,
    v: bytes,
    a: bytes,
    legs: tuple[Leg, ...],
    parts: tuple[str, ...],
    joints: tuple[str, ...],
    is_free: bool,
    trunks: tuple[Trunk, ...],
) -> tuple[Path, bool]:
    """A path, and whether the table is in its way. q, v, a: the arrays of the state in which it starts."""
    start = JointMotion(*(np.frombuffer(each, dtype=np.float64) for each in (q, v, a)))
    path = Path(start, legs, tracks.limits_of(parts, is_free=is_free))
    return path, tracks.meets_table(path, joints, trunks)
