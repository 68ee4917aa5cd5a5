"""What was in time, and what not, where something else is known late: limits, holds, answers of one instant, ids."""

import pytest

from engage_hri.schemas.behaviors import TurnSignal
from engage_hri.schemas.recognition import Interjection, SignalTurn
from engage_hri.services.recognition.events.scene import Worded
from tests.recognition.observations import ROBOT, Log, request_event, stamp


class Talking(Log):
    """A log of ann and bob, whom the robot asks."""

    def __init__(self) -> None:
        super().__init__("ann", "bob")

    def asks(self, *people: str, since: float) -> None:
        """Ask people in one turn; only its beginning is told."""
        for one in people:
            self.feed(request_event("adjacency_pair", since, request=one, block="t", turn="t", responder=one), since)
        self.begins(ROBOT, "speak", since, behavior="t:s")

    def has_asked(self, at: float) -> None:
        self.ends(ROBOT, "speak", at, behavior="t:s")
        over = TurnSignal(id="over", turn="t", signal="ended")
        self.feed(SignalTurn(id="over", requester="realizer", signal=over, at=stamp(at), block="t"), at)

    def types(self, person: str, at: float) -> None:
        self.feed(Worded(actor=person, since=at, text="the red one", is_alone=True, is_line=True), at)
        self.begins(person, "speak", at)
        self.ends(person, "speak", at)

    def pairs(self, initiator: str = ROBOT) -> list[tuple[str, str, float, str]]:
        """Whose, state, delay and by whom, of all that is told of pairs."""
        return [
            (each.responder, each.state, round(each.delay or 0.0, 3), each.answered_by)
            for each in self.events
            if each.kind == "adjacency_pair" and each.initiator == initiator and each.state != "started"
        ]


def test_an_answer_after_the_limit_is_late_also_if_somebody_else_may_have_answered_in_time() -> None:
    """The robot listens, so that it does not wait for bob, of whom it is not known to whom he speaks."""
    log = Talking()
    log.asks("ann", since=1.0)
    log.has_asked(2.0)
    log.begins("bob", "speak", 3.4)
    log.requests_event("backchannel", 3.45, responder="ann", block="b")
    log.begins(ROBOT, "speak", 3.45, behavior="b:s")
    log.types("ann", 3.8)
    log.ends(ROBOT, "speak", 3.9, behavior="b:s")
    log.ends("bob", "speak", 4.0)
    log.until(50.0)

    assert log.pairs() == [("ann", "failed", 2.5, ""), ("ann", "failed", 1.8, "")]  # since its start; late


def test_who_interrupts_waits_for_nobody_also_after_a_sound_of_their_own() -> None:
    """When bob is asked it is not decided yet that he has coughed, nor to whom ann speaks."""
    log = Talking()
    log.feed(Worded(actor="ann", since=0.5, text="", is_announced=True), 0.5)
    log.looks("bob", ROBOT, 0.9)
    log.begins("bob", "speak", 1.0)
    log.begins("ann", "speak", 1.5)
    log.ends("bob", "speak", 1.8)
    log.asks("bob", since=2.0)
    log.begins("bob", "speak", 2.2)
    log.feed(Worded(actor="bob", since=2.2, text="stop, that is not mine"), 3.0)
    log.until(4.0)

    told = [(each.reading, each.at.seconds) for each in log.effects if isinstance(each, Interjection)]
    assert told == [("open", 2.2), ("interruption", 3.0)]


@pytest.mark.parametrize("first", ["ann", "bob"])
def test_of_two_who_answer_in_one_instant_the_same_has_answered_for_the_rest(first: str) -> None:
    """Whoever of the two is told of first. It is known at once that bob's line is for the robot."""
    log = Log("ann", "bob", "cy")
    for one in ("cy", "bob", "ann"):
        log.feed(request_event("adjacency_pair", 1.0, request=one, block="t", turn="t", responder=one), 1.0)
    log.begins(ROBOT, "speak", 1.0, behavior="t:s")
    line = Worded(actor="bob", since=2.0, text="the red one", is_alone=True, is_line=True)
    for one in (first, "bob" if first == "ann" else "ann"):
        if one == "bob":
            log.feed(line, 2.0)
        log.begins(one, "speak", 2.0)
        if one == "bob":
            log.ends(one, "speak", 2.0)
    log.ends(ROBOT, "speak", 2.5, behavior="t:s")
    over = TurnSignal(id="over", turn="t", signal="ended")
    log.feed(SignalTurn(id="over", requester="realizer", signal=over, at=stamp(2.5), block="t"), 2.5)
    log.ends("ann", "speak", 3.0)
    log.until(50.0)

    answered = {each.responder: each.answered_by for each in log.events if each.state == "succeeded"}
    assert answered == {"ann": "ann", "bob": "bob", "cy": "ann"}


def test_who_turns_out_to_be_another_answers_late_all_the_same() -> None:
    log = Talking()
    log.asks("bob", since=1.0)
    log.has_asked(2.0)
    log.until(5.0)
    log.session.join("bob", "ann", 5.0)
    log.looks("ann", ROBOT, 5.5)
    log.begins("ann", "speak", 6.0)
    log.ends("ann", "speak", 7.0)
    log.until(50.0)

    assert log.pairs() == [("bob", "failed", 2.5, ""), ("ann", "failed", 4.0, "")]
    assert log.pairs("ann") == []


def test_who_turns_out_to_be_another_closes_the_exchange_all_the_same() -> None:
    """A third turn is no first one."""
    log = Talking()
    log.looks("bob", ROBOT, 0.5)
    log.begins("bob", "speak", 1.0)
    log.ends("bob", "speak", 2.0)
    log.begins(ROBOT, "speak", 2.5, behavior="r:s")
    log.ends(ROBOT, "speak", 3.5, behavior="r:s")
    log.session.join("bob", "ann", 3.6)
    log.looks("ann", ROBOT, 3.7)
    log.begins("ann", "speak", 4.0)
    log.ends("ann", "speak", 4.5)
    log.until(50.0)

    assert log.pairs("ann") == []
