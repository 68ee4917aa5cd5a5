"""What ends a turn, or a part of it, early: refusals, faults, barge-ins; and who is told."""

import pytest

from engage_hri.schemas.fragments import TurnStatus
from engage_hri.services.generation.turns.policy import Aborted, TurnPolicy
from tests.generation.test_turn_policy import fragment, policy, says


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
        turns.turn_ended("a")

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


# -- barge-in -----------------------------------------------------------------------------------------------------


def talked_into() -> TurnPolicy:
    """The robot has said a sentence of two, the human began to speak 0.3 s before its end."""
    turns = policy()
    turns.accept(fragment("a", "beginning"), "human")
    turns.accept(fragment("b", "end"), "")
    turns.feed(says("robot"), 1.0)
    turns.feed(says("human"), 2.0)
    turns.feed(says("robot", ends=True), 2.3)
    return turns


def test_a_barge_in_goes_on_into_the_next_sentence_of_the_turn() -> None:
    turns = talked_into()
    turns.feed(says("robot"), 2.3)

    assert turns.deadline == 2.8
    assert told(turns.tick(2.8)) == ("a", "human", ("a", "b"), "human took the floor")


def test_nobody_is_talked_into_between_two_sentences() -> None:
    turns = talked_into()

    assert turns.deadline is None
    assert turns.tick(5.0) is None


def test_who_begins_to_speak_between_two_sentences_is_heard_from_where_the_robot_goes_on() -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "human")
    turns.feed(says("robot"), 1.0)
    turns.feed(says("robot", ends=True), 2.0)
    turns.feed(says("human"), 3.0)
    turns.feed(says("robot"), 6.0)

    assert turns.deadline == 6.8


def test_who_spoke_before_the_robot_began_its_turn_is_not_interrupting_it() -> None:
    turns = policy()
    turns.feed(says("human"), 0.0)
    turns.accept(fragment("a", "full"), "human")
    turns.feed(says("robot"), 1.0)

    assert turns.deadline is None


def test_an_answer_after_the_end_of_the_turn_does_not_count_against_the_next() -> None:
    turns = policy()
    turns.accept(fragment("a", "full"), "human")
    turns.fragment_begins("a")
    turns.feed(says("robot"), 1.0)
    turns.feed(says("human"), 2.0)
    turns.turn_ended("a")
    turns.accept(fragment("b", "full"), "human")
    turns.feed(says("robot", ends=True), 2.1)
    turns.fragment_ended("a", complete=True, now=2.2)
    turns.feed(says("robot"), 2.3)

    assert turns.deadline is None


def test_somebody_else_talking_does_not_hide_the_barge_in_of_who_is_spoken_to() -> None:
    turns = policy()
    turns.accept(fragment("a", "full"), "alice")
    turns.feed(says("robot"), 1.0)
    turns.feed(says("bob"), 1.5)
    turns.feed(says("alice"), 1.75)
    turns.tick(2.3)

    assert told(turns.tick(2.55)) == ("a", "alice", ("a",), "alice took the floor")


def test_nobody_barges_into_a_backchannel() -> None:
    turns = policy()
    turns.accept(fragment("a", "backchannel"), "human")
    turns.feed(says("robot"), 1.0)
    turns.feed(says("human"), 1.1)

    assert turns.tick(3.0) is None
