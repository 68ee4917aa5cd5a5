"""Answers to questions for postures alone: what a motion comes to, without its phases. Many of them at once."""

from collections.abc import Sequence

from msgspec import Struct

from engage_hri.schemas.body import Estimate, EstimateItem
from engage_hri.schemas.world import World
from engage_hri.services.control.torso import choreography
from engage_hri.services.control.torso.course import Course, Impossible, Situation, angles
from engage_hri.services.control.torso.estimates import infeasible, is_arm, is_gaze, poses, posture_estimate
from engage_hri.services.control.torso.moving import Torso
from engage_hri.services.control.torso.outlines import Asked, outlines
from engage_hri.services.runtime.steps import Steps, portions

AT_ONCE = 16
"""Questions that are worked on between two pauses: about a millisecond."""
ELEMENTS = 32
"""Elements that a question counts for (see `steps`)."""


class _Open(Struct, frozen=True):
    """A motion whose degrees are still to be found. number: of the question."""

    number: int
    course: Course
    situation: Situation
    asked: Asked


def postures(torso: Torso, items: Sequence[EstimateItem], world: World) -> Steps[list[Estimate]]:
    """Estimate each motion by itself, as `Torso.estimate` does but for the phases, with pauses.

    torso: one whose clock stands still.
    """
    told: list[Estimate] = []
    for portion in portions(items, AT_ONCE):
        told += _told(torso, portion, world)
        yield ELEMENTS * len(portion)
    return told


def _told(torso: Torso, items: Sequence[EstimateItem], world: World) -> list[Estimate]:
    told: dict[int, Estimate] = {}
    opened: list[_Open] = []
    here = torso.situation(world)
    for number, item in enumerate(items):
        try:
            made = _opened(torso, number, item, here)
        except Impossible as impossible:
            told[number] = infeasible(item.behavior, impossible)
        else:
            opened += [made] if made is not None else []
    for each, degrees in zip(opened, outlines([each.asked for each in opened]), strict=True):
        if degrees is not None:
            behavior = items[each.number].behavior
            told[each.number] = posture_estimate(
                behavior, each.course, degrees, poses(each.course, each.situation.pose)
            )
    return [told.get(number) or torso.estimate(item.behavior, item.pose, world) for number, item in enumerate(items)]


def _opened(torso: Torso, number: int, item: EstimateItem, here: Situation) -> _Open | None:
    """Plan a motion; None: only its path says what it comes to. Raises Impossible."""
    situation = here if item.pose is None else torso.placed(here, item.pose)
    course = choreography.plan(item.behavior, situation)
    to_target = next((count for count, leg in enumerate(course.legs, 1) if ("stroke", 1.0) in leg.marks), 0)
    if not to_target or not (is_gaze(course) or is_arm(course)):
        return None
    start, speeds = angles(course.joints, situation.pose), (0.0,) * len(course.joints)
    if item.pose is None and not torso.misbelieved:
        state = torso.start(course)
        if torso.is_carried(course) or state.a.any():
            return None
        start, speeds = tuple(state.q.tolist()), tuple(state.v.tolist())
    legs = course.legs if is_arm(course) else course.legs[:to_target]
    asked = Asked(start, speeds, legs, to_target, is_arm(course), course.parts)
    return _Open(number, course, situation, asked)
