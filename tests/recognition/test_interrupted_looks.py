"""A tracker loses the eyes for a moment: ends of looks that are none, through the whole of recognition."""

import pytest

from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.interrupted_looks import LOOK_BREAK
from engage_hri.services.recognition.events.session import SETTLING, Observation
from engage_hri.services.recognition.recognizer import Recognizer
from tests.recognition.observations import HUMAN, ROBOT, stamp, world

BLUE = "blue-square"


def began(actor: str, at: float, *targets: str) -> ActionBegan:
    return ActionBegan(actor=actor, action="look", at=stamp(at), targets=targets)


def ended(actor: str, at: float, *targets: str) -> ActionEnded:
    return ActionEnded(actor=actor, action="look", at=stamp(at), targets=targets)


def lost(at: float) -> ActorLost:
    return ActorLost(actor=HUMAN, at=stamp(at))


def found(at: float) -> ActorFound:
    return ActorFound(actor=HUMAN, at=stamp(at))


def told(*observations: Observation, **config: object) -> list[tuple[str, str, float]]:
    recognizer = Recognizer(ROBOT, RecognitionConfig(**config))  # type: ignore[arg-type]
    results = recognizer.feed(world(), 0.0, 0.0)
    for observation in (*observations, None):
        at = 60.0 if observation is None else observation.at.seconds  # type: ignore[union-attr]
        while recognizer.deadline is not None and recognizer.deadline < at:
            results += recognizer.advance(recognizer.deadline)
        if observation is not None:
            results += recognizer.feed(observation, at, at)
    events = [result for result in results if isinstance(result, ConnectionEvent)]
    return [(event.id, event.state, round(event.at.seconds, 6)) for event in events]


@pytest.mark.parametrize("end_first", [True, False])
def test_an_end_of_look_together_with_a_loss_of_the_face_ends_nothing(end_first: bool):
    gap = (ended(HUMAN, 1.5, ROBOT), lost(1.5)) if end_first else (lost(1.5), ended(HUMAN, 1.5, ROBOT))
    back = (found(1.8), began(HUMAN, 1.8, ROBOT), began(ROBOT, 2.2, HUMAN), began(ROBOT, 4.0))

    assert told(began(HUMAN, 1.0, ROBOT), *gap, *back) == [
        ("mfg-1", "started", 1.0), ("mfg-1", "succeeded", 2.2), ("mfg-1", "completed", 4.0),
    ]  # fmt: skip


def test_a_shared_gaze_goes_on_after_a_face_was_lost_for_a_moment():
    shared = (began(ROBOT, 0.5, BLUE), began(HUMAN, 1.0, BLUE))
    gap = (ended(HUMAN, 3.0, BLUE), lost(3.0), found(3.3), began(HUMAN, 3.4, BLUE))

    assert told(*shared, *gap, began(HUMAN, 5.0)) == [
        ("dg-1", "started", 1.6), ("dg-1", "succeeded", 1.6), ("dg-1", "completed", 5.0),
    ]  # fmt: skip


def test_who_is_found_again_looking_elsewhere_has_looked_away_then():
    gap = (ended(HUMAN, 1.5, ROBOT), lost(1.5), found(1.8))

    assert told(began(HUMAN, 1.0, ROBOT), *gap, began(HUMAN, 1.9, BLUE))[:2] == [
        ("mfg-1", "started", 1.0), ("mfg-1", "failed", 1.8),
    ]  # fmt: skip


def test_who_is_found_again_and_looks_at_nothing_any_more_has_looked_away_then():
    assert told(began(HUMAN, 1.0, ROBOT), ended(HUMAN, 1.5, ROBOT), lost(1.5), found(1.8)) == [
        ("mfg-1", "started", 1.0), ("mfg-1", "failed", 1.8),
    ]  # fmt: skip


def test_who_is_not_found_again_has_gone():
    gone = (ended(HUMAN, 1.5, ROBOT), lost(1.5))

    assert told(began(HUMAN, 1.0, ROBOT), *gone, mutual_facial_gaze_limit=4.0) == [
        ("mfg-1", "started", 1.0), ("mfg-1", "withdrawn", 3.5),
    ]  # fmt: skip


def test_a_look_that_follows_again_at_once_has_gone_on():
    pause = (ended(HUMAN, 1.5, ROBOT), began(HUMAN, 1.65, ROBOT))

    assert told(began(HUMAN, 1.0, ROBOT), *pause, began(ROBOT, 2.2, HUMAN))[:2] == [
        ("mfg-1", "started", 1.0), ("mfg-1", "succeeded", 2.2),
    ]  # fmt: skip


def test_an_end_that_comes_twice_is_no_more_certain():
    once = (began(HUMAN, 1.0, ROBOT), ended(HUMAN, 1.5, ROBOT), began(HUMAN, 1.5 + LOOK_BREAK - 0.05, ROBOT))

    assert told(*once[:2], *once[1:]) == told(*once)


def test_a_look_that_follows_again_later_is_another():
    pause = (ended(HUMAN, 1.5, ROBOT), began(HUMAN, 1.7, ROBOT))

    assert told(began(HUMAN, 1.0, ROBOT), *pause, began(ROBOT, 2.2, HUMAN))[:4] == [
        ("mfg-1", "started", 1.0), ("mfg-1", "failed", 1.5), ("mfg-2", "started", 1.7), ("mfg-2", "succeeded", 2.2),
    ]  # fmt: skip


def test_the_robot_that_comes_in_the_pause_is_in_time_only_if_the_look_goes_on():
    start, end, come = began(HUMAN, 1.0, ROBOT), ended(HUMAN, 1.5, ROBOT), began(ROBOT, 1.6, HUMAN)

    assert told(start, end, come) == [("mfg-1", "started", 1.0), ("mfg-1", "failed", 1.5)]
    assert told(start, end, come, began(HUMAN, 1.63, ROBOT))[:2] == [
        ("mfg-1", "started", 1.0), ("mfg-1", "succeeded", 1.6),
    ]  # fmt: skip


def test_a_look_elsewhere_ends_the_last_without_waiting():
    recognizer = Recognizer(ROBOT, RecognitionConfig())
    recognizer.feed(world(), 0.0, 0.0)
    results = []
    for observation in (began(HUMAN, 1.0, ROBOT), ended(HUMAN, 1.5, ROBOT), began(HUMAN, 1.5, BLUE)):
        results += recognizer.feed(observation, observation.at.seconds, observation.at.seconds)

    assert [(one.state, one.at.seconds) for one in results if isinstance(one, ConnectionEvent)][-1] == ("failed", 1.5)


def test_breaks_of_people_long_gone_are_forgotten():
    recognizer = Recognizer(ROBOT, RecognitionConfig())
    recognizer.feed(world("nobody-else"), 0.0, 0.0)
    for number in range(100):
        at, actor = 1000.0 * number, f"track-{number}"
        for observation in (
            ActionBegan(actor=actor, action="look", at=stamp(at), targets=(ROBOT,)),
            ActionEnded(actor=actor, action="look", at=stamp(at + 1.0), targets=(ROBOT,)),
            ActorLost(actor=actor, at=stamp(at + 1.0)),
        ):
            recognizer.feed(observation, observation.at.seconds, observation.at.seconds)
        recognizer.advance(at + 900.0)

    assert len(recognizer._interrupted._breaks) + len(recognizer._interrupted._lost) <= 2


def test_a_pause_may_not_outlast_what_is_waited_for():
    assert LOOK_BREAK <= SETTLING
