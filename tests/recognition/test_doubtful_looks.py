"""Looks of heads whose deviation is stated: what is named, alone or as one of several; what sure looks teach."""

import math
from random import Random

import pytest

from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, HeadPose, Looked
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Degrees, Vector
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.perceive.gaze_targets import GazeTargets
from engage_hri.services.recognition.perceive.sure_looks import SureLooks
from engage_hri.services.recognition.recognizer import Recognizer
from tests.recognition.observations import HUMAN, ROBOT, stamp
from tests.recognition.raw import EYES, Watch, frames, piece, place_of, pose, table

SPREAD = math.radians(3)


def doubtful(target: str | Vector, at: float, degrees: Degrees = 3.0, behind: float = 0.2) -> HeadPose:
    """A head that turns to a target, and stays behind by a share of the way from the robot's face."""
    there = pose(target, at)
    robot = pose(ROBOT, at).direction
    parts = []
    for direction in (robot, there.direction):
        x, y, z = direction
        parts.append((math.atan2(y, -x), math.atan2(z, math.hypot(x, y))))
    (left, up), (aside, above) = parts
    left, up = left + (1 - behind) * (aside - left), up + (1 - behind) * (above - up)
    direction = (-math.cos(left) * math.cos(up), math.sin(left) * math.cos(up), math.sin(up))
    spread = math.radians(degrees)
    return HeadPose(
        actor=HUMAN, position=EYES, direction=direction, at=stamp(at), yaw_spread=spread, pitch_spread=spread
    )


def looks(watch: Watch) -> list[ActionBegan]:
    return [each for each in watch.actions if isinstance(each, ActionBegan) and each.action == "look"]


def look_at(target: str | Vector, degrees: Degrees) -> ActionBegan:
    watch = Watch()
    for at in frames(1.0, 2.0):
        watch.feed(doubtful(target, at, degrees))
    return looks(watch)[-1]


def test_a_gaze_that_is_surely_on_one_thing_names_it_alone_and_a_head_of_which_nothing_is_known_does_not() -> None:
    targets, (x, y, z) = GazeTargets(ROBOT, RecognitionConfig()), place_of("blue")
    targets.see(table(), 0.0)
    gaze = EYES, (x - EYES[0], y - EYES[1], z - EYES[2])
    seen = targets.target(HUMAN, gaze, present=None, at=1.0, sure=1.0, spread=(math.radians(1.5), math.radians(1.5)))
    look = look_at("blue", 1.5)

    assert (seen.targets, seen.one_of) == (("blue",), False)
    assert seen.confidence > 0.9
    assert (look.targets, look.one_of) == (("blue", "table"), True)


def test_two_things_too_near_to_tell_apart_are_both_named_and_neither_alone() -> None:
    look = look_at("red", 4.0)

    assert (look.targets, look.one_of) == (("green", "red"), True)


def test_what_cannot_be_told_apart_from_much_else_is_a_look_at_the_table() -> None:
    watch = Watch()
    many = [piece(f"small-{k}", (0.6 + 0.09 * (k // 3), 0.09 * (k % 3) - 0.1, 0.7)) for k in range(9)]
    watch.sees(0.5, *many)
    for at in frames(1.0, 2.0):
        watch.feed(doubtful((0.69, 0.0, 0.7), at, 8.0))

    assert looks(watch)[-1].targets == ("table",)


@pytest.mark.parametrize("degrees", [1.0, 3.0, 6.0])
def test_a_look_at_the_robot_is_one_at_it(degrees: Degrees) -> None:
    look = look_at(ROBOT, degrees)

    assert (look.targets, look.one_of) == ((ROBOT,), False)


def test_without_a_stated_deviation_all_is_as_it_was() -> None:
    watch = Watch()
    watch.looks("red", *frames(1.0, 2.0))

    assert [(each.targets, each.one_of, each.confidence) for each in looks(watch)] == [(("red",), False, 1.0)]


def test_a_directed_gaze_by_an_unsure_look_says_so_and_is_about_both() -> None:
    recognizer, told = Recognizer(ROBOT, RecognitionConfig()), list[object]()
    recognizer.feed(table(), 0.0, 0.0)
    for at in frames(1.0, 3.0):
        told += recognizer.feed(doubtful("red", at, 4.0), at, at)
        told += recognizer.advance(at)
    events = [each for each in told if isinstance(each, ConnectionEvent) and each.kind == "directed_gaze"]

    assert [(each.objects, each.one_of) for each in events] == [(("green", "red"), True)]
    sure = [each for each in told if isinstance(each, ActionBegan) and each.one_of]
    assert events[0].confidence == pytest.approx(sure[0].confidence)


def test_what_an_unsure_look_answers_is_less_sure() -> None:
    """Of the two that are named each has its part."""
    recognizer, told = Recognizer(ROBOT, RecognitionConfig()), list[object]()
    recognizer.feed(table(), 0.0, 0.0)
    look = ActionBegan(actor=HUMAN, action="look", at=stamp(1.0), targets=(ROBOT, "red"), one_of=True, confidence=0.9)
    recognizer.feed(ActorFound(actor=HUMAN, at=stamp(0.5)), 0.5, 0.5)
    told += recognizer.feed(look, 1.0, 1.0)
    told += recognizer.advance(2.0)
    [event, *_] = [each for each in told if isinstance(each, ConnectionEvent)]

    assert (event.kind, event.confidence) == ("mutual_facial_gaze", pytest.approx(0.45))


# -- sure looks -----------------------------------------------------------------------------------------------------


def learned(offset: Degrees, behind: float, looks: int, noise: Degrees = 1.0) -> SureLooks:
    """Looks at angles to the side by a head that is off and stays behind, each for a second."""
    chance, sure = Random(2), SureLooks()
    for number in range(looks):
        angle, wrong = (0.0, -25.0, 20.0, -10.0)[number % 4], chance.gauss(0, noise)
        for k in range(15):
            head = angle * (1 - behind) - offset + wrong
            sure.take((head, 0.0), (angle, 0.0), (4.0, 4.0), 10 * number + k / 15)
        assert sure.rest()
    return sure


def test_offset_and_share_of_a_head_are_learned_from_sure_looks() -> None:
    before, after = SureLooks().aim((-22.0, 0.0), (4.0, 4.0)), learned(6.0, 0.3, 12).aim((-22.0, 0.0), (4.0, 4.0))

    true = (-22.0 + 6.0) / 0.7
    assert abs(before[0][0] - true) > 4
    assert after[0][0] == pytest.approx(true, abs=2)
    assert after[1][0] < before[1][0]


def test_a_look_that_cannot_have_been_there_teaches_nothing() -> None:
    sure = learned(0.0, 0.2, 6)
    known = list(sure.looks)
    for k in range(15):
        sure.take((40.0, 0.0), (0.0, 0.0), (4.0, 4.0), 100 + k / 15)

    assert not sure.rest()
    assert sure.looks == known


def test_a_glance_at_what_is_known_teaches_nothing() -> None:
    sure = SureLooks()
    for k in range(4):
        sure.take((5.0, 0.0), (0.0, 0.0), (4.0, 4.0), k / 15)

    assert not sure.rest()
    assert sure.looks == []


def pointing(recognizer: Recognizer, target: str, since: float) -> list[object]:
    """Point at something for a second, with a head that is five degrees too high."""
    told = list[object]()
    x, y, z = place_of(target)
    for kind, at in ((ActionBegan, since), (ActionEnded, since + 1.0)):
        if kind is ActionEnded:
            for tick in frames(since, since + 0.99):
                told += recognizer.feed(doubtful((x, y, z + 0.08), tick), tick, tick)
        action = kind(actor=HUMAN, action="point", targets=(target,), at=stamp(at))
        told += recognizer.feed(action, at, at)
    return told


def test_who_points_teaches_and_it_stays_with_the_person_who_is_joined() -> None:
    recognizer = Recognizer(ROBOT, RecognitionConfig())
    recognizer.feed(table(), 0.0, 0.0)
    recognizer.feed(doubtful("red", 0.5), 0.5, 0.5)
    pointing(recognizer, "blue", 1.0)
    pointing(recognizer, "red", 3.0)
    [habit] = recognizer.heads().values()

    assert len(habit.looks) == 2
    assert habit.offset[1] < 0
    assert recognizer.heads() == {}
    recognizer.join(HUMAN, "ann", 5.0, speaks=False)
    assert recognizer.heads()["ann"].looks == habit.looks


def test_eyes_that_have_met_teach() -> None:
    recognizer = Recognizer(ROBOT, RecognitionConfig())
    recognizer.feed(table(), 0.0, 0.0)
    recognizer.feed(ActionBegan(actor=ROBOT, action="look", targets=(HUMAN,), at=stamp(0.5)), 0.5, 0.5)
    for target, since in ((ROBOT, 1.0), ("blue", 3.0)):
        for at in frames(since, since + 2):
            recognizer.feed(doubtful(target, at), at, at)
            recognizer.advance(at)

    assert [len(each.looks) for each in recognizer.heads().values()] == [1]


# -- stalls ---------------------------------------------------------------------------------------------------------


def looked(at: float, *, seen: bool) -> Looked:
    return Looked(at=stamp(at), seen=(HUMAN,) if seen else (), missed=() if seen else (HUMAN,))


def seen_until(watch: Watch, since: float, until: float) -> None:
    for at in frames(since, until):
        watch.looks("blue", at)
        watch.feed(looked(at, seen=True))


@pytest.mark.parametrize("stall", [0.3, 1.0, 3.0, 20.0])
def test_a_source_that_says_when_it_looks_ends_nothing_by_a_stall(stall: float) -> None:
    watch = Watch()
    seen_until(watch, 1.0, 2.0)
    watch.until(1.99 + stall)
    seen_until(watch, 2.0 + stall, 3.0 + stall)

    assert watch.told == [("found", HUMAN, 1.0), ("look", "blue", 1.0)]


def test_who_was_looked_for_in_vain_for_two_seconds_has_gone_since_they_were_seen() -> None:
    watch = Watch()
    seen_until(watch, 1.0, 2.0)
    for at in frames(2.0, 3.95):
        watch.feed(looked(at, seen=False))
    before = watch.told[2:]
    for at in frames(6.0, 6.3):  # a stall between does not count
        watch.feed(looked(at, seen=False))

    assert before == []
    assert [each[:2] for each in watch.told[2:]] == [("lost", HUMAN)]
    assert watch.told[-1][2] == pytest.approx(frames(1.0, 2.0)[-1], abs=1e-5)
