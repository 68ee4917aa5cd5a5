"""What a person says right after the robot's answer closes the exchange, or opens another one: its words tell."""

import pytest

from engage_hri.services.text.listening import is_content
from tests.recognition.heard_log import HeardLog
from tests.recognition.observations import ROBOT, world

LIMIT = 4.0
Told = list[tuple[str, str, float]]
FIRST = ("ann", "succeeded", 1.0)

CLOSING = (
    "Okay.", "oh I see", "Thanks!", "Great, thank you very much.", "Ah, right, that helps.", "okay then", "Mhm.",
    "Danke schön", "ach so, gut, vielen Dank", "D'accord, merci beaucoup.", "Vale, gracias.",
    "Va bene, grazie mille.", "Certo, obrigada.", "Oké, dank je wel.", "Понятно, спасибо.",
    "なるほど、ありがとうございます。", "好的，谢谢。",
)  # fmt: skip
ASKING = (
    "And where does the blue one go?", "Okay, and the red one?", "Then what about this?", "How so?", "Do it then.",
    "Thanks, but I meant the other one.", "No.", "Stop", "Wie dann?", "Danke, und der Rote?", "Et alors ?",
    "¿Y el rojo?", "E quello rosso?", "そうですか、赤いのは？", "好，那红的呢？", "Can you repeat that?",
)  # fmt: skip


@pytest.mark.parametrize("words", CLOSING)
def test_acknowledgments_assessments_and_thanks_ask_for_nothing(words: str) -> None:
    assert is_content(words)


@pytest.mark.parametrize("words", ASKING)
def test_whatever_else_is_said_asks_for_more(words: str) -> None:
    assert not is_content(words)


def pairs(
    words: str, *, known: float, until: float = 7.2, robot: tuple[float, ...] = ()
) -> list[tuple[str, str, float]]:
    """Pairs of a person who asks, is answered from 4 to 5.5 s, and says `words` from 6 s on.

    known: when they are told. robot: when the robot begins to speak after that.
    """
    log = HeardLog(LIMIT)
    log.take(world("ann"), 0.0)
    log.found("ann", 0.0)
    steps = [
        (1.0, lambda: log.begins("ann", "speak", 1.0)),
        (2.0, lambda: log.ends("ann", "speak", 2.0)),
        (2.2, lambda: log.hears("ann", 1.0, 2.0, "where is the cup", 2.2)),
        (4.0, lambda: log.begins(ROBOT, "speak", 4.0, behavior="b:s")),
        (5.5, lambda: log.ends(ROBOT, "speak", 5.5, behavior="b:s")),
        (6.0, lambda: log.begins("ann", "speak", 6.0)),
        (until, lambda: log.ends("ann", "speak", until)),
        (known, lambda: log.hears("ann", 6.0, until, words, known)),
        *((at, lambda at=at: log.begins(ROBOT, "speak", at, behavior="c:s")) for at in robot),
        *((at + 0.5, lambda at=at: log.ends(ROBOT, "speak", at + 0.5, behavior="c:s")) for at in robot),
    ]
    for at, step in sorted(steps, key=lambda each: each[0]):
        log.until(at - 1e-6)
        step()
    log.until(60.0)
    told = [each for each in log.events if each.kind == "adjacency_pair" and each.state in ("succeeded", "failed")]
    return [(each.initiator, each.state, each.started.seconds) for each in told]


@pytest.mark.parametrize("known", [7.3, 8.1])
def test_thanks_after_the_answer_close_the_exchange(known: float) -> None:
    assert pairs("Okay, thank you.", known=known) == [FIRST]


@pytest.mark.parametrize("known", [7.3, 8.1])
def test_a_question_after_the_answer_opens_a_pair_from_its_onset(known: float) -> None:
    assert pairs("Okay, and where is the plate?", known=known) == [FIRST, ("ann", "failed", 6.0)]
    assert pairs("Okay, and where is the plate?", known=known, robot=(9.0,)) == [FIRST, ("ann", "succeeded", 6.0)]


def test_a_long_question_whose_words_come_when_it_is_over_opens_one_too() -> None:
    told = pairs(
        "Okay, and where does the plate with the long blue handle go?", known=11.0, until=10.8, robot=(12.0,)
    )

    assert told == [FIRST, ("ann", "succeeded", 6.0)]


def test_words_that_come_when_the_robot_has_spoken_open_none() -> None:
    words = "Okay, and where does the plate with the long blue handle go?"

    assert pairs(words, known=13.0, until=10.8, robot=(11.5,)) == [FIRST]
