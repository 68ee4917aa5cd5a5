"""Times that a plan asks of a behavior: where it is to wait, and for which points it is to hurry or dawdle. Pure."""

from collections.abc import Container, Mapping
from itertools import pairwise

from engage_hri.schemas.units import Seconds
from engage_hri.services.control.figure.course import Course
from engage_hri.services.control.motion.path import Path

START = "start"
"""Name of the first sync point."""
HURRIED: Seconds = 0.0005
"""Seconds by which a point comes too early for a behavior that does not hurry."""


def told_apart(
    course: Course, path: Path, times: Mapping[str, Seconds], passing: Container[str]
) -> tuple[dict[str, Seconds], dict[str, Seconds]]:
    """Times of hold points at which it has to wait, and of points for which it hurries or dawdles.

    It hurries to a hold point if it would come there later by itself.
    """
    waits: dict[str, Seconds] = {}
    forced: dict[str, Seconds] = {}
    before, at = START, times[START]
    for point in course.points[1:]:
        if point.sync in times:
            natural = path.marks[point.sync] - path.marks[before]
            is_hurried = times[point.sync] - at < natural - HURRIED
            if point.held_with and not is_hurried and point.sync not in passing:
                waits[point.held_with] = times[point.sync]
            else:
                forced[point.sync] = times[point.sync]
            before, at = point.sync, times[point.sync]
    return waits, forced


def paced_by(
    course: Course, path: Path, times: Mapping[str, Seconds], forced: Mapping[str, Seconds]
) -> dict[str, Seconds]:
    """Instants for all points up to the last that is forced: the others are asked for as they come by themselves."""
    paced: dict[str, Seconds] = {}
    at = times[START]
    for since, to in pairwise([point.sync for point in course.points]):
        if len(forced.keys() & paced.keys()) == len(forced):
            break
        at = paced[to] = times.get(to, at + path.marks[to] - path.marks[since])
    return paced
