"""What the robot says, heard back as a person's words, is no sign of that person: it answers and opens nothing."""

import random
from collections.abc import Callable
from functools import partial

import pytest

from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.recognition import Interjection
from engage_hri.services.text.own_words import OwnWords
from tests.random_cases import share_of
from tests.recognition.observations import HUMAN, stamp
from tests.recognition.test_words import Talk

QUESTION = "Which of the two would you like best, the red one or the blue one?"
ASKS, PACE = 1.0, 0.3
"""When the robot asks, and the time of each of its words."""
SILENT = ASKS + PACE * len(QUESTION.split())
LAG = 0.2
"""Time after which the robot's words come back."""


class Room:
    """The robot asks its question; what else is told of that time is added before."""

    def __init__(self) -> None:
        self.talk = Talk()
        self.talk.recognizer.session.scene.is_worded = True  # the recognizer has told words before
        self._steps: list[tuple[float, Callable[[], object]]] = [
            (ASKS, lambda: self.talk.asks(ASKS, SILENT)), (SILENT, self.talk.turn_ends),
        ]  # fmt: skip
        for n, word in enumerate(QUESTION.split(), 1):
            spoken = WordSpoken(block="b", behavior="s", word=word, position=0, at=stamp(ASKS + PACE * n))
            self._steps.append((spoken.at.seconds, partial(self.talk.feed, spoken, spoken.at.seconds)))

    def voice(self, began: float, ended: float) -> None:
        begins = ActionBegan(actor=HUMAN, action="speak", at=stamp(began))
        ends = ActionEnded(actor=HUMAN, action="speak", at=stamp(ended))
        self._steps += [(began, lambda: self.talk.feed(begins, began)), (ended, lambda: self.talk.feed(ends, ended))]

    def words(self, text: str, began: float, known: float, *, final: bool = True) -> None:
        ended = min(known, began + PACE * len(text.split()))
        self._steps.append((known, lambda: self.talk.hears(text, began, ended, known, final=final, id=f"u-{began}")))

    def echo(self, first: int, last: int, *, grows: bool) -> None:
        """A recognizer hears words of the robot, and may tell each as soon as it is over."""
        words, began = QUESTION.split()[first:last], ASKS + PACE * first + LAG
        for n in range(1, len(words) + 1) if grows else ():
            self.words(" ".join(words[:n]), began, began + PACE * n + 0.05, final=False)
        self.words(" ".join(words).lower().strip("?,"), began, began + PACE * len(words) + 0.6)

    def run(self) -> tuple[list[str], list[tuple[str, str]]]:
        """States of the robot's pair, and readings and words of what is said into it. Nothing else begins."""
        for _, step in sorted(self._steps, key=lambda each: each[0]):
            step()
        self.talk.until(60.0)
        assert not self.talk.told("backchannel")
        told = [each for each in self.talk.results if isinstance(each, Interjection)]
        return [str(state) for state, *_ in self.talk.told()], [(each.reading, each.words) for each in told]


@pytest.mark.parametrize("grows", [True, False])
@pytest.mark.parametrize(("first", "last"), [(0, 15), (0, 4), (3, 9), (8, 15), (12, 15), (13, 15), (14, 15)])
def test_the_robots_words_alone_answer_nothing(first: int, last: int, *, grows: bool) -> None:
    room = Room()
    room.echo(first, last, grows=grows)

    assert room.run() == (["started", "failed"], [])


@pytest.mark.parametrize(("first", "last"), [(0, 15), (0, 4), (3, 9), (8, 15), (12, 15), (13, 15)])
def test_a_voice_of_which_only_the_robots_words_are_told_is_noise(first: int, last: int) -> None:
    room = Room()
    room.voice(ASKS + PACE * first + LAG, ASKS + PACE * last + LAG + 0.3)
    room.echo(first, last, grows=True)

    assert room.run() == (["started", "failed"], [("open", ""), ("noise", "")])


def test_a_recognizer_that_tells_no_partial_words_is_in_time_for_a_short_voice() -> None:
    room = Room()
    room.voice(ASKS + LAG, ASKS + LAG + PACE * 2)
    room.echo(0, 2, grows=False)

    assert room.run() == (["started", "failed"], [("open", ""), ("noise", "")])


@pytest.mark.parametrize("known", [3.0, 3.6, 4.3])
def test_a_stop_beside_the_robots_words_is_heeded(known: float) -> None:
    room = Room()
    room.voice(ASKS + LAG, 4.0)
    room.echo(0, 4, grows=True)
    room.words("stop", 2.6, known)

    states, told = room.run()
    assert states[:3] == ["started", "succeeded", "completed"]
    assert told[-1] == ("interruption", "stop")


@pytest.mark.parametrize("words", ["Which of the two stop", "stop of the two would", "Which stop", "no no the two"])
def test_words_of_the_robot_with_others_before_or_after_are_a_persons(words: str) -> None:
    room = Room()
    room.voice(ASKS + LAG, ASKS + 1.4)
    room.words(words, ASKS + LAG, ASKS + 1.5)

    states, told = room.run()
    assert (states[:2], told[-1]) == (["started", "succeeded"], ("interruption", words))


@pytest.mark.parametrize("words", ["the blue one", "blue one", "one", "the red one", "the red one or the blue one"])
@pytest.mark.parametrize("voiced", [True, False])
def test_who_repeats_the_robots_words_after_it_has_answered(words: str, *, voiced: bool) -> None:
    room = Room()
    began = SILENT + 0.15
    if voiced:
        room.voice(began, began + 1.0)
    room.words(words, began, began + 1.5)

    assert room.run()[0][:2] == ["started", "succeeded"]


def test_who_answers_in_the_same_breath_as_the_echo_has_answered() -> None:
    room = Room()
    room.voice(ASKS + PACE * 12 + LAG, SILENT + 1.2)
    room.echo(12, 15, grows=True)
    room.words("the red one", SILENT + 0.5, SILENT + 1.9)

    states, told = room.run()
    assert (states[:2], told[-1]) == (["started", "succeeded"], ("answer", "the red one"))


# -- which words are the robot's -----------------------------------------------------------------------------------

LETTERS = "abcdefghijklmnopqrstuvwxyz"


def _spoken(random_: random.Random) -> list[tuple[str, float, float]]:
    """Words, no two alike, with the times at which a voice says them; it pauses."""
    at, words = 10.0, []
    for letter in random_.sample(LETTERS, 20):
        word = letter + "aeiou"[: random_.randint(1, 5)]
        began = at + random_.choice((0.0, 0.0, 0.0, 0.2, 2.0))
        at = began + random_.uniform(0.08, 0.1) * (1 + len(word))
        words.append((word, began, at))
    return words


@pytest.mark.parametrize("seed", range(share_of(200)))
def test_what_comes_back_at_its_time_is_the_robots_and_what_comes_later_is_not(seed: int) -> None:
    random_ = random.Random(seed)
    spoken, own = _spoken(random_), OwnWords()
    own.begins(spoken[0][1])
    for word, _, ended in spoken:
        own.says(f"{word}, ", ended)
    first = random_.randrange(len(spoken))
    run = spoken[first : first + random_.randint(1, 8)]
    words = [word for word, _, _ in run]
    began = run[0][1]
    lag = random_.uniform(-0.2, min(0.5, run[-1][2] - began))
    after = run[-1][2] + random_.uniform(0.05, 3.0)
    misheard = [*words]
    for place in random_.sample(range(1, len(words) - 1), len(words) // 3) if len(words) > 3 else ():
        misheard[place] = "zzz"

    assert own.are(" ".join(words), began + lag, is_final=True)
    assert own.are(" ".join(misheard).upper(), began + lag, is_final=True)
    assert own.are(" ".join([*words, words[-1][:1]]), began + lag, is_final=False)
    assert not own.are(" ".join(words), after, is_final=True)
    assert not own.are(" ".join(words), began - 0.35 - 1.0, is_final=True)
    assert not own.are(" ".join([*words, "stop"]), began + lag, is_final=True)
    assert not own.are("stop", began + lag, is_final=True)
