"""Samples of three kinds of reports: brackets that name nothing, marks that are read out, sentences cut in two.

Each is told by what comes out of a whole robot, or of the cutting of a stream: nothing here knows how text is read.
"""

import asyncio
from collections.abc import AsyncIterator

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.summary import Summary
from engage_hri.schemas.tool import Say
from engage_hri.services.client.chunking import Chunker
from engage_hri.services.client.language_models import perform_call
from tests.client.test_streaming_robot import stage, told, writing


def letters(text: str) -> str:
    return "".join(each for each in text if each.isalnum())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Press [Enter](https://example.org/a_(b)) now.", "Press Enter now."),
        ("The list[2] entry is free.", "The list 2 entry is free."),
        ("Water boils at 100 degrees [7, 8].", "Water boils at 100 degrees."),
        ("[sighs heavily] I see.", "I see."),
        ("* [X] open the door.", "open the door."),
        ("This is [[wiki]] style.", "This is wiki style."),
        ("Ask [human] for it.", "Ask human for it."),
        ("It was [not] so.", "It was not so."),
        ("See ![a photo](p.png) there.", "See a photo there."),
        ("Read [the docs][1] first.", "Read the docs first."),
        ("A note[^note] is here.", "A note is here."),
        ("The matrix[i][j] is full.", "The matrix i j is full."),
    ],
)
async def test_a_bracket_that_names_no_object_costs_no_words(text: str, said: str) -> None:
    async with stage() as here:
        result: Summary = await told(here.robot, writing(text[:9], text[9:], " Then we go on."))

    assert result.status == "done"
    assert letters(result.said) == letters(said + "Then we go on.")
    assert not result.references


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("__Bold__ and ~~gone~~ words", "Bold and gone words"),
        ("## Steps to take", "Steps to take"),
        ("Use `cup` now", "Use cup now"),
        ("> Someone said it", "Someone said it"),
        ("| left | right |\n|---|---|\n| red | blue |", "left right red blue"),
        ("See <https://example.org/a> please", "See example.org please"),
        ("Tea &amp; cake", "Tea & cake"),
        ("I am <em>sure</em>", "I am sure"),
        ("<break time='1s'/>Hello", "Hello"),
        ("Well <!-- not this --> done", "Well done"),
        ("***Really*** nice 🎉🎉", "Really nice"),
        ("```\nx = 1\n```\nThat is it", "x = 1 That is it"),
    ],
)
async def test_a_voice_is_given_no_marks(text: str, said: str) -> None:
    async with stage() as here:
        with here.person.subscribe(keys.SYNC_POINT) as inbox:
            result = await perform_call(here.robot, {"turn_status": "full", "parts": [{"say": text}]})
            heard = await _words(inbox)

    assert result.status == "done"
    assert [each.strip(",") for each in heard] == said.split()


async def _words(inbox: object) -> list[str]:
    found: list[str] = []
    while True:
        try:
            async with asyncio.timeout(0.1):
                received = await anext(inbox)  # type: ignore[call-overload]
        except TimeoutError:
            return found
        if isinstance(received.message, WordSpoken):
            found.append(received.message.word)


@pytest.mark.parametrize(
    "sentence",
    [
        "The train leaves at 6 p.m. tomorrow.",
        "Siehe Abb. 4 im Text.",
        "Er wohnt am 2. Weg links.",
        "Es sind ca. drei Kilo.",
        "La Sra. Lopez llega hoy.",
        "See Fig. 2 for this.",
        "Il sig. Rossi viene oggi.",
        "Take approx. five grams.",
        "Vol. 3 is here.",
        "Dat is bijv. een kopje.",
        "Voir p. ex. la page deux.",
        '"Stop!" he cried out.',
        "Der Hr. Meier kommt.",
        "(It rains.) but we go.",
        "“Wait.” she said.",
        "「行こう。」と言った。",
    ],
)
def test_a_sentence_is_not_cut_in_two(sentence: str) -> None:
    chunker = Chunker()
    made = [chunk for character in f"{sentence} " for chunk in chunker.feed(character)]
    made += filter(None, [chunker.rest()])

    assert [part.say for chunk in made for part in chunk if isinstance(part, Say)] == [sentence]


async def test_a_stream_of_stage_directions_alone_ends_well_and_tells_them() -> None:
    async with stage() as here:
        result = await told(here.robot, _nothing_to_say())

    assert (result.status, result.said) == ("done", "")
    assert result.problems == ("stage directions were not said: [laughs], *waves*",)


async def _nothing_to_say() -> AsyncIterator[str]:
    yield "[lau"
    yield "ghs] *waves*"


async def test_a_look_at_what_is_not_there_costs_only_itself() -> None:
    async with stage() as here:
        parts = [{"look": "ghost"}, {"say": "Here we are."}, {"refer": "blue-square"}]
        result = await perform_call(here.robot, {"turn_status": "full", "parts": parts})
        nothing = await perform_call(here.robot, {"turn_status": "full", "parts": [{"look": "ghost"}]})

    assert result.status == "done"
    assert result.said.startswith("Here we are.")
    assert [each.object for each in result.references] == ["blue-square"]
    assert any("the world does not know 'ghost'" in each for each in result.problems)
    assert nothing.status == "refused"
