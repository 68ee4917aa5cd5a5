"""Words in connection events: with what was said, without, late, corrected, and as speech by themselves."""

import pytest

from engage_hri.schemas.behaviors import Event, TurnSignal
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.recognition import ConnectionEvent, RequestEvent, SignalTurn
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.perceive.words import TimedWords
from engage_hri.services.recognition.recognizer import Recognizer, Result
from tests.recognition.observations import HUMAN, ROBOT, stamp, world


class Talk:
    """A recognizer, and all that comes out of it. Times are those of what happens, not of arrival."""

    def __init__(self, **config: float) -> None:
        self.recognizer = Recognizer(ROBOT, RecognitionConfig(**config))  # type: ignore[arg-type]
        self.results: list[Result] = self.recognizer.feed(world(HUMAN), 0.0, 0.0)

    def feed(self, observation: object, at: float, now: float | None = None) -> None:
        self.until(at if now is None else now)
        self.results += self.recognizer.feed(observation, at, at if now is None else now)  # type: ignore[arg-type]

    def until(self, now: float) -> None:
        while (due := self.recognizer.deadline) is not None and due < now:
            self.results += self.recognizer.advance(due)

    def asks(self, at: float, end: float, *, limit: float | None = None) -> None:
        """The robot asks; its turn ends at `end`, unless something comes before."""
        event = Event(kind="adjacency_pair", id="pair", responder=HUMAN, turn=f"turn-{at}", limit=limit)
        self.feed(ActionBegan(actor=ROBOT, action="speak", at=stamp(at), behavior="b:s"), at)
        self.feed(RequestEvent(id=f"ask-{at}", requester="r", block="b", at=stamp(at), event=event), at)
        self._end = end, f"turn-{at}"

    def turn_ends(self) -> None:
        end, turn = self._end
        self.feed(ActionEnded(actor=ROBOT, action="speak", at=stamp(end), behavior="b:s"), end)
        signal = TurnSignal(id="e", turn=turn, signal="ended", actor=HUMAN)
        self.feed(SignalTurn(id=f"end-{turn}", requester="r", signal=signal, at=stamp(end)), end)

    def speaks(self, began: float, ended: float) -> None:
        self.feed(ActionBegan(actor=HUMAN, action="speak", at=stamp(began)), began)
        self.feed(ActionEnded(actor=HUMAN, action="speak", at=stamp(ended)), ended)

    def hears(
        self, text: str, began: float, ended: float, at: float, *, id: str = "u", final: bool = True, who: str = HUMAN
    ) -> None:
        self.feed(TimedWords(actor=who, id=id, text=text, began=began, ended=ended, final=final), at)

    def told(self, kind: str = "adjacency_pair") -> list[tuple[object, ...]]:
        """(state, at, words, retold) of each change of the events of a kind."""
        return [
            (one.state, round(one.at.seconds, 3), one.words, one.retold)
            for one in self.results
            if isinstance(one, ConnectionEvent) and one.kind == kind
        ]


def test_words_of_the_answer_come_after_it() -> None:
    talk = Talk()
    talk.asks(1.0, 2.0)
    talk.turn_ends()
    talk.speaks(2.5, 3.5)
    talk.hears("yes that", 2.5, 3.0, 3.2, final=False)
    talk.hears("yes that one", 2.4, 3.4, 4.1)

    assert talk.told() == [
        ("started", 1.0, "", False), ("succeeded", 2.5, "", False), ("completed", 3.5, "", False),
        ("completed", 4.1, "yes that one", True),
    ]  # fmt: skip


def test_words_that_come_in_time_are_told_with_the_event() -> None:
    """An answer into the robot's words is decided when they end; its own words are known by then."""
    talk = Talk()
    talk.asks(1.0, 6.0)
    talk.speaks(2.0, 3.5)
    talk.hears("wait I know", 2.0, 3.5, 4.0)
    talk.turn_ends()

    assert talk.told() == [
        ("started", 1.0, "", False), ("succeeded", 6.0, "wait I know", False),
        ("completed", 6.0, "wait I know", False),
    ]  # fmt: skip


def test_the_delay_is_that_of_the_speech() -> None:
    talk = Talk()
    talk.asks(1.0, 2.0)
    talk.turn_ends()
    talk.speaks(2.5, 3.5)
    talk.hears("yes", 2.5, 3.5, 4.1)

    delays = {one.delay for one in talk.results if isinstance(one, ConnectionEvent) and one.state != "started"}
    assert delays == {0.5}


def test_a_correction_is_told_again_and_a_repetition_is_not() -> None:
    talk = Talk()
    talk.asks(1.0, 2.0)
    talk.turn_ends()
    talk.speaks(2.5, 3.5)
    talk.hears("the bread one", 2.5, 3.5, 4.0)
    talk.hears("the bread one", 2.5, 3.5, 4.0)
    talk.hears("the red one", 2.5, 3.5, 5.0)
    talk.hears("the bread one", 2.5, 3.5, 4.5)  # older than what is known
    talk.hears("the red one", 2.5, 3.5, 6.0)

    assert [change for change in talk.told() if change[3]] == [
        ("completed", 4.0, "the bread one", True), ("completed", 5.0, "the red one", True),
    ]  # fmt: skip


def test_words_that_come_too_late_are_not_told_any_more() -> None:
    talk = Talk()
    talk.asks(1.0, 2.0)
    talk.turn_ends()
    talk.speaks(2.5, 3.5)
    talk.hears("yes", 2.5, 3.5, 13.6)

    assert not any(retold for *_, retold in talk.told())


def test_what_the_person_asks_is_told_while_it_waits_for_the_robot() -> None:
    talk = Talk()
    talk.speaks(1.0, 2.0)
    talk.hears("where is the cup", 1.0, 2.0, 2.6)
    talk.until(9.0)

    assert talk.told() == [
        ("started", 1.0, "", False), ("started", 2.6, "where is the cup", True),
        ("failed", 8.0, "where is the cup", False),
    ]  # fmt: skip


def test_a_turn_in_several_speeches_has_all_their_words_in_order() -> None:
    talk = Talk()
    talk.speaks(1.0, 2.0)
    talk.speaks(2.5, 3.5)
    talk.hears("the blue one", 2.5, 3.5, 3.9, id="second")
    talk.hears("I mean", 1.0, 2.0, 4.0, id="first")

    assert talk.told()[-1] == ("started", 4.0, "I mean the blue one", True)


def test_one_speech_may_have_several_utterances() -> None:
    talk = Talk()
    talk.asks(1.0, 2.0)
    talk.turn_ends()
    talk.speaks(2.5, 6.0)
    talk.hears("Which one?", 4.5, 5.5, 5.8, id="b")
    talk.hears("Wait.", 2.5, 3.0, 6.5, id="a")

    assert talk.told()[-1] == ("completed", 6.5, "Wait. Which one?", True)


def test_a_backchannel_has_its_words() -> None:
    talk = Talk()
    talk.asks(1.0, 6.0)
    talk.speaks(2.0, 2.5)
    talk.hears("uh-huh", 2.0, 2.5, 2.8)

    assert talk.told("backchannel")[-1] == ("completed", 2.8, "uh-huh", True)


# -- words alone -----------------------------------------------------------------------------------------------


def test_a_typed_line_answers_the_robot_at_once_with_its_words() -> None:
    talk = Talk()
    talk.asks(1.0, 2.0)
    talk.turn_ends()
    talk.hears("yes", 3.0, 3.0, 3.0)

    assert talk.told() == [
        ("started", 1.0, "", False), ("succeeded", 3.0, "yes", False), ("completed", 3.0, "yes", False),
    ]  # fmt: skip
    answer = next(one for one in talk.results if isinstance(one, ConnectionEvent) and one.state == "succeeded")
    assert (answer.delay, answer.response) == (1.0, "speak")


def test_a_typed_line_opens_a_pair() -> None:
    talk = Talk()
    talk.hears("hello robot", 3.0, 3.0, 3.0)
    talk.feed(ActionBegan(actor=ROBOT, action="speak", at=stamp(4.0), behavior="b:s"), 4.0)

    assert talk.told() == [("started", 3.0, "hello robot", False), ("succeeded", 4.0, "hello robot", False)]


def test_a_line_typed_into_the_robots_words_is_an_answer_and_no_backchannel() -> None:
    talk = Talk()
    talk.asks(1.0, 6.0)
    talk.hears("stop", 3.0, 3.0, 3.0)
    talk.turn_ends()

    assert talk.told("backchannel") == []
    assert talk.told()[1:] == [("succeeded", 6.0, "stop", False), ("completed", 6.0, "stop", False)]


def test_words_whose_speech_was_missed_are_judged_by_their_length() -> None:
    talk = Talk()
    talk.asks(1.0, 6.0)
    talk.hears("uh-huh", 2.0, 2.5, 2.9)

    assert [state for state, *_ in talk.told("backchannel")] == ["started", "succeeded", "completed"]
    assert {words for _, _, words, _ in talk.told("backchannel")} == {"uh-huh"}


def test_words_alone_make_a_stranger_known() -> None:
    talk = Talk()
    talk.hears("hello", 3.0, 3.0, 3.0, who="stranger")

    event = next(one for one in talk.results if isinstance(one, ConnectionEvent))
    assert (event.initiator, event.words) == ("stranger", "hello")


def test_speech_that_is_nothing_but_words_is_told_as_an_action() -> None:
    talk = Talk()
    talk.hears("hello", 3.0, 3.0, 3.0)

    actions = [one for one in talk.results if isinstance(one, ActionBegan | ActionEnded)]
    assert [(type(one), one.action, one.at.seconds) for one in actions] == [
        (ActionBegan, "speak", 3.0), (ActionEnded, "speak", 3.0),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "final", "confidence"),
    [("yes", False, 1.0), ("", True, 1.0), ("  ", True, 1.0), ("yes", True, 0.1)],
    ids=["partial", "no words", "blanks", "doubtful"],
)
def test_what_is_no_speech_by_itself(text: str, final: bool, confidence: float) -> None:
    talk = Talk()
    heard = TimedWords(
        actor=HUMAN, id="u", text=text, began=3.0, ended=3.0, final=final, confidence=confidence
    )  # fmt: skip
    talk.feed(heard, 3.0)

    assert talk.told() == []


# -- which speech ----------------------------------------------------------------------------------------------


def test_words_may_miss_their_speech_by_the_margin() -> None:
    talk = Talk()
    talk.asks(1.0, 2.0)
    talk.turn_ends()
    talk.speaks(2.5, 3.0)
    talk.hears("yes", 3.4, 3.8, 4.2)

    assert talk.told()[-1] == ("completed", 4.2, "yes", True)


def test_a_typed_line_belongs_only_to_speech_that_goes_on() -> None:
    talk = Talk()
    talk.asks(1.0, 2.0)
    talk.turn_ends()
    talk.speaks(2.5, 3.0)
    talk.hears("and another thing", 3.2, 3.2, 3.2)

    assert talk.told()[-1][::2] == ("started", "and another thing")  # a pair of its own


def test_words_belong_to_the_speech_that_they_overlap_longest() -> None:
    talk = Talk()
    talk.speaks(1.0, 2.0)
    talk.speaks(2.2, 3.2)
    talk.hears("more of the second", 1.8, 3.2, 3.5)
    talk.feed(ActionBegan(actor=ROBOT, action="speak", at=stamp(3.6), behavior="b:s"), 3.6)

    assert [words for _, _, words, _ in talk.told()][-1] == "more of the second"
