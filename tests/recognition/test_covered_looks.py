"""Looks that go with a hand and what it hides: they direct nobody, as those of a manipulation that is seen."""

import pytest

from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.recognizer import Recognizer
from tests.recognition.observations import HUMAN, ROBOT
from tests.recognition.raw import PLACES, face, frames, hand, pose, table

LAP = (1.1, -0.2, 0.68)
BESIDE_RED = (0.6, 0.13, 0.7)


def filmed(until: float, looks, palm, hidden, blue=lambda at: PLACES["blue"]) -> list[ConnectionEvent]:  # type: ignore[no-untyped-def]
    """Directed gazes of a person; the functions say what is so at a time."""
    recognizer = Recognizer(ROBOT, RecognitionConfig())
    results = []
    for at in frames(0.0, until, 20.0):
        while recognizer.deadline is not None and recognizer.deadline < at:
            results += recognizer.advance(recognizer.deadline)
        moved = {} if hidden(at) else {"blue": blue(at)}
        world = table(face(), hand(palm(at)), without="blue" if hidden(at) else "", **moved)
        results += recognizer.feed(world, at, at)
        results += recognizer.feed(pose(looks(at), at), at, at)
    return [one for one in results if isinstance(one, ConnectionEvent) and one.kind == "directed_gaze"]


def test_a_look_at_a_piece_under_ones_own_hand_directs_nobody():
    directed = filmed(
        4.0,
        looks=lambda at: "blue" if at > 1.0 else ROBOT,
        palm=lambda at: PLACES["blue"] if 1.2 < at < 3.0 else LAP,
        hidden=lambda at: 1.2 < at < 3.0,
    )

    assert directed == []


def test_a_look_at_another_piece_directs_though_a_hand_rests_on_one():
    directed = filmed(
        3.0,
        looks=lambda at: "red" if at >= 2.0 else ROBOT,
        palm=lambda at: PLACES["blue"],
        hidden=lambda at: at > 0.0,
    )

    assert [(one.state, one.objects, one.started.seconds) for one in directed] == [("started", ("red",), 2.0)]


@pytest.mark.parametrize("takes", [True, False])
def test_a_look_at_the_destination_of_what_a_hand_carries_out_of_sight_directs_nobody(takes):
    def blue(at: float) -> tuple[float, float, float]:
        return BESIDE_RED if takes and at > 2.0 else PLACES["blue"]

    directed = filmed(
        4.0,
        looks=lambda at: "red" if at >= 1.5 else ROBOT,
        palm=lambda at: PLACES["blue"] if 1.0 < at < 1.6 else BESIDE_RED if 1.6 <= at < 2.5 else LAP,
        hidden=lambda at: 1.0 < at < 2.5,
        blue=blue,
    )

    assert directed == []


def test_a_piece_that_somebody_else_hides_may_be_looked_at():
    recognizer = Recognizer(ROBOT, RecognitionConfig())
    results = []
    for at in frames(0.0, 3.0, 20.0):
        while recognizer.deadline is not None and recognizer.deadline < at:
            results += recognizer.advance(recognizer.deadline)
        others = (face(), face("ann", (1.3, 0.8, 1.2)), hand(PLACES["blue"], owner="ann"))
        results += recognizer.feed(table(*others, without="blue" if at > 0.5 else ""), at, at)
        results += recognizer.feed(pose("blue" if at >= 1.0 else ROBOT, at), at, at)

    directed = [one for one in results if isinstance(one, ConnectionEvent) and one.kind == "directed_gaze"]
    assert [(one.initiator, one.objects) for one in directed] == [(HUMAN, ("blue",))]
