"""What is said into the robot's turn is an answer or a backchannel by its words, if these are known in time."""

import pytest

from engage_hri.services.recognition.events.scene import Worded
from tests.recognition.observations import HUMAN, ROBOT, Log

TURN = 10.0
"""When the robot's turn ends; it begins at 1."""

ANSWERS = ("stop", "stop please", "wait", "no", "no no", "halt", "what?", "warte mal", "attends", "待って")
LISTENING = (
    "uh-huh", "yes", "yes yes okay", "hm hm hm hm", "okay, okay, right", "ja genau", "d'accord", "うん うん", "I see",
    "aha",
)  # fmt: skip


def talk(text: str, lasts: float, known: float, *, cut: float | None = None) -> Log:
    """Somebody says this at 3 s, in the robot's turn. known: when its words are. cut: when the robot breaks off."""
    log = Log(adjacency_pair_limit=4.0)
    log.begins(ROBOT, "speak", 1.0, behavior="block-1:speech-1")
    log.requests_event("adjacency_pair", 1.0, turn="turn-1")
    steps = [
        (3.0, 0, lambda: log.begins(HUMAN, "speak", 3.0)),
        (3.0 + lasts, 1, lambda: log.ends(HUMAN, "speak", 3.0 + lasts)),
        (3.0 + known, 2, lambda: log.feed(Worded(actor=HUMAN, since=3.0, text=text), 3.0 + known)),
        (cut or TURN, 3, lambda: log.ends(ROBOT, "speak", cut or TURN, behavior="block-1:speech-1")),
        (cut or TURN, 4, lambda: log.signals("aborted" if cut else "ended", cut or TURN)),
    ]
    for at, _, step in sorted(steps, key=lambda each: each[:2]):
        log.until(at - 1e-6)
        step()
    log.until(100.0)
    return log


@pytest.mark.parametrize("late", [-0.1, 0.0, 0.3, 1.5])
@pytest.mark.parametrize("text", ANSWERS)
def test_a_short_speech_of_other_than_a_listeners_words_is_the_answer(text: str, late: float) -> None:
    log = talk(text, 0.35, 0.35 + late)

    told = log.succeeded("ap-1")
    assert (told.response, told.delay) == ("speak", pytest.approx(3.0 - TURN))
    assert log.last("ap-1").duration == pytest.approx(0.35)
    assert log.last("ap-1").words == text
    if late < 0:  # else its length has decided before
        assert log.states("bc-1") == []


@pytest.mark.parametrize("text", ANSWERS)
def test_who_stops_the_robot_with_a_word_has_answered_when_it_breaks_off(text: str) -> None:
    told = talk(text, 0.35, 0.4, cut=3.6).succeeded("ap-1")

    assert (told.response, told.delay) == ("speak", pytest.approx(3.0 - 3.6))


@pytest.mark.parametrize(("lasts", "known"), [(1.0, 0.7), (1.0, 0.9), (1.0, 1.1), (2.5, 2.9), (0.5, 0.6)])
@pytest.mark.parametrize("text", LISTENING)
def test_a_speech_of_a_listeners_words_is_a_backchannel_however_long(text: str, lasts: float, known: float) -> None:
    log = talk(text, lasts, known)

    assert log.states("ap-1") == ["started", "failed"]
    assert list(dict.fromkeys(log.states("bc-1"))) == ["started", "succeeded", "completed"]
    assert (log.last("bc-1").duration, log.last("bc-1").words) == (pytest.approx(lasts), text)


@pytest.mark.parametrize("text", LISTENING)
def test_after_a_listeners_words_the_answer_is_still_waited_for(text: str) -> None:
    log = Log(adjacency_pair_limit=4.0)
    log.begins(ROBOT, "speak", 1.0, behavior="block-1:speech-1")
    log.requests_event("adjacency_pair", 1.0, turn="turn-1")
    log.begins(HUMAN, "speak", 3.0)
    log.ends(HUMAN, "speak", 4.0)
    log.feed(Worded(actor=HUMAN, since=3.0, text=text), 4.2)
    log.ends(ROBOT, "speak", TURN, behavior="block-1:speech-1")
    log.signals("ended", TURN)
    log.begins(HUMAN, "nod", TURN + 1.0)
    log.until(100.0)

    told = log.succeeded("ap-1")
    assert (told.response, told.delay) == ("nod", pytest.approx(1.0))


@pytest.mark.parametrize("text", [*ANSWERS, *LISTENING])
def test_words_that_are_known_after_the_turn_decide_nothing(text: str) -> None:
    short, long = talk(text, 0.35, 7.5), talk(text, 1.0, 7.5)

    assert short.states("ap-1") == ["started", "failed"] if text not in LISTENING else True
    assert short.states("bc-1")[:3] == ["started", "succeeded", "completed"]
    assert long.succeeded("ap-1").delay == pytest.approx(3.0 - TURN)
