"""Where a head points when it attends to the robot, learned per person; and how sure a look is."""

import math
from random import Random

import pytest

from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.units import Degrees, Probability, Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.perceive.attending import FULL_ATTENTION, Attending, Offset, attention
from engage_hri.services.recognition.perceive.gaze_targets import GazeTargets
from tests.recognition.observations import ROBOT
from tests.recognition.raw import EYES, ROBOT_EYES, Watch, face, turned

TICK: Seconds = 0.05


class Head:
    """A head that is judged at each tick."""

    def __init__(self) -> None:
        self.attending = Attending()
        self.at: Seconds = 0.0

    def points(
        self, offset: Offset, *, seconds: Seconds, trembling: Degrees = 0.0, is_free: bool = True
    ) -> Probability:
        random = Random(1)
        much = 0.0
        for _ in range(round(seconds / TICK)):
            self.at += TICK
            left, up = (part + random.uniform(-trembling, trembling) for part in offset)
            much = self.attending.judge((left, up), self.at, is_free=is_free)
        return much

    def would(self, offset: Offset) -> Probability:
        """Judge an offset in passing."""
        self.at += TICK
        return self.attending.judge(offset, self.at, is_free=False)


@pytest.mark.parametrize(("angle", "much"), [(0.0, 1.0), (20.0, 1.0), (25.0, 0.5), (30.0, 0.0), (90.0, 0.0)])
def test_of_an_unknown_head_the_wide_cone_decides(angle: Degrees, much: Probability) -> None:
    assert attention(angle) == much
    assert Head().would((0.0, angle)) == much
    assert Head().would((-angle, 0.0)) == much


def test_a_head_that_keeps_still_beside_the_robot_attends_more_and_more() -> None:
    head = Head()

    courses = [head.points((0.0, 23.0), seconds=0.5, trembling=1.0) for _ in range(8)]

    assert courses[0] < 0.8
    assert courses == sorted(courses)
    assert courses[-1] == 1.0


def test_what_is_learned_makes_the_cone_narrower_but_for_the_side_of_the_habit() -> None:
    head = Head()
    head.points((0.0, 18.0), seconds=5.0, trembling=1.0)

    assert [head.would((0.0, up)) for up in (0.0, 9.0, 18.0, 25.0)] == [1.0] * 4
    assert head.would((18.0, 0.0)) == head.would((0.0, -18.0)) == 0.0
    assert head.would((0.0, 33.0)) == 0.0


@pytest.mark.parametrize(
    ("offset", "trembling", "is_free"),
    [((0.0, 27.0), 0.5, True), ((0.0, 15.0), 6.0, True), ((0.0, 15.0), 0.5, False)],
    ids=["far beside", "not still", "on something else"],
)
def test_what_is_not_surely_attention_teaches_nothing(offset: Offset, trembling: Degrees, is_free: bool) -> None:
    head = Head()
    head.points(offset, seconds=10.0, trembling=trembling, is_free=is_free)

    assert head.attending.habit == (0.0, 0.0)
    assert head.would((-18.0, 0.0)) == 1.0


def test_a_head_that_passes_or_is_out_of_sight_meanwhile_teaches_nothing() -> None:
    head = Head()
    for _ in range(10):
        head.points((0.0, 15.0), seconds=0.9)
        head.at += 2.0

    assert head.attending.habit == (0.0, 0.0)


def test_the_habit_is_bounded_and_follows_slowly() -> None:
    head = Head()
    head.points((0.0, 24.5), seconds=60.0)
    assert head.attending.habit == pytest.approx((0.0, FULL_ATTENTION))

    head.points((10.0, 0.0), seconds=3.0)
    assert 0.5 < head.attending.habit[0] < 1.5
    head.points((10.0, 0.0), seconds=100.0)
    assert head.attending.habit == pytest.approx((10.0, 0.0), abs=0.5)


@pytest.mark.parametrize("angle", [0.0, 12.0, 40.0, -25.0, 179.0])
def test_an_offset_is_the_angle_to_the_face_with_its_side(angle: Degrees) -> None:
    """A head turned to its left by an angle has the face to its right."""
    targets = GazeTargets(ROBOT, RecognitionConfig())
    x, y, z = turned((ROBOT_EYES[0], ROBOT_EYES[1], EYES[2]), angle)
    targets.see_face(ROBOT, (ROBOT_EYES[0], ROBOT_EYES[1], EYES[2]))

    left, up = targets.offset_of_robot((EYES, (x - EYES[0], y - EYES[1], z - EYES[2])))

    assert (left, up) == pytest.approx((-angle, 0.0), abs=1e-5)


def test_a_head_bent_down_has_the_face_above_it() -> None:
    targets = GazeTargets(ROBOT, RecognitionConfig())
    targets.see_face(ROBOT, (0.0, 0.0, 1.2))
    down = math.radians(20.0)

    assert targets.offset_of_robot((EYES, (-math.cos(down), 0.0, -math.sin(down)))) == pytest.approx((0.0, 20.0))
    assert math.hypot(*targets.offset_of_robot((EYES, (0.0, 0.0, -1.0)))) == pytest.approx(90.0)


@pytest.mark.parametrize(("beside", "confidence"), [(0.0, 1.0), (2.5, 0.7), (4.99, 0.4)])
def test_a_look_is_less_sure_towards_the_edge_of_the_cone(beside: Degrees, confidence: Probability) -> None:
    """Within the face a look is wholly sure, at the edge of the cone as sure as the least that counts."""
    watch = Watch()
    place = (EYES[0], EYES[1] + 1.5, EYES[2])
    watch.sees(0.5, face("ann", place))
    watch.looks(turned(place, math.degrees(math.asin(0.12 / 1.5)) + beside), 1.0, 1.1, 1.2)

    look = watch.actions[-1]
    assert isinstance(look, ActionBegan)
    assert look.targets == ("ann",)
    assert look.confidence == pytest.approx(confidence, abs=0.005)
