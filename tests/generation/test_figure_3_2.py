"""Fig. 3.2 as printed, read from its XML: when it becomes Fig. 3.3, and what becomes of it otherwise."""

import pytest

from engage_hri.schemas.behaviors import Event, Gaze, Pointing, Reference, Speech
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.services.generation.block.emission import FragmentPlan
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.fragment_check import checked
from engage_hri.services.generation.inhibitions import Permits
from engage_hri.services.generation.pipeline import targets
from engage_hri.services.generation.turns.plan import plan_turn
from tests.generation.emitted import POINT, by_id, lines
from tests.generation.tables import TANGRAMS, body, flat_world, plan, scene


def others(target: str) -> str:
    return "".join(f'<distractor object="{id}"/>' for id in TANGRAMS if id != target)


FIGURE = f"""\
<ebml:ebml id="ebml-example" xmlns="org.mindmakers.bml" xmlns:ebml="edu.wpi.ebml" turnIndex="1" turnStatus="full">
  <speech id="speech-1"><text>Please place</text></speech>
  <ebml:reference id="ref-1" target="yellow-triangle" minReliability="0.85">
    <speechOption text="the triangle" cost="2">
      <distractor object="pink-triangle"/><distractor object="purple-triangle"/>
    </speechOption>
    <speechOption text="the yellow triangle" cost="3"/>
    <speechOption text="it" cost="1"/>
    <speechOption text="this piece" cost="2" deictic="true">{others("yellow-triangle")}</speechOption>
  </ebml:reference>
  <speech id="speech-3"><text>on the right side of</text></speech>
  <ebml:reference id="ref-2" target="purple-square" minReliability="0.85">
    <speechOption text="the square" cost="2">
      <distractor object="red-square"/><distractor object="blue-square"/>
      <distractor object="pink-square"/><distractor object="green-square"/>
    </speechOption>
    <speechOption text="the purple square" cost="3"/>
    <speechOption text="this piece" cost="2" deictic="true">{others("purple-square")}</speechOption>
  </ebml:reference>
  <constraint id="constraint-1">
    <synchronize ref="speech-1:end"><sync ref="ref-1:start"/></synchronize>
    <synchronize ref="ref-1:end"><sync ref="speech-3:start"/></synchronize>
    <synchronize ref="speech-3:end"><sync ref="ref-2:start"/></synchronize>
  </constraint>
</ebml:ebml>
"""
WITHOUT_IT = FIGURE.replace('<speechOption text="it" cost="1"/>', "")
BESIDE = {"pink-triangle": (2.15, 0.0), "purple-square": (7.0, 0.0), "red-square": (7.15, 0.0)}
"""A triangle in the gaze cone at the yellow one, a square in that at the purple one."""
NEAR, FAR = (1.0, 1.0), (30.0, 30.0)


def planned(
    xml: str,
    yellow: tuple[float, float] = NEAR,
    purple: tuple[float, float] = FAR,
    beside: dict[str, tuple[float, float]] = BESIDE,
    **config: object,
) -> FragmentPlan:
    """yellow, purple: degrees of head and arm to each. rs .85, so that words alone may do."""
    settings = {
        "phrase_reliability": 0.85, "gaze_reliability": 0.05, "directed_gaze_reliability": 0.08,
        "pointing_reliability": 0.10, **config,
    }  # fmt: skip
    world = flat_world({**{id: (float(index), 0.0) for index, id in enumerate(TANGRAMS)}, **beside})
    read = decode_xml(xml.encode())
    assert isinstance(read, TurnFragment)
    fragment = checked(read, world, "robot")
    degrees = {"yellow-triangle": yellow, "purple-square": purple}
    motions = body(
        world,
        targets(fragment),
        head=lambda since, target: degrees[target][0],
        arm=lambda since, target: degrees[target][1],
    )
    where = scene(world)
    made = GenerationConfig(gaze_half_angle=where.half_angle, pointing_radius=where.pointing_radius, **settings)  # type: ignore[arg-type]
    return plan(fragment, plan_turn(fragment, "turn", "human"), world, None, motions, Permits(), made)


def choices(plan: FragmentPlan) -> list[tuple[str, str]]:
    return [(choice.gesture, choice.phrase) for choice in plan.choices]


@pytest.mark.parametrize("profile", ["check-back", "figure-3.3"])
def test_without_it_fig_3_2_becomes_fig_3_3(profile: str) -> None:
    made = planned(WITHOUT_IT, profile=profile)

    assert choices(made) == [(POINT, "this piece"), ("none", "the purple square")]
    assert made.warnings == ()
    spoken = [behavior.text for behavior in made.block.behaviors if isinstance(behavior, Speech)]
    assert " ".join(spoken) == "Please place this piece on the right side of the purple square"
    gaze, *_ = [behavior for behavior in made.block.behaviors if isinstance(behavior, Gaze)]
    (point,) = [behavior for behavior in made.block.behaviors if isinstance(behavior, Pointing)]
    assert gaze.target == point.target == "yellow-triangle"
    directed = [each for each in made.block.behaviors if isinstance(each, Event) and each.kind == "directed_gaze"]
    assert [event.objects for event in directed] == [("yellow-triangle",)]


def test_fig_3_3_is_tied_together_as_the_figure_says() -> None:
    tied = lines(planned(WITHOUT_IT, profile="figure-3.3").block)

    for line in (
        "ref-1-gaze:stroke = speech-1:start",
        "ref-1-point:stroke_start = ref-1-gaze:stroke+2",
        "ref-1-phrase:start = ref-1-point:stroke_end",
        "speech-3:start = ref-1-phrase:end",
        "ref-2-phrase:start = speech-3:end",
        "ref-1-phrase:start after speech-1:end",  # which the figure lost
    ):
        assert line in tied


def test_check_back_holds_the_point_until_the_human_has_looked_and_then_glances() -> None:
    tied = lines(planned(WITHOUT_IT, profile="check-back").block)

    for line in (
        "ref-1-gaze:start = speech-1:end",
        "ref-1-phrase:start = ref-1-point:stroke_start",
        "ref-1-point:stroke_start after ref-1-gaze:stroke",
        "ref-1-point:stroke_end after ref-1-phrase:end",
        "ref-1-point:stroke_end after ref-1-event:end",
        "ref-1-glance:start = ref-1-gaze:relax",
        "speech-3:start = ref-1-phrase:end",
        "ref-2-phrase:start = speech-3:end",
    ):
        assert line in tied


@pytest.mark.parametrize("profile", ["check-back", "figure-3.3"])
def test_with_it_no_gesture_is_needed(profile: str) -> None:
    made = planned(FIGURE, profile=profile)

    assert choices(made) == [("none", "it"), ("none", "the purple square")]
    looked_at = [behavior.target for behavior in made.block.behaviors if isinstance(behavior, Gaze)]
    assert looked_at == ["human"]  # the end of the turn
    assert not any(isinstance(behavior, Reference | Pointing) for behavior in made.block.behaviors)
    assert {"ref-1-phrase", "ref-2-phrase"} <= by_id(made.block).keys()


def test_a_look_that_is_cheaper_than_a_word_does_not_save_the_word_that_tells_squares_apart() -> None:
    """By the formula alone it would: the gaze rules out the four other squares, for 0.30 s; a word costs 0.35 s."""
    made = planned(WITHOUT_IT, purple=(30.0, 30.0), beside={**BESIDE, "red-square": (9.5, 3.0)})

    assert choices(made)[1] == ("none", "the purple square")
    rows = {(pair.gesture, pair.phrase): pair for pair in made.choices[1].pairs}
    look = rows["gaze", "the square"]
    assert (look.distractors, look.feasible, look.reason) == ((), True, "the look alone rules out 4")
    assert look.cost < made.choices[1].cost


def test_a_point_that_costs_one_word_exactly_ties_and_is_made() -> None:
    """0.3 s of waiting, 1 degree of the head, 2.4 of the arm: the word that "the yellow triangle" has more (B13)."""
    tie = planned(WITHOUT_IT, yellow=(1.0, 2.4))
    dearer = planned(WITHOUT_IT, yellow=(1.0, 2.41))

    assert choices(tie)[0] == (POINT, "this piece")
    rows = {(pair.gesture, pair.phrase): pair.reason for pair in tie.choices[0].pairs}
    assert rows["none", "the yellow triangle"] == "same cost, less preferred"
    assert choices(dearer)[0] == ("none", "the yellow triangle")


def test_where_no_words_tell_the_triangles_apart_a_look_does_and_a_warning_says_so() -> None:
    apart = {**BESIDE, "pink-triangle": (9.5, 3.0)}
    vague = WITHOUT_IT.replace('<speechOption text="the yellow triangle" cost="3"/>', "")

    made = planned(vague, yellow=(1.0, 99.0), beside=apart)

    assert choices(made)[0] == ("gaze", "the triangle")
    assert made.warnings == (
        "ref-1: 'the triangle' may mean 3 objects, and the look alone tells which "
        "(a higher certainty, or minimum reliability, asks for a point, if one is possible)",
    )


def test_words_alone_do_not_do_below_rs_85() -> None:
    made = planned(WITHOUT_IT, phrase_reliability=0.84)

    assert all(gesture != "none" for gesture, _ in choices(made))


def test_as_printed_the_list_of_this_piece_is_cut_short_and_warned_of() -> None:
    cut = WITHOUT_IT.replace(others("yellow-triangle"), '<distractor object="pink-triangle"/>')

    made = planned(cut)

    assert choices(made)[0] == (POINT, "this piece")
    assert [warning.partition(":")[0] for warning in made.warnings] == ["ref-1"]
    assert "'this piece' are everything else" in made.warnings[0]
