"""Words of listeners."""

import pytest

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
