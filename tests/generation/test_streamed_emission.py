"""The block of a turn's next fragment, while earlier ones are still performed: what it names of theirs."""

import pytest

from engage_hri.schemas.behaviors import (
    After,
    Before,
    Constraint,
    FaceFacs,
    FaceLexeme,
    Gesture,
    Hand,
    Head,
    Pointing,
    Synchronize,
    Timing,
)
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.services.generation.inhibitions import Permits
from engage_hri.services.generation.turns.continuation import NO_CONTINUATION, Continuation, Stroke
from tests.generation.emitted import LOOK, POINT, by_id, emission, lines, reference, speech, start_of

BUSY = Continuation(speech="a:s", glance="a:r-glance", strokes=(Stroke("a:r-point", "LEFT_HAND"),))


def middle(*behaviors: object, **fields: object) -> TurnFragment:
    return TurnFragment(id="b", turn_status="middle", behaviors=behaviors, **fields)  # type: ignore[arg-type]


def made(fragment: TurnFragment, *choices: object, **fields: object) -> list[str]:
    return lines(emission(fragment, choices, before=BUSY, **fields).block)  # type: ignore[arg-type]


def test_a_reference_follows_the_words_the_glance_and_the_arm_of_earlier_fragments() -> None:
    text = made(middle(reference("r")), (POINT, "it"), hands={"r": "LEFT_HAND"})

    assert text[:4] == [
        "r-point:start after a:r-point:stroke_end",
        "r-phrase:start after a:s:end",
        "r-gaze:start after a:s:end",
        "r-gaze:start after a:r-glance:stroke",
    ]


@pytest.mark.parametrize(
    ("hand", "other", "waits"),
    [
        ("LEFT_HAND", "LEFT_HAND", True),
        ("LEFT_HAND", "RIGHT_HAND", False),
        ("BOTH_HANDS", "RIGHT_HAND", True),
        (None, "RIGHT_HAND", True),
        ("LEFT_HAND", None, True),
        ("head", "LEFT_HAND", False),
        ("head", None, False),
    ],
)
def test_a_point_waits_for_the_arm_that_may_be_the_same(hand: Hand, other: Hand | None, waits: bool) -> None:
    before = Continuation(strokes=(Stroke("a:p", hand),))
    point = Pointing(id="q", target="piece", mode=other)

    assert ("q:start after a:p:stroke_end" in lines(emission(middle(point), before=before).block)) is waits


def test_a_nod_waits_for_the_nod_before_it_and_for_no_arm() -> None:
    first = emission(TurnFragment(id="a", turn_status="beginning", behaviors=(Head(id="n", lexeme="NOD"),)))
    before = first.continuation.pending("a", ())

    assert lines(emission(middle(Head(id="m", lexeme="NOD")), before=before).block) == ["m:start after a:n:end"]
    assert lines(emission(middle(Gesture(id="g", lexeme="BEAT")), before=before).block) == []


def test_of_faces_in_a_row_only_the_first_is_placed_whatever_their_types() -> None:
    """The others follow it by themselves, as long as nothing names them."""
    text = made(middle(FaceLexeme(id="f", lexeme="SMILE"), FaceFacs(id="g", au=2)))

    assert text == ["f:start after a:s:end"]


def test_only_the_next_reference_waits_for_the_glance_of_an_earlier_fragment() -> None:
    text = made(middle(reference("r"), reference("q")), (POINT, "it"), (LOOK, "that"), hands={"r": "LEFT_HAND"})

    assert [line for line in text if "glance:stroke" in line] == [
        "r-gaze:start after a:r-glance:stroke",
        "q-gaze:start after r-glance:stroke",
    ]


def test_what_would_begin_with_the_block_begins_after_the_words_before_it() -> None:
    fragment = middle(speech("s"), Gesture(id="g", lexeme="BEAT"), Head(id="n", lexeme="NOD"), speech("t"))

    assert made(fragment)[:3] == [f"{id}:start after a:s:end" for id in ("s", "g", "n")]


def test_what_follows_another_of_its_type_still_does() -> None:
    text = made(middle(Head(id="n", lexeme="NOD"), Head(id="m", lexeme="NOD")))

    assert text == ["n:start after a:s:end"]  # naming m would let it go with n


def test_the_clock_of_a_fragment_runs_from_the_words_before_it() -> None:
    nod = Head(id="n", lexeme="NOD", timing=(Timing("start", "0.2"), Timing("end", "bml:start+3")))
    constraint = Constraint(
        id="c", operators=(Synchronize(ref="1.5", syncs=("g:start",)), After(ref="bml:start", syncs=("s:start",)))
    )
    fragment = middle(speech("s"), Gesture(id="g", lexeme="BEAT"), nod, constraints=(constraint,))

    block = emission(fragment, before=BUSY).block
    assert [timing.ref for timing in by_id(block)["n"].timing] == ["a:s:end+0.2", "a:s:end+3"]
    assert lines(block, "c") == ["g:start = a:s:end+1.5", "s:start after a:s:end"]


def test_a_reference_by_the_clock_keeps_its_time() -> None:
    fragment = middle(reference("r", timing=(Timing("start", "0.5"),)))

    assert "r-gaze:start = a:s:end+0.5" in made(fragment, (LOOK, "it"))


def test_an_upper_bound_alone_does_not_let_a_reference_go_early() -> None:
    bound = Constraint(id="c", operators=(Before(ref="s:end", syncs=("r:start",)),))
    text = made(middle(speech("s"), reference("r"), constraints=(bound,)), (LOOK, "it"))

    assert [line for line in text if line.startswith("r-gaze:start")] == [
        "r-gaze:start before s:end",
        "r-gaze:start after a:s:end",
        "r-gaze:start after a:r-glance:stroke",
    ]


def test_an_end_without_words_waits_for_those_before_it() -> None:
    result = emission(TurnFragment(id="z", turn_status="end"), before=BUSY).block

    assert lines(result) == ["turn-gaze:start after a:s:end"]
    assert start_of(by_id(result)["turn-ended"]) == "turn-gaze:start"


def test_an_end_without_words_or_gaze_waits_for_those_before_it() -> None:
    fragment = TurnFragment(id="z", turn_status="end")

    assert lines(emission(fragment, before=BUSY, permits=Permits(gaze=False)).block) == [
        "turn-ended:start after a:s:end"
    ]


def test_profile_figure_looks_when_the_words_before_it_begin() -> None:
    text = made(middle(reference("r")), (POINT, "it"), profile="figure-3.3", hands={"r": "RIGHT_HAND"})

    assert text == [
        "r-gaze:stroke after a:s:start",
        "r-point:start after r-gaze:start",
        "r-point:stroke_start = r-gaze:stroke+2",
        "r-phrase:start = r-point:stroke_end",
        "r-phrase:start after a:s:end",
    ]


def test_with_nothing_before_it_a_block_names_no_other() -> None:
    fragment = middle(speech("s"), reference("r"), Gesture(id="g", lexeme="BEAT"), speech("t"))

    named = {
        ref
        for line in lines(emission(fragment, [(POINT, "it")], before=NO_CONTINUATION).block)
        for ref in line.split()
    }
    assert {ref for ref in named if ref.count(":") > 1} == set()


# -- what a block leaves ------------------------------------------------------------------------------------------


def test_a_block_leaves_its_last_words_its_last_glance_and_its_strokes() -> None:
    fragment = middle(speech("s"), Gesture(id="g", lexeme="BEAT", mode="RIGHT_HAND"), reference("r"))

    assert emission(fragment, [(POINT, "it")], hands={"r": "LEFT_HAND"}).continuation == Continuation(
        speech="r-phrase", glance="r-glance", strokes=(Stroke("g", "RIGHT_HAND"), Stroke("r-point", "LEFT_HAND"))
    )


def test_what_was_reached_is_left_no_more() -> None:
    continuation = Continuation("s", "g", (Stroke("p", None), Stroke("n", "head", "end")))
    reached = {("s", "end"), ("g", "start"), ("p", "stroke_end"), ("n", "stroke_end")}

    assert continuation.pending("a", reached) == Continuation("", "a:g", (Stroke("a:n", "head", "end"),))


def test_a_fragment_without_words_leaves_those_before_it() -> None:
    later = Continuation(glance="b:g", strokes=(Stroke("b:p", None),))

    assert BUSY.then(later) == Continuation("a:s", "b:g", (*BUSY.strokes, Stroke("b:p", None)))
