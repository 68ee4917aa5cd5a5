"""What a voice is given of a speech, and what is told of that."""

from collections.abc import AsyncGenerator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri import embedded
from engage_hri.schemas.behaviors import BlockBehavior, Mark, Speech
from engage_hri.schemas.body import BodyPose, Estimate, WordTime
from engage_hri.schemas.documents.prosody import marked_up, spans, unread
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import MovementAuthority, Progress, Spoke
from engage_hri.services.control.serving.live_behavior import estimate_of, progress_of, spoken
from engage_hri.services.control.torso.body import SimulatedBody
from tests.random_cases import share_of


def given_to(text: str, **more: object) -> Speech:
    found = spoken(Speech(id="s", text=text, **more))  # type: ignore[arg-type]
    assert isinstance(found, Speech)
    return found


def test_a_voice_is_given_the_words_with_marks_where_they_belong() -> None:
    text = "**Bold** and `code` 😊 end"
    found = given_to(text, marks=(Mark("m", text.index(" and")), Mark("n", text.index(" 😊"))))

    assert found.text.split() == ["Bold", "and", "code", "end"]
    assert found.text[: found.marks[0].position] == "Bold"
    assert found.text[: found.marks[1].position] == "Bold and code"


def test_a_speech_without_marks_is_given_as_it_is() -> None:
    speech = Speech(id="s", text="Just words, 5 * 3.", markup="Just <emphasis>words</emphasis>, 5 * 3.")

    assert spoken(speech) is speech


@pytest.mark.parametrize(
    ("outer", "inner", "factor"), [("0", "-40", 0.5), ("+11", "-40", 2 ** (-1 / 12)), ("-11", "+40", 2 ** (1 / 12))]
)
def test_each_shift_of_a_voice_is_an_octave_at_most(outer: str, inner: str, factor: float) -> None:
    markup = f'<prosody pitch="{outer}st">a <prosody pitch="{inner}st">low</prosody> one</prosody>'
    pitches = {each.start: each.pitch for each in spans(given_to("a low one", markup=markup))}

    assert pitches[2] == pytest.approx(factor)


def test_markup_stays_around_its_words() -> None:
    markup = 'One **two** <prosody rate="slow">*three* &amp;amp; four</prosody> five'
    found = given_to("One **two** *three* &amp; four five", markup=markup)
    (span,) = spans(found)

    assert found.text == "One two three & four five"
    assert (found.text[span.start : span.end], span.rate) == ("three & four", 0.75)


@given(
    st.lists(st.sampled_from(["word", "**two**", "- item", "# Head", "| a | b |", "\n", "\n\n", " ", "x < y", "&"]))
)
def test_the_last_words_that_generation_marks_keep_their_markup(parts: list[str]) -> None:
    """Generation asks for a low voice at the end of a turn."""
    text = " ".join((*parts, "end"))
    start = text.rfind(" ") + 1
    found = given_to(text, markup=marked_up(text, (), start, len(text), pitch="low"))

    assert unread(found) == ()


def test_places_are_told_as_the_author_wrote() -> None:
    text = "**Bold** and `code` 😊"
    speech = Speech(id="s", text=text)
    told = [progress_of(speech, Spoke("", place, 0.0)) for place in (4, 8, 13)]

    assert [text[: each.position] for each in told if isinstance(each, Spoke)] == ["**Bold", "**Bold** and", text]


def test_an_estimate_tells_what_is_not_said() -> None:
    word = WordTime(position=3, start=0.0, end=0.5)
    told = estimate_of(
        Speech(id="s", text="[laughs] Yes"), Estimate(behavior="s", feasible=True, parts=("voice",), words=(word,))
    )

    assert told.degraded == "stage directions were not said: [laughs]"


@settings(max_examples=share_of(200))
@given(st.lists(st.sampled_from([*"ab *_`[]<>&#\n!", "😊", "[laughs]", "&amp;", "x_1"]), max_size=40).map("".join))
def test_places_keep_their_order_and_the_last_word_is_all_of_the_text(text: str) -> None:
    speech = Speech(id="s", text=text, marks=tuple(Mark(f"m{place}", place) for place in range(len(text) + 1)))
    found = given_to(text, marks=speech.marks)
    there = [each.position for each in found.marks]
    back = [
        each.position
        for place in range(len(found.text) + 1)
        if isinstance(each := progress_of(speech, Spoke("", place, 0.0)), Spoke)
    ]

    assert there == sorted(there)
    assert back == sorted(back)
    assert there[-1] == len(found.text)
    assert back[-1] == len(text)


class Somebodys(SimulatedBody):
    """A body with a voice that somebody else wrote."""

    def __init__(self) -> None:
        super().__init__()
        self.given: set[str] = set()

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        self.given |= {behavior.text} if isinstance(behavior, Speech) else set()
        return super().estimate(behavior, pose, world)

    def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        self.given |= {behavior.text} if isinstance(behavior, Speech) else set()
        return super().perform(behavior, authority)


async def test_voices_of_others_are_given_words_alone() -> None:
    body = Somebodys()
    async with embedded(body=body) as robot:
        text = "**Bold** words and `code` here. 😊"
        outcome = await robot.perform({"turn_status": "full", "parts": [{"say": text}]})

    assert {" ".join(each.split()) for each in body.given} == {"Bold words and code here."}
    assert " ".join(each.text for each in outcome.spoken) == "Bold words and code here. 😊"
