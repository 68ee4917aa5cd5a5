"""Turns of speech in the page: one bubble for each, with what was not said apart."""

from typing import Literal

from engage_hri.schemas.blocks import BlockOutcome, BlockProgress, Held, Hold, NetPlanned, NetSpeech, SpokenText
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerGone
from engage_hri.schemas.perception import ActionBegan, ActionEnded, Utterance
from engage_hri.services.console.web.picture import Picture
from engage_hri.services.console.web.sections import Left
from engage_hri.services.console.web.sections import UtteranceShown as Turn
from tests.console.scenes import at


class Told:
    """A picture that is told of blocks; a tenth of a second goes by with each message."""

    def __init__(self) -> None:
        self.now = 10.0
        self.picture = Picture("robot", 10.0)

    def tell(self, message: Message) -> None:
        self.now += 0.1
        self.picture.feed(message, self.now, self.now)

    def begins(self, block: str, *texts: str, follows: tuple[str, ...] = ()) -> None:
        speeches = tuple(NetSpeech(behavior=f"s{number}", text=text) for number, text in enumerate(texts))
        self.tell(BlockProgress(block=block, progress="start", at=at(self.now)))
        began = at(self.now)
        self.tell(NetPlanned(block=block, at=began, transitions=(), places=(), speeches=speeches, follows=follows))

    def says(self, block: str, number: int, words: str, *, ends: bool = True) -> None:
        behavior, position = f"{block}:s{number}", 0
        self.tell(ActionBegan(actor="robot", action="speak", at=at(self.now), behavior=behavior))
        for word in words.split():
            position += len(word) + (position > 0)
            self.tell(WordSpoken(block=block, behavior=f"s{number}", word=word, position=position, at=at(self.now)))
        if ends:
            self.tell(ActionEnded(actor="robot", action="speak", at=at(self.now), behavior=behavior))

    def ends(self, block: str, status: Literal["done", "failed", "interrupted"] = "done") -> None:
        self.tell(BlockProgress(block=block, progress="end", at=at(self.now), status=status))

    @property
    def turns(self) -> list[Turn]:
        return self.picture._words()

    @property
    def last(self) -> tuple[str, tuple[Left, ...], str, bool]:
        turn = self.turns[-1]
        return (turn.words, turn.left, turn.state, turn.open)


def test_a_turn_of_several_speeches_is_one_that_grows() -> None:
    told = Told()
    told.begins("ask", "Please move", "the blue piece", "to the left.")
    told.says("ask", 0, "Please move")
    assert told.last == ("Please move", (), "", True)
    told.says("ask", 1, "the blue", ends=False)
    assert told.last == ("Please move the blue", (), "", True)
    assert told.turns[-1].settled == len("Please move")

    told.tell(WordSpoken(block="ask", behavior="s1", word="piece", position=14, at=at(told.now)))
    told.tell(ActionEnded(actor="robot", action="speak", at=at(told.now), behavior="ask:s1"))
    told.says("ask", 2, "to the left.")
    told.ends("ask")

    assert told.last == ("Please move the blue piece to the left.", (), "", False)
    assert told.turns[-1].settled == len("Please move the blue piece to the left.")
    assert len(told.turns) == 1


def test_what_a_stop_left_unsaid_stands_apart() -> None:
    told = Told()
    told.begins("ask", "Please move", "the blue piece", "to the left.")
    told.says("ask", 0, "Please move")
    told.says("ask", 1, "the blue")
    told.ends("ask", "interrupted")

    left = (Left(len("Please move the blue"), "piece to the left."),)
    assert told.last == ("Please move the blue", left, "stopped", False)


def test_what_is_held_is_still_to_come() -> None:
    told = Told()
    told.begins("ask", "Please move", "the blue piece")
    told.says("ask", 0, "Please", ends=False)
    told.tell(Held(at=at(told.now), holds=(Hold(since=at(told.now), until=at(told.now + 60)),)))

    assert told.last == ("Please", (Left(6, "move the blue piece"),), "held", True)

    told.tell(Held(at=at(told.now)))
    assert told.last == ("Please", (), "", True)


def test_a_hold_of_another_block_holds_no_words() -> None:
    told = Told()
    told.begins("ask", "Please move")
    told.says("ask", 0, "Please", ends=False)
    told.tell(Held(at=at(told.now), holds=(Hold(since=at(told.now), until=at(told.now + 60), block="other"),)))

    assert told.last == ("Please", (), "", True)


def test_a_speech_that_was_left_out_stands_where_it_would_have_been() -> None:
    told = Told()
    told.begins("ask", "Please move", "the blue piece", "to the left.")
    told.says("ask", 0, "Please move")
    told.says("ask", 2, "to the left.")
    told.ends("ask")

    left = (Left(len("Please move"), "the blue piece"),)
    assert told.last == ("Please move to the left.", left, "left", False)


def test_blocks_of_one_turn_are_one_and_what_comes_later_is_another() -> None:
    told = Told()
    told.begins("a", "Well,")
    told.says("a", 0, "Well,")
    told.begins("b", "let us begin.", follows=("a",))
    told.ends("a")
    told.says("b", 0, "let us begin.")
    told.ends("b")
    told.begins("c", "Good.")
    told.says("c", 0, "Good.")

    assert [turn.words for turn in told.turns] == ["Well, let us begin.", "Good."]


def test_a_block_that_comes_again_under_its_name_is_a_turn_of_its_own() -> None:
    told = Told()
    for _ in range(2):
        told.begins("hello", "Good morning.")
        told.says("hello", 0, "Good morning.")
        told.ends("hello")

    assert [turn.words for turn in told.turns] == ["Good morning.", "Good morning."]


def test_of_a_voice_that_tells_no_words_the_end_of_the_block_says_what_was_said() -> None:
    told = Told()
    told.begins("ask", "Please move", "the blue piece")
    told.tell(ActionBegan(actor="robot", action="speak", at=at(told.now), behavior="ask:s0"))
    assert told.last == ("", (), "", True)
    told.tell(ActionEnded(actor="robot", action="speak", at=at(told.now), behavior="ask:s0"))
    assert told.last == ("Please move", (), "", True)

    spoken = (SpokenText(behavior="s0", text="Please", complete=False),)
    told.tell(BlockOutcome(id="r", requester="m", block="ask", status="interrupted", spoken=spoken))
    told.ends("ask", "interrupted")

    assert told.last == ("Please", (Left(6, "move the blue piece"),), "stopped", False)


def test_a_turn_ends_with_the_realizer_that_said_it() -> None:
    told = Told()
    told.begins("ask", "Please move")
    told.says("ask", 0, "Please")
    told.tell(PeerGone(participant="realizer"))

    assert told.last == ("Please", (Left(6, "move"),), "lost", False)


def test_people_have_a_turn_for_each_utterance_also_in_the_middle_of_one_of_the_robot() -> None:
    told = Told()
    told.begins("ask", "Please move", "the blue piece.")
    told.says("ask", 0, "Please move")
    now = at(told.now)
    told.tell(Utterance(actor="ann", id="u", text="wait", began=now, at=now))
    told.says("ask", 1, "the blue piece.")

    assert [(turn.actor, turn.words) for turn in told.turns] == [
        ("robot", "Please move the blue piece."), ("ann", "wait"),
    ]  # fmt: skip


def test_a_window_that_knows_no_net_shows_the_words_as_they_come() -> None:
    told = Told()
    told.says("ask", 0, "Please move", ends=False)

    assert told.last == ("Please move", (), "", True)
