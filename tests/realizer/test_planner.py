"""From block to plan: what constraints mean, what is refused with place and line, what is dropped."""

import json
from itertools import accumulate

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    After,
    BlockBehavior,
    Constraint,
    Event,
    FaceLexeme,
    Gaze,
    Head,
    Pointing,
    Speech,
    Synchronize,
    Timing,
    Wait,
)
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.faults import Fault
from engage_hri.services.realizer.export import as_dot, as_json, as_text
from engage_hri.services.realizer.net.petri_net import is_live
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.plan.relations import BlockRefused
from engage_hri.services.realizer.points import Point
from tests.realizer.fake_body import FakeBody, natural_durations, points_of
from tests.realizer.firing import enabled, fire
from tests.realizer.stage import after, before, block, together

GAZE = Gaze(id="g", target="can")
POINT = Pointing(id="p", target="can")
SPEECH = Speech(id="s", text="This can?")
OTHER = Speech(id="s2", text="Or that?")
BODY = FakeBody()


def plan(example: Block) -> Plan:
    return plan_block(example, [BODY.estimate(each) for each in example.behaviors])


def at(made: Plan, point: str) -> float:
    behavior, sync = point.split(":")
    return made.predicted(Point(behavior, sync))


def test_points_that_are_one_instant_share_one_transition() -> None:
    made = plan(block((GAZE, POINT, SPEECH), together("g:stroke", "p:start"), together("p:stroke_start", "s:start")))

    names = {transition.name for transition in made.net.transitions}
    assert {"g:stroke = p:start", "p:stroke_start = s:start", "g:start = g:ready = g:stroke_start"} <= names


def test_any_number_of_points_join_in_one_transition() -> None:
    three = plan(block((GAZE, POINT, SPEECH), together("g:start", "s:start"), together("p:start", "s:start")))

    assert three.at[Point("g", "start")] == three.at[Point("p", "start")] == three.at[Point("s", "start")]


def test_offsets_on_both_sides_count() -> None:
    made = plan(block((GAZE, SPEECH), together("g:start+1", "s:start-1")))

    assert (at(made, "g:start"), at(made, "s:start")) == (0.0, 2.0)


def test_negative_time_moves_what_it_counts_from() -> None:
    made = plan(block((GAZE, SPEECH), together("g:start-2", "s:start")))

    assert (at(made, "g:start"), at(made, "s:start")) == (2.0, 0.0)


def test_a_point_that_cannot_hold_is_kept_back_at_its_start() -> None:
    made = plan(block((POINT, SPEECH), together("p:stroke_start", "s:end")))

    assert at(made, "s:start") == 0.0
    assert at(made, "p:stroke_start") == at(made, "s:end") == 1.0
    late = plan(block((GAZE, POINT), together("p:stroke_start", "g:stroke")))
    assert (at(late, "g:start"), at(late, "g:stroke")) == (0.25, 0.75)


def test_before_is_an_upper_bound_even_with_an_offset() -> None:
    made = plan(block((SPEECH, POINT), before("s:start+0.25", "p:stroke_start")))

    assert (at(made, "s:start"), at(made, "p:stroke_start")) == (0.5, 0.75)


def test_a_window_is_a_legal_cycle() -> None:
    made = plan(block((GAZE, SPEECH), after("g:stroke", "s:start"), before("g:stroke+2", "s:start")))

    assert at(made, "s:start") == 0.5
    assert is_live(made.net)


def test_what_nothing_is_said_about_follows_the_previous_of_its_type() -> None:
    made = plan(block((SPEECH, OTHER)))

    assert at(made, "s2:start") == at(made, "s:end") == 1.0


def test_what_is_timed_does_not_wait_for_its_type() -> None:
    made = plan(block((SPEECH, replace(OTHER, timing=(Timing("start", "0.5"),)))))

    assert at(made, "s2:start") == 0.5


def test_gazes_in_series_hand_over_without_going_home() -> None:
    made = plan(block((GAZE, Gaze(id="g2", target="other"))))

    assert at(made, "g:stroke") == at(made, "g:end") == at(made, "g2:start") == 0.5


def test_a_gaze_lasts_until_all_else_has_ended() -> None:
    made = plan(block((GAZE, SPEECH, FaceLexeme(id="f", lexeme="smile"))))

    assert made.natural == {"g", "f"}
    assert at(made, "g:relax") == at(made, "f:relax") == 1.0


def test_a_timed_end_is_no_natural_end() -> None:
    made = plan(block((replace(GAZE, timing=(Timing("end", "s:end"),)), SPEECH)))

    assert made.natural == frozenset()
    assert at(made, "g:end") == at(made, "s:end") == 1.0


def test_a_fixed_duration_holds_at_the_last_hold_point() -> None:
    made = plan(block((replace(POINT, timing=(Timing("start", "1"), Timing("end", "10"))),)))

    assert (at(made, "p:start"), at(made, "p:stroke_end"), at(made, "p:end")) == (1.0, 9.25, 10.0)


@pytest.mark.parametrize("timing", [(Timing("start", "1"), Timing("end", "1.5")), (Timing("stroke", "0.25"),)])
def test_a_behavior_that_cannot_be_on_time_is_dropped_with_one_warning(timing: tuple[Timing, ...]) -> None:
    made = plan(block((replace(POINT, timing=timing), SPEECH)))

    assert made.dropped == ("p",)
    assert [(each.kind, each.behavior) for each in made.problems] == [("IMPOSSIBLE_TO_SCHEDULE", "p")]
    assert at(made, "s:start") == 0.0


def test_an_unknown_inline_sync_point_drops_its_behavior() -> None:
    made = plan(block((replace(POINT, timing=(Timing("strok", "1"),)), SPEECH)))

    assert made.dropped == ("p",)


def test_an_unknown_sync_point_in_a_constraint_drops_that_line() -> None:
    made = plan(block((POINT, SPEECH), Synchronize(ref="p:stroke_start", syncs=("s:nowhere", "s:start"), line=9)))

    assert made.dropped == ()
    assert [each.kind for each in made.problems] == ["PARSING_FAILURE"]
    assert at(made, "s:start") == 0.75


def test_what_the_body_cannot_do_is_dropped() -> None:
    cannot = Estimate(behavior="p", feasible=False, warning="NO_SUCH_TARGET", fault=Fault(reason="no can"))
    made = plan_block(block((POINT, SPEECH), together("p:stroke_start", "s:start")), [cannot])

    assert [(each.kind, each.behavior) for each in made.problems] == [("NO_SUCH_TARGET", "p")]
    assert at(made, "s:start") == 0.0


@pytest.mark.parametrize(
    "behavior", [GAZE, POINT, SPEECH, Head(id="n", lexeme="NOD"), FaceLexeme(id="f", lexeme="SMILE")]
)
def test_alone_a_behavior_takes_as_long_from_point_to_point_as_the_body_says(behavior: BlockBehavior) -> None:
    """Also where that is no time at all: the point after that comes no earlier."""
    made = plan(block((behavior,)))

    expected = list(accumulate(natural_durations(behavior), initial=0.0))
    assert [at(made, f"{behavior.id}:{sync}") for sync in points_of(behavior)] == expected


@pytest.mark.parametrize("behavior", [GAZE, POINT, SPEECH, Head(id="n", lexeme="NOD", repetition=2)])
def test_what_the_body_says_nothing_of_is_planned_as_is_usual(behavior: BlockBehavior) -> None:
    made = plan_block(block((behavior,)), [])

    assert (made.dropped, made.problems) == ((), ())
    assert at(made, f"{behavior.id}:end") > at(made, f"{behavior.id}:start") == 0.0


def test_what_is_required_and_cannot_be_done_refuses_the_block() -> None:
    cannot = Estimate(behavior="p", feasible=False, warning="NO_SUCH_TARGET", fault=Fault(reason="no can"))

    with pytest.raises(BlockRefused, match=r"b: p, line 7: no can .*required"):
        plan_block(block((replace(POINT, required=True, line=7), SPEECH)), [cannot])


@pytest.mark.parametrize("ref", ["a", ":a:b", "p:relax:2", "+p", "a:b:c:d:e", "nobody:start"])
def test_a_bad_reference_refuses_the_block_with_its_line(ref: str) -> None:
    operator = Synchronize(ref=ref, syncs=("s:start",), line=12)

    with pytest.raises(BlockRefused) as refusal:
        plan(Block(id="b", behaviors=(POINT, SPEECH), constraints=(Constraint(operators=(operator,), id="c1"),)))

    assert (refusal.value.fault.where, refusal.value.fault.line) == ("b: c1", 12)


def test_a_contradiction_names_points_and_lines() -> None:
    operators = (
        Synchronize(ref="p:start", syncs=("s:start",), line=5),
        Synchronize(ref="s:start+1", syncs=("p:start",), line=8),
    )

    with pytest.raises(BlockRefused, match=r"line 8: 's:start\+1' and 'p:start'.*see lines 5, 8"):
        plan(block((POINT, SPEECH), *operators))


def test_a_deadlock_names_points_and_lines() -> None:
    operators = (After(ref="p:end", syncs=("s:start",), line=5), After(ref="s:end", syncs=("p:start",), line=8))

    with pytest.raises(BlockRefused, match=r"circle: .*p:start.*see lines 5, 8") as refusal:
        plan(block((POINT, SPEECH), *operators))

    assert refusal.value.kind == "IMPOSSIBLE_TO_SCHEDULE"


def test_an_impossible_window_is_refused() -> None:
    with pytest.raises(BlockRefused, match="circle"):
        plan(block((POINT, SPEECH), after("p:start+2", "s:start"), before("p:start+1", "s:start")))


def test_bml_start_is_the_block_and_a_self_reference_is_legal() -> None:
    timing = (Timing("start", "bml:start+1"), Timing("end", "w:start+3"))
    made = plan(block((Wait(id="w", duration=1.0, timing=timing),)))

    assert (at(made, "w:start"), at(made, "w:end")) == (1.0, 4.0)


def test_an_event_keeps_the_block_open_only_if_its_end_is_waited_for() -> None:
    event = Event(id="e", kind="directed_gaze", responder="human", objects=("can",))

    assert "e" not in plan(block((event, SPEECH), together("e:start", "s:start"))).waited_for
    assert "e" in plan(block((event, POINT), after("e:end", "p:stroke_end"))).waited_for


def test_bml_1_0_spells_the_same_block_otherwise() -> None:
    draft = plan(block((GAZE, POINT), together("g:stroke", "p:stroke_start")))
    bml = plan(block((GAZE, POINT), together("g:ready", "p:strokeStart"), dialect="bml-1.0"))

    assert bml.net == draft.net


def test_the_net_fires_from_start_to_end_and_again() -> None:
    net = plan(block((GAZE, POINT, SPEECH), together("g:stroke", "p:start"), after("p:stroke_start", "s:start"))).net
    marking, fired = net.initial, []

    while (ready := enabled(net, marking)) and len(fired) < len(net.transitions):
        fired.append(ready[0])
        marking = fire(net, marking, ready[0])

    assert sorted(fired) == list(range(len(net.transitions)))
    assert marking == net.initial
    assert max(marking) == 1


def test_a_transition_that_is_not_enabled_does_not_fire() -> None:
    net = plan(block((SPEECH,))).net

    with pytest.raises(ValueError, match="not enabled"):
        fire(net, net.initial, len(net.transitions) - 1)


def test_a_plan_reads_as_text_json_and_drawing() -> None:
    made = plan(block((GAZE, POINT), together("g:stroke", "p:start")))

    assert "0.500 s  g:stroke = p:start" in as_text(made)
    document = json.loads(as_json(made))
    assert document["behaviors"]["p"]["start"] == 0.5
    assert sum(place["tokens"] for place in document["places"]) == 1
    assert as_dot(made).count("shape=box") == len(made.net.transitions)
