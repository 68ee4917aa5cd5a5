"""What a fragment names is found in the world, whatever its letters: in all places, and in one way."""

import asyncio

import pytest

from engage_hri import perceive
from engage_hri.schemas.behaviors import (
    FragmentBehavior,
    Gaze,
    GazeShift,
    HeadDirectionShift,
    Pointing,
    Reference,
    Speech,
    SpeechOption,
)
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.summary import Summary, summary
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import perform_call, stream
from engage_hri.services.generation.fragment_check import bearable, names
from tests.generation.test_chosen_again import cup, robot

WORLD = World(
    entities=(
        *(Entity(id=id, kind="object", position=(0.5, 0.0, 0.8)) for id in ("cup", "Box", "bOx", "Straße")),
        Entity(id="Table", kind="surface", position=(0.5, 0.0, 0.7)),
        Entity(id="Ann", kind="person", position=(1.0, 0.0, 1.3)),
    )
)
WORDS = Speech(id="s", text="Here.")
OPTION = SpeechOption(text="this", cost=1.0, distractors=("CUP", "bOx"))
WHOLE = TurnFragment(
    id="f",
    addressee="ANN",
    delay=True,
    turn_status="beginning",
    delay_target="TABLE",
    behaviors=(
        WORDS,
        Gaze(id="a", target="CUP"),
        GazeShift(id="b", target="ann"),
        HeadDirectionShift(id="c", target="table"),
        Pointing(id="d", target="strasse"),
        Reference(id="e", target="STRASSE", options=(OPTION,)),
    ),
)
NAMED = ["cup", "Ann", "Table", "Straße", "Straße", "cup", "bOx", "Ann", "Table"]


def test_every_place_of_a_fragment_that_names_something_is_found() -> None:
    found = {each.path: each.id for each in names(WHOLE)}

    assert found == {
        "$.behaviors[1].target": "CUP", "$.behaviors[2].target": "ann", "$.behaviors[3].target": "table",
        "$.behaviors[4].target": "strasse", "$.behaviors[5].target": "STRASSE",
        "$.behaviors[5].options[0].distractors[0]": "CUP", "$.behaviors[5].options[0].distractors[1]": "bOx",
        "$.addressee": "ANN", "$.delay_target": "TABLE",
    }  # fmt: skip


def test_an_id_in_other_letters_names_the_one_that_differs_in_nothing_else() -> None:
    found, warnings = bearable(WHOLE, WORLD, "robot")

    assert sorted(each.id for each in names(found)) == sorted(NAMED)
    assert warnings == ("ids were written in other letters than the world has: CUP, ann, table and 4 more",)


@pytest.mark.parametrize(
    "behavior", [Gaze(id="g", target="BOX"), Pointing(id="g", target="BOX"), Reference(id="g", target="BOX")]
)
def test_what_could_be_two_objects_is_none(behavior: FragmentBehavior) -> None:
    _, (warning,) = bearable(TurnFragment(id="f", behaviors=(WORDS, behavior)), WORLD, "robot")

    assert "the world does not know" in warning
    assert "did you mean" in warning


async def told_of(*, streamed: bool) -> Summary:
    hub = MemoryHub()
    async with robot(hub) as (client, _), perceive("ann", hub=hub) as ann:
        ann.bring(cup(0.5, 0.2, 0.8))
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        if not streamed:
            parts = [{"say": "Take"}, {"refer": "CUP"}, {"say": "please."}]
            return await perform_call(client, {"turn_status": "full", "parts": parts})

        async def text():
            yield "Take [CUP] please."

        return summary(*await stream(client, text(), id="f"))


async def test_a_bracket_and_a_part_refer_to_the_same_object_in_other_letters() -> None:
    by_part, by_bracket = [await told_of(streamed=each) for each in (False, True)]

    assert by_part.references[0].object == "cup"
    assert (by_part.said, by_part.references) == (by_bracket.said, by_bracket.references)
    (problem,) = by_part.problems
    assert by_bracket.problems == (problem.replace("CUP", "[CUP]"),)
