"""What a fragment names and the world does not know costs nothing else of it."""

import pytest

from engage_hri.schemas.behaviors import (
    After,
    Constraint,
    FragmentBehavior,
    Gaze,
    Pointing,
    Reference,
    Speech,
    SpeechOption,
    Synchronize,
    Timing,
    Wait,
)
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.services.generation.fragment_check import bearable, checked
from engage_hri.services.simulation.still import table_world

WORLD = table_world()
WORDS = Speech(id="words", text="Here it is.")


def fragment(*behaviors: FragmentBehavior, **more: object) -> TurnFragment:
    return TurnFragment(id="f", behaviors=behaviors, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("lost", [Gaze(id="g", target="ghost"), Pointing(id="g", target="ghost")])
def test_a_look_or_a_point_at_nothing_is_left_out_and_told(lost: FragmentBehavior) -> None:
    found, warnings = bearable(fragment(lost, WORDS), WORLD, "robot")

    assert found.behaviors == (Wait(id="g", duration=0.0), WORDS)
    assert warnings == ("g: the world does not know 'ghost'; left out",)
    checked(found, WORLD, "robot")


def test_what_was_tied_to_it_is_tied_to_where_it_would_have_begun() -> None:
    tied = Speech(id="words", text="Here.", timing=(Timing("start", "g:stroke+0.5"), Timing("end", "other:end")))
    order = (After(ref="g:stroke_end", syncs=("words:start",)), Synchronize(syncs=("words:end", "g:end")))
    asked = fragment(
        Gaze(id="g", target="ghost", timing=(Timing("start", "other:end"), Timing("stroke", "words:end"))),
        tied,
        Wait(id="other", duration=1.0),
        constraints=(Constraint(operators=order),),
    )
    found, _ = bearable(asked, WORLD, "robot")

    assert found.behaviors[0].timing == (Timing("start", "other:end"),)
    assert found.behaviors[1].timing == (Timing("start", "g:start+0.5"), Timing("end", "other:end"))
    assert found.constraints[0].operators == (
        After(ref="g:start", syncs=("words:start",)),
        Synchronize(syncs=("words:end", "g:start")),
    )
    checked(found, WORLD, "robot")


def test_the_nearest_id_is_told() -> None:
    _, warnings = bearable(fragment(Gaze(id="g", target="blue-squere"), WORDS), WORLD, "robot")

    assert warnings == ("g: the world does not know 'blue-squere' (did you mean 'blue-square'?); left out",)


def test_a_phrase_may_name_objects_that_have_gone_as_those_that_it_could_mean() -> None:
    option = SpeechOption(text="the square", cost=2.0, distractors=("gone", "red-square"))
    asked = fragment(Reference(id="r", target="blue-square", options=(option,)), WORDS)
    known = {each.id for each in WORLD.objects}
    found, warnings = bearable(asked, WORLD, "robot")
    (kept,) = found.behaviors[0].options  # type: ignore[union-attr, misc]

    assert kept.distractors == tuple(each for each in option.distractors if each in known)
    assert warnings[0].startswith("r: the world does not know the object 'gone'")


def test_where_the_robot_was_to_look_while_it_thinks_is_no_reason_to_refuse() -> None:
    found, warnings = bearable(fragment(WORDS, delay=True, delay_target="ghost"), WORLD, "robot")

    assert found.delay_target == ""
    assert warnings == ("the world does not know 'ghost'; the robot looks elsewhere while it is silent",)


def test_a_fragment_of_which_nothing_is_left_stays_as_it_is_and_is_refused() -> None:
    asked = fragment(Gaze(id="g", target="ghost"))

    assert bearable(asked, WORLD, "robot") == (asked, ())


def test_a_piece_of_a_turn_is_never_refused_for_what_it_names() -> None:
    asked = fragment(Gaze(id="g", target="ghost"), turn_status="middle")

    assert bearable(asked, WORLD, "robot")[0].behaviors == (Wait(id="g", duration=0.0),)


def test_the_robot_itself_is_known() -> None:
    asked = fragment(Gaze(id="g", target="robot"), WORDS)

    assert bearable(asked, WORLD, "robot") == (asked, ())
