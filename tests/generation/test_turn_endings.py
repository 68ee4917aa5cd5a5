"""What ends a turn, or a part of it, early: refusals, faults, barge-ins; and who is told."""

import pytest

from engage_hri.schemas.fragments import TurnStatus
from engage_hri.schemas.recognition import Interjection, InterjectionReading
from engage_hri.schemas.units import Stamp
from engage_hri.services.generation.turns.robot_turns import Aborted, RobotTurns
from tests.generation.test_turn_policy import fragment, policy
from tests.generation.turns import robot_turns


def told(aborted: Aborted | None) -> tuple[str, str, tuple[str, ...], str]:
    """A turn that was aborted, and why."""
    assert aborted is not None
    return (aborted.turn, aborted.addressee, aborted.fragments, aborted.why.reason)


# -- a fragment that the realizer refuses -------------------------------------------------------------------------


@pytest.mark.parametrize("status", ["middle", "end"])
def test_a_refused_fragment_leaves_its_turn_as_it_was(status: TurnStatus) -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "human")
    turns.accept(fragment("b", status), "")

    assert turns.fragment_refused("b", 1.0) is None
    assert turns.accept(fragment("c", "end"), "").turn == "a"


def test_a_turn_whose_first_fragment_is_refused_was_none() -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "human")
    turns.accept(fragment("b", "end"), "")

    assert told(turns.fragment_refused("a", 1.0)) == ("a", "human", ("b",), "a was refused")
    assert not turns.holds_the_turn


def test_a_turn_cannot_be_opened_again_once_the_next_has_begun() -> None:
    turns = policy()
    for id, status in [("a", "beginning"), ("b", "end"), ("c", "beginning")]:
        turns.accept(fragment(id, status), "human")  # type: ignore[arg-type]

    assert told(turns.fragment_refused("b", 1.0)) == ("a", "human", ("a",), "b was refused")
    assert turns.open_turn == "c"


def test_the_silence_after_a_refused_fragment_counts() -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "human")
    turns.fragment_ended("a", complete=True, now=1.0)
    turns.accept(fragment("b", "middle"), "")
    turns.fragment_refused("b", 2.0)

    assert turns.deadline == 12.0


# -- who is told of an aborted turn -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("begins", "ends", "known"), [(False, False, False), (True, False, True), (True, True, False)]
)
def test_a_turn_is_aborted_aloud_if_it_had_begun_and_was_not_over(begins: bool, ends: bool, known: bool) -> None:
    turns = policy()
    turns.accept(fragment("a", "full"), "human")
    if begins:
        turns.fragment_begins("a")
    if ends:
        turns.turn_ended("a", 1.0)

    aborted = turns.fragment_ended("a", complete=False, now=1.0)

    assert aborted is not None
    assert aborted.is_known is known


def test_a_turn_that_began_with_an_earlier_fragment_is_aborted_aloud() -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "human")
    turns.fragment_begins("a")
    turns.fragment_ended("a", complete=True, now=1.0)
    turns.accept(fragment("b", "end"), "")

    aborted = turns.fragment_ended("b", complete=False, now=2.0)

    assert aborted is not None
    assert aborted.is_known


# -- what is said into the turn -----------------------------------------------------------------------------------


def into(reading: InterjectionReading, actor: str = "human", since: float = 2.0) -> Interjection:
    stamp = Stamp("test", since)
    return Interjection(actor=actor, since=stamp, at=stamp, reading=reading, words="so it is")


def speaking(barge_in: float | None = None) -> RobotTurns:
    """The robot says a sentence of two."""
    turns = robot_turns(barge_in=barge_in)
    turns.accept(fragment("a", "beginning"), "human")
    turns.fragment_begins("a")
    turns.accept(fragment("b", "end"), "")
    return turns


def test_what_is_undecided_holds_the_turn_and_an_interruption_ends_it() -> None:
    turns = speaking()
    turns.feed(into("open"), 2.0)
    before = turns.held
    turns.feed(into("interruption"), 2.6)

    assert before == "a"
    assert told(turns.tick(2.6)) == ("a", "human", ("a", "b"), "human took the floor")
    (kept,) = turns.interjections.of_turn("a")
    assert (kept.actor, kept.reading, kept.words, kept.went_on) == ("human", "interruption", "so it is", False)
    assert kept.held == pytest.approx(0.6)


@pytest.mark.parametrize("reading", ["backchannel", "noise", "other", "answer"])
def test_after_anything_else_the_turn_goes_on(reading: InterjectionReading) -> None:
    turns = speaking()
    turns.feed(into("open"), 2.0)
    turns.feed(into(reading), 2.5)

    assert (turns.held, turns.tick(2.5), turns.deadline) == ("", None, None)
    (kept,) = turns.interjections.of_turn("a")
    assert (kept.reading, kept.held, kept.went_on) == (reading, 0.5, True)


def test_what_nobody_decides_holds_the_turn_for_three_seconds() -> None:
    turns = speaking()
    turns.feed(into("open"), 2.0)

    assert turns.deadline == 5.0
    assert (turns.tick(4.99), turns.held) == (None, "a")
    assert (turns.tick(5.0), turns.held) == (None, "")
    turns.feed(into("interruption"), 6.0)
    assert turns.tick(6.0) is not None, "better late than never"


def test_of_two_who_speak_both_have_to_be_decided() -> None:
    turns = speaking()
    turns.feed(into("open"), 2.0)
    turns.feed(into("open", since=2.5), 2.5)
    turns.feed(into("noise"), 2.5)
    before = turns.held
    turns.feed(into("backchannel", since=2.5), 3.0)

    assert (before, turns.held) == ("a", "")


def test_what_somebody_else_says_neither_holds_nor_ends_the_turn() -> None:
    turns = speaking()
    turns.feed(into("open", "passer-by"), 2.0)
    turns.feed(into("interruption", "passer-by"), 2.8)

    assert (turns.held, turns.tick(3.0)) == ("", None)
    [into_it] = turns.interjections.of_turn("a")
    assert (into_it.actor, into_it.held, into_it.went_on) == ("passer-by", 0.0, True)


def test_what_was_said_into_one_turn_does_not_cut_the_next() -> None:
    turns = policy()
    turns.accept(fragment("a", "full"), "human")
    turns.fragment_begins("a")
    turns.feed(into("open"), 2.0)
    turns.turn_ended("a", 2.1)
    turns.accept(fragment("b", "full"), "human")
    turns.fragment_ended("a", complete=True, now=2.2)
    turns.fragment_begins("b")
    turns.feed(into("interruption"), 2.8)

    assert (turns.held, turns.tick(3.0)) == ("", None)


@pytest.mark.parametrize("status", ["backchannel", "full"])
def test_nobody_talks_into_a_backchannel_or_a_turn_that_has_not_begun(status: TurnStatus) -> None:
    turns = policy()
    turns.accept(fragment("a", status), "human")
    if status == "backchannel":
        turns.fragment_begins("a")
    turns.feed(into("open"), 1.1)

    assert (turns.held, turns.tick(9.0)) == ("", None)


@pytest.mark.parametrize("ends", [True, False])
def test_a_voice_takes_the_floor_by_its_length_only_if_that_is_set(*, ends: bool) -> None:
    turns = speaking(barge_in=0.5)
    turns.feed(into("open"), 2.0)
    if ends:
        turns.interjections.falls_silent("human")

    assert (turns.tick(2.5) is None) == ends
