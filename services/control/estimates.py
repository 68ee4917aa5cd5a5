"""Estimates of the simulated body, from the paths that it then moves along: without deviations they are exact."""

from itertools import pairwise

from schemas.behaviors import BlockBehavior, Speech, Wait
from schemas.body import BodyPose, Estimate, Phase
from schemas.faults import Fault
from schemas.units import Seconds
from services.control.body import sync_points
from services.control.choreography import Course, Point
from services.control.motion import SLOWEST, Path
from services.control.voice import Utterance


def infeasible(behavior: BlockBehavior, warning: str, fault: Fault) -> Estimate:
    return Estimate(behavior=behavior.id, feasible=False, fault=fault, warning=warning)


def spoken(behavior: Speech, utterance: Utterance, pose: BodyPose) -> Estimate:
    """The voice can wait at the marks between two words."""
    times = {"start": 0.0, **{mark.id: utterance.said_by(mark.position) for mark in behavior.marks}}
    times["end"] = utterance.seconds
    gaps = tuple(Point(mark.id, mark.id) for mark in behavior.marks if utterance.is_gap(mark.position))
    phases = _phases(behavior, times, gaps)
    return Estimate(behavior=behavior.id, feasible=True, parts=("voice",), phases=phases, pose_after=pose)


def waited(behavior: Wait, duration: Seconds, pose: BodyPose) -> Estimate:
    phases = _phases(behavior, {"start": 0.0, "end": duration}, (Point("end", "end"),))
    return Estimate(behavior=behavior.id, feasible=True, phases=phases, pose_after=pose)


def moved(behavior: BlockBehavior, course: Course, path: Path, pose: BodyPose) -> Estimate:
    """pose: on target."""
    is_gaze, is_arm = course.parts == ("head",), course.parts[0].endswith("_arm")
    return Estimate(
        behavior=behavior.id,
        feasible=True,
        parts=("head",) if course.parts == ("nod",) else course.parts,
        phases=_phases(behavior, path.marks, course.points, path.fastest, SLOWEST),
        head_degrees=course.degrees if is_gaze else 0.0,
        arm_degrees=course.degrees if is_arm else 0.0,
        ray=course.ray,
        pose_after=pose,
    )


def _phases(
    behavior: BlockBehavior,
    times: dict[str, Seconds],
    points: tuple[Point, ...] = (),
    fastest: float = 1.0,
    slowest: float = 1.0,
) -> tuple[Phase, ...]:
    """From each sync point to the next. A phase that ends where the body can hold has no upper limit."""
    held_with = {point.sync: point.held_with for point in points if point.held_with}
    phases = []
    for since, to in pairwise(sync_points(behavior)):
        natural = times[to] - times[since]
        longest = None if to in held_with else natural / slowest
        is_hold = held_with.get(to) == to
        phases.append(
            Phase(since=since, to=to, shortest=natural / fastest, natural=natural, longest=longest, hold=is_hold)
        )
    return tuple(phases)
