"""Words of listeners, and what words do to a robot that speaks: the turn policy alone."""

import pytest

from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.units import Stamp
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.turns.policy import LONGEST_LISTENING, TurnPolicy
from engage_hri.services.text.listening import is_listening

LISTENING = (
    "uh-huh", "Yes.", "yes yes okay", "hm hm hm hm", "Hmmm, mm-hmm!", "All right, I see.", "ja genau", "ach so",
    "d'accord", "sí, claro", "うんうん", "なるほど", "嗯 对",
)  # fmt: skip
OTHERS = (
    "stop", "stop please", "wait", "no", "yes but wait", "okay stop", "what?", "okay I see what you mean", "halt", "",
    "!", "righteous", "ja aber", "待って",
)  # fmt: skip


@pytest.mark.parametrize("text", LISTENING)
def test_words_of_a_listener(text: str) -> None:
    assert is_listening(text)


@pytest.mark.parametrize("text", OTHERS)
def test_words_that_are_more_than_a_listeners(text: str) -> None:
    assert not is_listening(text)


def speaking() -> TurnPolicy:
    """A robot that speaks to ann since 1.0."""
    policy = TurnPolicy("robot", GenerationConfig())
    policy.accept(TurnFragment(id="f", turn_status="full", addressee="ann"), "ann")
    policy.fragment_begins("f")
    policy.feed(began("robot", 1.0), 1.0)
    return policy


def began(actor: str, at: float) -> ActionBegan:
    return ActionBegan(actor=actor, action="speak", at=Stamp("loop", at))


@pytest.mark.parametrize(
    ("text", "is_final", "is_line", "since", "takes"),
    [
        ("stop", True, False, 2.0, True),
        ("stop", False, False, 2.0, False),
        ("stop", True, True, 2.0, True),
        ("yes", True, True, 2.0, True),
        ("yes", True, False, 2.0, False),
        ("stop", True, False, 0.5, False),
        (" ", True, False, 2.0, False),
    ],
    ids=["words", "partial", "line", "yes as a line", "yes", "said before the turn", "no words"],
)
def test_which_words_take_the_floor_without_a_voice(
    text: str, since: float, *, is_final: bool, is_line: bool, takes: bool
) -> None:
    policy = speaking()
    policy.hear("ann", text, began=since, is_final=is_final, is_line=is_line)

    aborted = policy.tick(2.5)
    assert (aborted is not None and aborted.why.reason == "ann took the floor") == takes


def test_words_of_others_take_nothing() -> None:
    policy = speaking()
    policy.hear("bob", "stop", began=2.0, is_final=True, is_line=False)

    assert policy.tick(2.5) is None


def test_a_voice_with_a_listeners_words_is_borne_for_long_but_not_for_ever() -> None:
    policy = speaking()
    policy.feed(began("ann", 2.0), 2.0)
    policy.hear("ann", "yes yes", began=2.0, is_final=False, is_line=False)

    assert policy.tick(2.0 + LONGEST_LISTENING - 0.01) is None
    assert policy.tick(2.0 + LONGEST_LISTENING) is not None


def test_more_words_after_a_listeners_leave_it_to_the_voice_again() -> None:
    policy = speaking()
    policy.feed(began("ann", 2.0), 2.0)
    policy.hear("ann", "yes", began=2.0, is_final=False, is_line=False)
    assert policy.tick(3.0) is None
    policy.hear("ann", "yes but", began=2.0, is_final=False, is_line=False)

    assert policy.tick(3.1) is not None


def test_words_of_one_turn_do_not_cut_the_next() -> None:
    policy = speaking()
    policy.hear("ann", "stop", began=2.0, is_final=True, is_line=False)
    policy.turn_ended("f")
    policy.fragment_ended("f", complete=True, now=2.1)
    policy.accept(TurnFragment(id="g", turn_status="full", addressee="ann"), "ann")

    assert policy.tick(3.0) is None
