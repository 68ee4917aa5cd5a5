"""What a fragment's block looks like: both profiles line by line, and constraints that keep working."""

import pytest

from engage_hri.schemas.behaviors import (
    After,
    Before,
    Constraint,
    Event,
    Gaze,
    Gesture,
    Mark,
    Pointing,
    Speech,
    Synchronize,
    Timing,
)
from engage_hri.schemas.check import problems
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import SyncRef
from engage_hri.services.generation.turns.continuation import Continuation
from tests.generation.emitted import LOOK, POINT, Made, block, by_id, lines, reference, speech

# -- profile check-back -----------------------------------------------------------------------------------------


def test_a_phrase_without_gesture_follows_the_speech_before() -> None:
    fragment = TurnFragment(id="f", turn_status="middle", behaviors=(speech("s"), reference("r")))

    made = block(fragment, [("none", "it")])

    assert list(by_id(made)) == ["s", "r-phrase"]
    assert lines(made) == ["r-phrase:start after s:end"]


def test_a_look_comes_before_its_phrase_and_lasts_until_its_end() -> None:
    fragment = TurnFragment(id="f", turn_status="middle", behaviors=(speech("s"), reference("r")))

    made = block(fragment, [(LOOK, "it")])

    assert lines(made) == [
        "r-phrase:start after s:end",
        "r-gaze:start after s:end",
        "r-gaze:relax after r-phrase:end",
        "r-phrase:start after r-gaze:stroke",
    ]
    event = by_id(made)["r-event"]
    assert event == Event(
        id="r-event",
        kind="directed_gaze",
        responder="human",
        objects=("piece",),
        cause="reference",
        turn="turn",
        anchors=("r-gaze:stroke", "r-phrase:start"),
        timing=(Timing("start", "r-gaze:start"),),
        needs=("r-gaze",),
    )


def test_a_look_alone_announces_nothing() -> None:
    fragment = TurnFragment(id="f", turn_status="middle", behaviors=(speech("s"), reference("r")))

    made = block(fragment, [("gaze", "it")])

    assert list(by_id(made)) == ["s", "r-gaze", "r-phrase"]
    assert "r-phrase:start after r-gaze:stroke" in lines(made)


def test_a_point_is_held_until_the_human_has_looked_or_failed_to() -> None:
    fragment = TurnFragment(id="f", turn_status="middle", behaviors=(speech("s"), reference("r")))

    made = block(fragment, [(POINT, "this")])

    assert lines(made) == [
        "r-phrase:start after s:end",
        "r-gaze:start after s:end",
        "r-gaze:relax after r-phrase:end",
        "r-point:start after r-gaze:start",
        "r-point:stroke_start after r-gaze:stroke",
        "r-phrase:start = r-point:stroke_start",
        "r-point:stroke_end after r-phrase:end",
        "r-point:stroke_end after r-event:end",
        "r-glance:start = r-gaze:relax",
    ]
    event = by_id(made)["r-event"]
    assert isinstance(event, Event)
    assert event.anchors == ("r-gaze:stroke", "r-point:stroke", "r-phrase:start")


def test_without_a_speech_before_the_block_start_stands_for_it() -> None:
    fragment = TurnFragment(id="f", turn_status="middle", behaviors=(reference("r"),))

    made = block(fragment, [(LOOK, "it")])

    assert lines(made) == ["r-gaze:relax after r-phrase:end", "r-phrase:start after r-gaze:stroke"]


def test_the_next_reference_waits_for_the_glance_and_for_its_arm() -> None:
    fragment = TurnFragment(
        id="f", turn_status="middle", behaviors=(reference("r1"), speech("s"), reference("r2", "other"))
    )
    hands = {"r1": "LEFT_HAND", "r2": "LEFT_HAND"}

    made = block(fragment, [(POINT, "this"), (POINT, "that")], hands=hands)

    assert "r2-gaze:start after r1-glance:stroke" in lines(made)
    assert "r2-point:start = r1-point:stroke_end" in lines(made)
    assert by_id(made)["r1-glance"] == Gaze(id="r1-glance", target="human", needs=("r1-phrase",))


def test_after_a_long_speech_head_and_arm_begin_at_home() -> None:
    long = Speech(id="s", text="and then put it carefully beside")
    fragment = TurnFragment(
        id="f", turn_status="middle", behaviors=(reference("r1"), long, reference("r2", "other"), reference("r3"))
    )
    hands = {"r1": "LEFT_HAND", "r2": "LEFT_HAND"}

    pointed = block(fragment, [(POINT, "this"), (POINT, "that"), ("none", "it")], hands=hands, apart={"r2"})
    looked = block(fragment, [(LOOK, "it"), (LOOK, "that"), (LOOK, "it")], apart={"r2"})

    assert "r2-point:start after r1-point:end" in lines(pointed)
    assert "r2-gaze:start after r1-gaze:end" in lines(looked)
    assert "r3-gaze:start = r2-gaze:relax" in lines(looked)


def test_points_of_different_arms_do_not_wait_for_each_other() -> None:
    fragment = TurnFragment(id="f", turn_status="middle", behaviors=(reference("r1"), reference("r2", "other")))
    hands = {"r1": "LEFT_HAND", "r2": "RIGHT_HAND"}

    made = block(fragment, [(POINT, "this"), (POINT, "that")], hands=hands)

    assert not [line for line in lines(made) if "r1-point" in line and "r2-point" in line]
    assert [behavior.mode for behavior in made.behaviors if isinstance(behavior, Pointing)] == [
        "LEFT_HAND", "RIGHT_HAND",
    ]  # fmt: skip


@pytest.mark.parametrize(("status", "glances"), [("full", ["r1-glance"]), ("beginning", ["r1-glance", "r2-glance"])])
def test_no_glance_back_where_the_end_of_turn_gaze_comes_anyway(status: str, glances: list[str]) -> None:
    fragment = TurnFragment(
        id="f",
        turn_status=status,  # type: ignore[arg-type]
        behaviors=(reference("r1"), speech("s"), reference("r2", "other"), speech("last")),
    )

    made = block(fragment, [(POINT, "this"), (POINT, "that")])

    assert [id for id in by_id(made) if id.endswith("glance")] == glances


def test_there_is_no_glance_after_a_look_without_point() -> None:
    fragment = TurnFragment(id="f", turn_status="middle", behaviors=(reference("r1"), speech("s")))

    assert "r1-glance" not in by_id(block(fragment, [(LOOK, "it")]))


def test_an_input_constraint_on_the_start_replaces_the_preceding_speech() -> None:
    fragment = TurnFragment(
        id="f",
        turn_status="middle",
        behaviors=(speech("s"), reference("r")),
        constraints=(Constraint(id="c", operators=(Synchronize(ref="s:start+0.5", syncs=("r:start",)),)),),
    )

    made = block(fragment, [(LOOK, "it")])

    assert lines(made, "c") == ["r-gaze:start = s:start+0.5"]
    assert "r-gaze:start after s:end" not in lines(made)
    assert "r-phrase:start after s:end" in lines(made)


# -- profile figure-3.3 -----------------------------------------------------------------------------------------


def figure_3_2() -> TurnFragment:
    """Fig. 3.2 with its constraints."""
    return TurnFragment(
        id="bml-example",
        turn_status="middle",
        behaviors=(
            speech("speech-1", "Please place"),
            reference("ref-1", "yellow-triangle"),
            speech("speech-3", "on the right side of"),
            reference("ref-2", "purple-square"),
        ),
        constraints=(
            Constraint(
                id="constraint-1",
                operators=(
                    Synchronize(ref="speech-1:end", syncs=("ref-1:start",)),
                    Synchronize(ref="ref-1:end", syncs=("speech-3:start",)),
                    Synchronize(ref="speech-3:end", syncs=("ref-2:start",)),
                ),
            ),
        ),
    )


def test_fig_3_3_line_by_line() -> None:
    made = block(figure_3_2(), [(POINT, "this piece"), ("none", "the purple square")], "figure-3.3")

    assert [type(behavior) for behavior in made.behaviors] == [Speech, Gaze, Pointing, Speech, Event, Speech, Speech]
    assert sorted(lines(made)) == sorted(
        [
            "ref-1-gaze:stroke = speech-1:start",
            "ref-1-point:stroke_start = ref-1-gaze:stroke+2",
            "ref-1-phrase:start = ref-1-point:stroke_end",
            "speech-3:start = ref-1-phrase:end",
            "ref-2-phrase:start = speech-3:end",
            "ref-1-phrase:start after speech-1:end",  # which the figure lost
        ]
    )


def test_fig_3_2_as_profile_check_back() -> None:
    made = block(figure_3_2(), [(POINT, "this piece"), ("none", "the purple square")])

    assert sorted(lines(made)) == sorted(
        [
            "ref-1-gaze:start = speech-1:end",
            "speech-3:start = ref-1-phrase:end",
            "ref-2-phrase:start = speech-3:end",
            "ref-1-phrase:start after speech-1:end",
            "ref-1-gaze:relax after ref-1-phrase:end",
            "ref-1-point:start after ref-1-gaze:start",
            "ref-1-point:stroke_start after ref-1-gaze:stroke",
            "ref-1-phrase:start = ref-1-point:stroke_start",
            "ref-1-point:stroke_end after ref-1-phrase:end",
            "ref-1-point:stroke_end after ref-1-event:end",
            "ref-1-glance:start = ref-1-gaze:relax",
            "ref-2-phrase:start after speech-3:end",
        ]
    )


def test_the_figures_lead_is_a_parameter_and_its_gaze_needs_something_to_lead() -> None:
    fragment = TurnFragment(id="f", turn_status="middle", behaviors=(reference("r"), speech("s")))

    made = block(fragment, [(POINT, "this")], "figure-3.3")

    assert lines(made) == [
        "r-point:stroke_start = r-gaze:stroke+2",
        "r-phrase:start = r-point:stroke_end",
        "s:start = r-phrase:end",
    ]


# -- constraints of the input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("made", "start", "end"),
    [
        (("none", "it"), "r-phrase:start", "r-phrase:end"),
        ((LOOK, "it"), "r-gaze:start", "r-phrase:end"),
        ((POINT, "it"), "r-gaze:start", "r-phrase:end"),
        ((LOOK, ""), "r-gaze:start", "r-gaze:stroke"),
        ((POINT, ""), "r-gaze:start", "r-point:stroke_end"),
    ],
)
def test_ids_of_removed_references_stay_usable(made: Made, start: str, end: str) -> None:
    operators = (
        Synchronize(ref="s:start", syncs=("r:start+1",), line=3),
        After(ref="r:end", syncs=("g:start",)),
        Before(ref="r : end - 0.5", syncs=("g:end",)),
        Synchronize(syncs=("f:r:end", "g:relax")),
    )
    fragment = TurnFragment(
        id="f",
        turn_status="middle",
        behaviors=(speech("s"), reference("r"), Gesture(id="g", lexeme="beat", timing=(Timing("ready", "r:start"),))),
        constraints=(Constraint(id="c", required=True, operators=operators),),
    )

    result = block(fragment, [made])

    assert lines(result, "c") == [
        f"{start}+1 = s:start", f"g:start after {end}", f"g:end before {end}-0.5", f"g:relax = {end}",
    ]  # fmt: skip
    assert by_id(result)["g"].timing == (Timing("ready", start),)
    assert result.constraints[0].required


def test_inline_timing_of_a_reference_goes_to_what_replaces_it() -> None:
    timed = reference("r", timing=(Timing("start", "s:mark-1"), Timing("end", "5")))
    fragment = TurnFragment(id="f", turn_status="middle", behaviors=(speech("s", marks=(Mark("mark", 1),)), timed))

    made = block(fragment, [(LOOK, "it")])

    assert "r-gaze:start = s:mark-1" in lines(made)
    assert "r-phrase:end = 5" in lines(made)


def test_made_up_ids_never_collide_with_the_authors() -> None:
    fragment = TurnFragment(
        id="f", turn_status="full", behaviors=(speech("r-gaze"), speech("turn-gaze"), reference("r"))
    )

    made = block(fragment, [(LOOK, "it")])

    assert len(by_id(made)) == len(made.behaviors)
    assert isinstance(by_id(made)["r-gaze-2"], Gaze)


def test_references_are_made_in_the_order_of_the_constraints() -> None:
    fragment = TurnFragment(
        id="f",
        turn_status="middle",
        behaviors=(reference("second"), reference("first", "other")),
        constraints=(Constraint(operators=(After(ref="first:end", syncs=("second:start",)),)),),
    )

    made = block(fragment, [(LOOK, "it"), ("none", "it")])

    assert "second-phrase:start after first-phrase:end" in lines(made)
    assert "first-phrase:start after second-phrase:end" not in lines(made)


def test_speeches_without_timing_stay_in_line_though_the_turn_names_them() -> None:
    fragment = TurnFragment(id="f", behaviors=(speech("s1"), speech("s2"), speech("s3")))

    made = block(fragment)

    assert {"s2:start after s1:end", "s3:start after s2:end"} <= set(lines(made))


def test_a_speech_that_its_author_has_timed_is_left_alone() -> None:
    timed = speech("s2", timing=(Timing("start", "s1:start+0.2"),))
    fragment = TurnFragment(id="f", behaviors=(speech("s1"), timed))

    assert not [line for line in lines(block(fragment)) if line.startswith("s2:start")]


EYES_ON_ANN = Continuation(seen_after=0.2, eyes_on="ann")


@pytest.mark.parametrize(
    ("look", "waits"),
    [
        (Gaze(id="look", target="piece"), ["look:start after bml:start+0.2"]),
        (Gaze(id="look", target="ann"), []),
        (Gaze(id="look", target="piece", timing=(Timing("start", "0.1"),)), []),
    ],
)
def test_the_first_look_waits_until_what_the_eyes_have_just_come_to_was_seen(look: Gaze, waits: list[str]) -> None:
    fragment = TurnFragment(id="f", turn_status="full", behaviors=(look, speech("s")))

    assert lines(block(fragment, before=EYES_ON_ANN), "eyes-rest") == waits


@pytest.mark.parametrize("seconds", [5.684341886080802e-14, 1e-5, 1 / 3])
def test_a_wait_of_any_length_can_be_read(seconds: float) -> None:
    fragment = TurnFragment(id="f", turn_status="full", behaviors=(Gaze(id="look", target="piece"), speech("s")))

    planned = block(fragment, before=Continuation(seen_after=seconds, eyes_on="ann"))

    assert not list(problems(planned))
    (wait,) = (each for each in planned.constraints if each.id == "eyes-rest")
    assert SyncRef.parse(wait.operators[0].ref).offset == seconds


def test_the_look_of_a_reference_and_that_of_the_turn_wait_too() -> None:
    refers = TurnFragment(id="f", turn_status="full", behaviors=(reference("ref"),))
    says = TurnFragment(id="f", turn_status="full", behaviors=(speech("s"),))

    assert lines(block(refers, [(LOOK, "it")], before=EYES_ON_ANN), "eyes-rest") == [
        "ref-gaze:start after bml:start+0.2"
    ]
    assert lines(block(says, before=EYES_ON_ANN), "eyes-rest") == ["turn-gaze:start after bml:start+0.2"]
    assert lines(block(says, before=Continuation(eyes_on="ann")), "eyes-rest") == []
