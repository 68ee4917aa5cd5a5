"""What people have said around a turn: against all messages looked at anew, once they have all come."""

import random

from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.units import Stamp
from engage_hri.services.generation.turns.outcomes import LOOKS_BACK, HeardWords


def at(seconds: float) -> Stamp:
    return Stamp("loop", seconds)


def said(who: str, id: str, text: str, began: float, known: float, *, final: bool = True) -> Utterance:
    return Utterance(actor=who, id=id, text=text, began=at(began), at=at(known), final=final)


def test_what_is_known_before_the_turn_is_not_of_it_unless_there_was_none() -> None:
    heard = HeardWords()
    heard.feed(said("ann", "1", "long ago", 1.0, 2.0), 2.0)
    heard.feed(said("ann", "2", "hello", 65.0, 66.0), 66.0)
    heard.turn_begins("t", 2.5 + LOOKS_BACK)
    heard.turn_ends(70.0)
    heard.feed(said("ann", "3", "yes", 71.0, 72.0), 72.0)
    assert [each.text for each in heard.of_turn("t")] == ["hello", "yes"]

    heard.turn_begins("u", 80.0)
    assert [each.text for each in heard.of_turn("u")] == ["yes"]  # who did not wait for the answer gets it now


def test_it_tells_whether_words_will_come() -> None:
    heard = HeardWords()
    assert not heard.expects("ann")
    heard.feed(said("ann", "1", "", 1.0, 1.0, final=False), 1.0)
    assert heard.expects("ann")
    assert heard.is_saying("ann", 0.5)
    assert not heard.is_saying("ann", 1.5)
    assert not heard.expects("bob")

    heard.feed(said("ann", "1", "yes", 1.0, 2.0), 2.0)
    heard.feed(said("ann", "1", "ye", 1.0, 1.5, final=False), 2.1)  # late
    assert not heard.is_saying("ann", 0.0)
    assert heard.expects("ann")

    heard.missed("ann")
    assert not heard.expects("ann")


def test_a_correction_is_told_with_the_turn_in_which_it_comes() -> None:
    heard = HeardWords()
    heard.turn_begins("t", 0.0)
    heard.feed(said("ann", "1", "the bread one", 1.0, 2.0), 2.0)
    heard.turn_ends(3.0)
    heard.turn_begins("u", 4.0)
    heard.feed(said("ann", "1", "the red one", 1.0, 4.5), 5.0)

    assert [each.text for each in heard.of_turn("u")] == ["the red one"]


@given(st.integers(0, 2**32 - 1))
def test_whatever_comes_in_whatever_order(seed: int) -> None:
    chance = random.Random(seed)
    messages = []
    for number in range(chance.randint(1, 12)):
        who, began = chance.choice(("ann", "bob")), chance.uniform(0, 50)
        for result in range(chance.randint(1, 4)):
            known = began + result + chance.random()
            message = said(who, str(number), f"{number}.{result}", began, known, final=chance.random() < 0.6)
            messages += [(known + chance.choice((0, 0.5, 3.0)), message)] * chance.randint(1, 2)
    messages.sort(key=lambda each: each[0])
    turn, heard = chance.uniform(0, 50), HeardWords()
    for now, message in messages:
        if now < turn:
            heard.feed(message, now)
    heard.turn_begins("before", 0.0)
    heard.turn_ends(turn)
    heard.turn_begins("t", turn + 1.0)
    for now, message in messages:
        if now >= turn:
            heard.feed(message, now)

    expected = []
    for key in {(message.actor, message.id) for _, message in messages}:
        of_it = [(now, each) for now, each in messages if (each.actor, each.id) == key]
        finals = [(each.at.seconds, now, each) for now, each in of_it if each.final]
        if finals:
            newest = max(at for at, _, _ in finals)
            came, message = min((now, each) for at, now, each in finals if at == newest)
            if came >= turn:
                expected.append((message.began.seconds, message.actor, message.id, message.text))
    assert [(each.began.seconds, each.actor, each.id, each.text) for each in heard.of_turn("t")] == sorted(expected)
