"""What constraints and timing mean, rule by rule, beyond the plain cases of test_planner."""

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import (
    After,
    Constraint,
    FaceLexeme,
    Head,
    Posture,
    Speech,
    Synchronize,
    Unknown,
    Wait,
)
from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.net.petri_net import is_live, is_safe
from engage_hri.services.realizer.plan.known import Known
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.plan.relations import BlockRefused
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.planning import GAZE, LEFT, OTHER, SPEECH, at, elastic, plan, timed, warnings
from tests.realizer.stage import after, before, block, together

# -- instants ------------------------------------------------------------------------------------------------------


def test_a_bare_number_may_be_a_member_and_ref_may_be_missing() -> None:
    made = plan(block((GAZE, SPEECH), Synchronize(syncs=("s:start", "2.5", "g:stroke"))))

    assert at(made, "s:start") == at(made, "g:stroke") == 2.5


def test_many_constraints_on_one_point_all_count() -> None:
    made = plan(
        block(
            (GAZE, LEFT, SPEECH, timed(OTHER, start="0.5")),
            together("s:start", "p:stroke_start"),
            after("g:stroke", "s:start"),
            after("t:end", "s:start"),
            before("3", "s:start"),
        )
    )

    assert at(made, "s:start") == at(made, "p:stroke_start") == 1.5


def test_classes_that_share_a_point_merge_with_their_offsets() -> None:
    made = plan(
        block(
            (GAZE, LEFT, SPEECH, OTHER),
            together("g:start", "p:start-1"),
            together("s:start+2", "t:start"),
            together("p:start", "s:start"),
        )
    )

    assert [at(made, f"{id}:start") for id in "gpst"] == [0.0, 1.0, 1.0, 3.0]


def test_a_class_that_nothing_ties_to_the_start_is_as_early_as_all_its_points_can_be() -> None:
    made = plan(block((GAZE, SPEECH), together("g:stroke-3", "s:start")))

    assert at(made, "s:start") == 0.0
    assert at(made, "g:stroke") == 3.0
    assert at(made, "g:start") == 2.5


def test_own_block_and_no_block_name_the_same_point() -> None:
    named = plan(block((GAZE, SPEECH), together("b:g:stroke", "b:s:start")))
    bare = plan(block((GAZE, SPEECH), together("g:stroke", "s:start")))

    assert named.net == bare.net


def test_a_point_of_another_block_is_a_transition_of_its_own() -> None:
    example = block((GAZE, SPEECH), after("other:x:end+1", "s:start"))
    other = block((Speech(id="x", text="so"),), id="other")
    made = plan_block(
        example, [FakeBody().estimate(each) for each in example.behaviors], known=Known(blocks={"other": other})
    )

    assert at(made, "s:start") == 1.0
    assert is_live(made.net)
    assert is_safe(made.net)


def test_a_later_stroke_is_a_share_of_the_strokes_later() -> None:
    nod = Head(id="n", lexeme="NOD", repetition=4)
    estimate = elastic("n", sync_points(nod), 1.0, 1.0, None)
    made = plan(block((nod, SPEECH), after("n:stroke:3", "s:start")), estimate)

    assert at(made, "n:stroke") == 3.0
    assert at(made, "s:start") == 3.5


def test_a_stroke_that_is_not_repeated_so_often_is_no_sync_point() -> None:
    made = plan(block((Head(id="n", lexeme="NOD", repetition=2), SPEECH), after("n:stroke:3", "s:start")))

    assert warnings(made) == [("PARSING_FAILURE", "")]
    assert at(made, "s:start") == 0.0


def test_an_empty_block_is_over_at_once() -> None:
    made = plan(block(()))

    assert [transition.name for transition in made.net.transitions] == ["bml:start", "bml:end"]
    assert made.schedule == (0.0, 0.0)


# -- cycles --------------------------------------------------------------------------------------------------------


def test_a_cycle_with_negative_lags_is_legal() -> None:
    made = plan(
        block(
            (Wait(id="s", duration=1.0), Wait(id="t", duration=1.0), GAZE),
            after("s:start-1", "t:start"),
            after("t:start-1", "s:start"),
            together("g:stroke", "t:start"),
        )
    )

    assert at(made, "t:start") == 0.5
    assert at(made, "s:start") == 0.0


def test_a_deadlock_through_shared_instants_names_the_lines_of_both_ties() -> None:
    operators = (
        Synchronize(ref="s:end", syncs=("t:start",), line=5),
        Synchronize(ref="t:end", syncs=("s:start",), line=8),
    )
    behaviors = (replace(SPEECH, line=2), replace(OTHER, line=3))

    told = r"line 2: .*circle: t starts when s ends, s starts when t ends .*see lines 2, 3, 5, 8"
    with pytest.raises(BlockRefused, match=told):
        plan(block(behaviors, *operators))


def test_a_deadlock_through_offsets_names_their_lines() -> None:
    operators = (
        Synchronize(ref="s:start+1", syncs=("t:start",), line=5),
        After(ref="t:start", syncs=("s:start",), line=8),
    )

    with pytest.raises(BlockRefused, match="see lines 5, 8"):
        plan(block((SPEECH, OTHER), *operators))


# -- durations -----------------------------------------------------------------------------------------------------


def test_a_duration_shorter_than_natural_is_shared_by_the_phases() -> None:
    speech = Speech(id="s", text="a")
    made = plan(block((timed(speech, start="1", end="1.75"),)), elastic("s", ("start", "end"), 0.5, 1.0, 1.5))

    assert made.problems == ()
    assert (at(made, "s:start"), at(made, "s:end")) == (1.0, 1.75)


def test_a_duration_longer_than_natural_slows_down_what_cannot_hold() -> None:
    speech = Speech(id="s", text="a")
    made = plan(block((timed(speech, start="1", end="2.25"),)), elastic("s", ("start", "end"), 0.5, 1.0, 1.5))

    assert made.problems == ()
    assert at(made, "s:end") == 2.25


def test_what_has_no_longest_time_takes_as_long_as_is_said() -> None:
    speech = Speech(id="s", text="a")
    made = plan(block((timed(speech, start="1", end="11"),)), elastic("s", ("start", "end"), 0.5, 1.0, None))

    assert made.problems == ()
    assert (at(made, "s:start"), at(made, "s:end")) == (1.0, 11.0)


@pytest.mark.parametrize("end", ["1.25", "9"])
def test_words_whose_end_cannot_be_lose_that_with_one_warning_and_are_said(end: str) -> None:
    speech = Speech(id="s", text="a")
    made = plan(
        block((timed(speech, start="1", end=end), GAZE), together("g:stroke", "s:end")),
        elastic("s", ("start", "end"), 0.5, 1.0, 1.5),
    )

    assert warnings(made) == [("IMPOSSIBLE_TO_SCHEDULE", "s")]
    assert (made.dropped, tuple(made.given_up)) == ((), ("s",))
    assert (at(made, "s:start"), at(made, "s:end"), at(made, "g:stroke")) == (1.0, 2.0, 2.0)


@pytest.mark.parametrize("dropped", [(), ("w",)])
def test_words_are_not_lost_for_a_time_through_what_is_gone(dropped: tuple[str, ...]) -> None:
    """The wait ties the ends of the words to each other, half a second apart; also when it is dropped itself."""
    made_of = block(
        (Wait(id="w", duration=1.0), Speech(id="s", text="a")),
        together("w:end-0.5", "s:start"),
        together("w:end", "s:end"),
    )
    made = plan_block(made_of, [elastic("s", ("start", "end"), 0.9, 1.0, 1.1)], dropped=dropped)

    assert warnings(made) == [("IMPOSSIBLE_TO_SCHEDULE", "s")]
    assert (made.dropped, tuple(made.given_up)) == (dropped, ("s",))


@pytest.mark.parametrize(
    "timing",
    [{"start": "3", "end": "1"}, {"start": "-1"}, {"stroke": "0.25"}, {"end": "p:start"}, {"start": "p:start+1"}],
)
def test_a_time_that_cannot_be_costs_only_its_behavior(timing: dict[str, str]) -> None:
    if timing == {"start": "p:start+1"}:
        with pytest.raises(BlockRefused, match="cannot be one instant"):
            plan(block((timed(LEFT, **timing), SPEECH)))
        return
    made = plan(block((timed(LEFT, **timing), SPEECH), together("p:stroke_start", "s:start")))

    assert warnings(made) == [("IMPOSSIBLE_TO_SCHEDULE", "p")]
    assert at(made, "s:start") == 0.0


def test_of_two_that_cannot_both_be_the_too_long_one_goes() -> None:
    word = Speech(id="s", text="a")
    made = plan(
        block((timed(LEFT, stroke_start="s:start", stroke_end="s:end"), word)),
        elastic("s", ("start", "end"), 0.25, 0.25, 0.25),
    )

    assert warnings(made) == [("IMPOSSIBLE_TO_SCHEDULE", "p")]


def test_required_wins_over_document_order() -> None:
    word = Speech(id="s", text="a")
    must = replace(timed(LEFT, stroke_start="s:start", stroke_end="s:end"), required=True)
    made = plan(block((must, word)), elastic("s", ("start", "end"), 0.25, 0.25, 0.25))

    assert made.dropped == ("s",)


def test_two_that_are_required_and_cannot_both_be_refuse_the_block() -> None:
    word = Speech(id="s", text="a", required=True)
    must = replace(timed(LEFT, stroke_start="s:start", stroke_end="s:end"), required=True)

    with pytest.raises(BlockRefused):
        plan(block((must, word)), elastic("s", ("start", "end"), 0.25, 0.25, 0.25))


# -- what is dropped -----------------------------------------------------------------------------------------------


def test_what_is_dropped_takes_its_contradictions_with_it() -> None:
    made = plan(
        block((LEFT, SPEECH), together("p:start", "s:start"), together("p:start+1", "s:start")),
        p=Script(infeasible="NO_SUCH_TARGET"),
    )

    assert warnings(made) == [("NO_SUCH_TARGET", "p")]


def test_what_a_dropped_point_tied_together_stays_tied() -> None:
    made = plan(
        block((LEFT, SPEECH, GAZE), together("p:stroke", "s:start"), together("p:stroke", "g:stroke")),
        p=Script(infeasible="NO_SUCH_TARGET"),
    )

    assert at(made, "s:start") == at(made, "g:stroke") == 0.5


def test_dependents_of_what_is_dropped_are_not_warned_of() -> None:
    made = plan(
        block((LEFT, SPEECH, OTHER), after("p:end", "s:start"), before("p:end", "t:start"), together("p:start", "4")),
        p=Script(infeasible="NO_SUCH_TARGET"),
    )

    assert warnings(made) == [("NO_SUCH_TARGET", "p")]
    assert at(made, "s:start") == 0.0
    assert at(made, "t:start") == at(made, "s:end"), "nothing is said of it any more: it follows its type"


def test_an_unknown_element_is_dropped_and_any_point_may_be_its() -> None:
    made = plan_block(block((Unknown(id="u", element="dance"), SPEECH), after("u:twirl", "s:start")))

    assert warnings(made) == [("BEHAVIOR_TYPE_NOT_SUPPORTED", "u")]
    assert at(made, "s:start") == 0.0


def test_a_required_constraint_with_an_unknown_sync_point_refuses_the_block() -> None:
    operator = Synchronize(ref="p:strok", syncs=("s:start",), line=4)
    constraint = Constraint(operators=(operator,), id="c", required=True)

    with pytest.raises(BlockRefused, match=r"b: c, line 4: .*'p:strok'.*required"):
        plan(Block(id="b", behaviors=(LEFT, SPEECH), constraints=(constraint,)))


# -- customs -------------------------------------------------------------------------------------------------------


def test_gaze_face_and_posture_last_until_all_else_has_ended() -> None:
    lasting = (GAZE, FaceLexeme(id="f", lexeme="smile"), Posture(id="o", lexeme="LEAN"))
    made = plan(block((*lasting, SPEECH, OTHER)))

    assert made.natural == {"g", "f", "o"}
    assert {at(made, f"{id}:relax") for id in "gfo"} == {at(made, "t:end")} == {2.0}


def test_types_of_their_own_make_no_series() -> None:
    made = plan(block((SPEECH, LEFT, GAZE, OTHER)))

    assert [at(made, f"{id}:start") for id in "spgt"] == [0.0, 0.0, 0.0, 1.0]


def test_waits_of_which_nothing_is_said_follow_each_other() -> None:
    made = plan(block((Wait(id="v", duration=1.0), Wait(id="w", duration=2.0))))

    assert at(made, "w:end") == 3.0


def test_nothing_waits_for_what_is_only_in_a_series() -> None:
    waits = tuple(Wait(id=id, duration=1.0) for id in "stu")
    made = plan(block((*waits[:2], timed(waits[2], start="0.5"))))

    assert [at(made, f"{id}:start") for id in "stu"] == [0.0, 1.0, 0.5]
