"""Answers to questions for postures alone: what a motion comes to, without its phases. Many of them at once."""

from collections.abc import Sequence

from msgspec import Struct

from engage_hri.schemas.behaviors import Gaze, Pointing
from engage_hri.schemas.body import Estimate, EstimateItem
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import choreography
from engage_hri.services.control.figure.course import Course, Situation, angles
from engage_hri.services.control.figure.estimates import is_arm, is_gaze, poses, posture_estimate
from engage_hri.services.control.torso.outlines import Asked, outlines
from engage_hri.services.control.torso.torso import Torso
from engage_hri.services.runtime.steps import Steps, portions

AT_ONCE = 64
"""Motions whose outlines are drawn in one go: about a millisecond."""
FEW = 3
"""Motions from which on outlines are worth drawing: fewer paths are laid as soon."""
ELEMENTS, OF_AN_OUTLINE, OF_A_PATH = 40, 12, 256
"""Elements that the planning of a motion counts for (see `runtime.steps`), its outline, and its path."""

State = tuple[tuple[float, ...], tuple[float, ...]]
"""Angles and speeds of joints."""


class _Open(Struct, frozen=True):
    """A motion whose degrees are still to be found. number: of the question."""

    number: int
    course: Course
    situation: Situation
    asked: Asked


def is_brief(item: EstimateItem) -> bool:
    """True if no phases are asked, of a motion that can be known without its path."""
    return bool(item.only) and isinstance(item.behavior, Gaze | Pointing)


def postures(torso: Torso, items: Sequence[EstimateItem], world: World) -> Steps[list[Estimate]]:
    """Estimate each motion by itself, as `Torso.estimate` does but for the phases, with pauses.

    torso: one whose clock stands still. items: brief ones.
    """
    questions = _Questions(torso, world)
    told: dict[int, Estimate] = {}
    opened: list[_Open] = []
    for number, item in enumerate(items if len(items) >= FEW else ()):
        try:
            made = questions.opened(number, item)
        except Impossible as impossible:
            told[number] = impossible.estimate(item.behavior)
        else:
            opened += [made] if made is not None else []
        yield ELEMENTS
    for portion in portions(opened, AT_ONCE):
        for each, degrees in zip(portion, outlines([each.asked for each in portion]), strict=True):
            if degrees is not None:
                item = items[each.number]
                both = None if item.only == "degrees" else poses(each.course, each.situation.pose)
                told[each.number] = posture_estimate(item.behavior, each.course, degrees, both)
        yield OF_AN_OUTLINE * len(portion)
    for number, item in enumerate(items):
        if number not in told:
            told[number] = torso.estimate(item.behavior, item.pose, world)
            yield OF_A_PATH
    return [told[number] for number in range(len(items))]


class _Questions:
    """Questions of one instant. Where the parts are now is looked up once."""

    def __init__(self, torso: Torso, world: World) -> None:
        self._torso = torso
        self._here = torso.situation(world)
        self._states: dict[tuple[str, ...], State | None] = {}

    def opened(self, number: int, item: EstimateItem) -> _Open | None:
        """Plan a motion; None: only its path says what it comes to. Raises Impossible."""
        situation = self._here if item.pose is None else self._torso.placed(self._here, item.pose)
        course = choreography.plan(item.behavior, situation)
        to_target = next((count for count, leg in enumerate(course.legs, 1) if ("stroke", 1.0) in leg.marks), 0)
        if not to_target or not (is_gaze(course) or is_arm(course)) or len(course.trunks) > 1:
            return None
        if item.pose is None and not self._torso.misbelieved:
            state = self._state(course)
        else:
            state = angles(course.joints, situation.pose), (0.0,) * len(course.joints)
        if state is None:
            return None
        legs = course.legs if is_arm(course) else course.legs[:to_target]
        return _Open(
            number, course, situation, Asked(*state, legs, to_target, is_arm(course), course.parts, course.trunks[0])
        )

    def _state(self, course: Course) -> State | None:
        """Angles and speeds of the parts now; None: the trunk carries them, or they are about to change speed."""
        if self._torso.is_carried(course):
            return None
        if course.parts not in self._states:
            state = self._torso.start(course)
            plain = None if state.a.any() else (tuple(state.q.tolist()), tuple(state.v.tolist()))
            self._states[course.parts] = plain
        return self._states[course.parts]
