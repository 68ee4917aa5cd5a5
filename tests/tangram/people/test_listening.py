"""The person who understands requests."""

from functools import partial

import pytest

from engage_hri.schemas.blocks import BlockProgress
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.units import Stamp
from engage_hri.services.simulation.company import ListeningHuman
from engage_hri.services.simulation.human import Act, Human, Lay, Leave
from engage_hri.services.tangram.people.stochastic import requested_placement
from engage_hri.services.tangram.table import tangram_table

AT = Stamp("loop", 0.0)
ASKED = partial(requested_placement, table=tangram_table())


def hears(human: Human, text: str, pointing_at: str = "") -> list[Act]:
    """What the person does after the robot has said `text`, pointing (if it does) during "this" or "that"."""
    for word in text.split():
        pointed = pointing_at and word in ("this", "that")
        if pointed:
            human.feed(ActionBegan(actor="robot", action="point", targets=(pointing_at,), at=AT), 0.0)
        human.feed(WordSpoken(block="any", behavior="speech-1", word=word, position=0, at=AT), 0.0)
        if pointed:
            human.feed(ActionEnded(actor="robot", action="point", targets=(pointing_at,), at=AT), 0.0)
    human.feed(BlockProgress(block="any", progress="end", status="done", at=AT), 0.0)
    acts: list[Act] = []
    while due := human.due(100.0):
        acts += due
    return acts


@pytest.mark.parametrize(
    ("words", "pointing_at", "lay"),
    [
        (
            "Please move the blue piece so that it is touching the top of the rectangle.",
            "",
            Lay("blue-square", "top", "rectangle"),
        ),
        (
            "Please move this so that it is touching the left side of the blue piece.",
            "green-square",
            Lay("green-square", "left", "blue-square"),
        ),
        (
            "Please fix that so that it is touching the top right of the pink square.",
            "purple-triangle",
            Lay("purple-triangle", "top right", "pink-square"),
        ),
    ],
)
def test_a_request_is_understood(words: str, pointing_at: str, lay: Lay) -> None:
    assert lay in hears(ListeningHuman(ASKED), words, pointing_at)


@pytest.mark.parametrize(
    "words",
    [
        "Please move the square so that it is touching the top of the rectangle.",
        "Please move that so that it is touching the top of the rectangle.",
        "Please move the blue piece so that it is touching the belly of the rectangle.",
        "Okay, let's start.",
    ],
    ids=["which square", "nothing pointed at", "no such side", "no request"],
)
def test_what_cannot_be_understood_moves_nothing(words: str) -> None:
    assert not any(isinstance(act, Lay) for act in hears(ListeningHuman(ASKED), words))


def test_the_person_leaves_after_the_goodbye() -> None:
    assert Leave() in hears(
        ListeningHuman(ASKED),
        "Thanks for playing. That was fun, goodbye.",
    )
