"""Choices of the thesis and of Appendix B, decision by decision, and of sequences."""

import pytest

from engage_hri.schemas.behaviors import Reference, SpeechOption
from engage_hri.schemas.body import NoPointZone
from engage_hri.schemas.faults import RunFailed
from engage_hri.schemas.fragments import ReferenceChoice
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.references.motions import (
    AT_REST,
    CURRENT_POSE,
)
from engage_hri.services.generation.references.pairs import Pair
from engage_hri.services.generation.references.policy import choose
from tests.generation.tables import apart, body, flat_world, option, refer, scene

CONFIG = GenerationConfig()


def made(choice: ReferenceChoice) -> tuple[str, str]:
    return choice.gesture, choice.phrase


def choice_of(reference: Reference, **fields: object) -> ReferenceChoice:
    world = apart()
    chosen = choose([reference], scene(world, **fields), body(world, [reference.target]), CONFIG)
    return chosen.choices[0]


# -- Appendix B -------------------------------------------------------------------------------------------------

POINT, LOOK = "directed_gaze_with_pointing", "directed_gaze"
THIS = option("this", 1, [], deictic=True)
THAT = option("that", 1, [], deictic=True)


@pytest.mark.parametrize(
    ("references", "expected"),
    [
        (
            [
                refer("3a", "rectangle", 0.85, option("a rectangle")),
                refer("3b", "trapezoid", 0.95, option("a trapezoid")),
            ],
            [(LOOK, "a rectangle"), (POINT, "a trapezoid")],
        ),
        (
            [
                refer("5a", "blue-square", 0.95, option("the blue piece")),
                refer("5b", "rectangle", 0.85, option("the rectangle")),
            ],
            [(POINT, "the blue piece"), (LOOK, "the rectangle")],
        ),
        (
            [
                refer("18a", "purple-triangle", 0.95, THAT, option("the purple triangle")),
                refer("18b", "pink-square", 0.85, option("the pink square")),
            ],
            [(POINT, "that"), (LOOK, "the pink square")],
        ),
        (
            [
                refer("21a", "green-square", 0.95, option("the green square"), THIS),
                refer("21b", "blue-square", 0.85, option("the blue piece")),
            ],
            [(POINT, "this"), (LOOK, "the blue piece")],
        ),
    ],
    ids=["step 3", "step 5", "step 18", "step 21"],
)
def test_the_eight_choices_of_appendix_b(references: list[Reference], expected: list[tuple[str, str]]) -> None:
    world = apart()
    motions = body(world, [reference.target for reference in references])

    chosen = choose(references, scene(world), motions, CONFIG)

    assert [made(choice) for choice in chosen.choices] == expected
    assert chosen.warnings == ()


# -- decisions --------------------------------------------------------------------------------------------------


def test_a_reference_without_a_minimum_has_that_of_the_configuration() -> None:
    free = Reference(id="r", target="rectangle", options=(option("the rectangle"),))

    assert made(choice_of(free)) == made(choice_of(refer("r", "rectangle", 0.85, option("the rectangle"))))
    assert {pair.minimum for pair in choice_of(free).pairs} == {0.85}


def test_nothing_at_all_is_never_chosen() -> None:  # B2
    choice = choice_of(refer("r", "rectangle", 0.01, option("", 0), option("the rectangle")))

    assert choice.gesture != "none" or choice.phrase
    none = next(pair for pair in choice.pairs if pair.gesture == "none" and not pair.phrase)
    assert (none.reliability, none.feasible) == (0.0, False)


def test_the_empty_phrase_is_considered_only_if_offered() -> None:  # B3
    without = choice_of(refer("r", "rectangle", 0.05, option("the rectangle")))
    offered = choice_of(refer("r", "rectangle", 0.05, option("", 0), option("the rectangle")))

    assert {pair.phrase for pair in without.pairs} == {"the rectangle"}
    assert made(offered) == ("gaze", "")


def test_a_look_is_cheaper_than_a_directed_gaze_by_the_wait() -> None:  # B7
    choice = choice_of(refer("r", "rectangle", 0.75, option("the rectangle")))

    costs = {pair.gesture: pair.cost for pair in choice.pairs}
    assert made(choice) == ("gaze", "the rectangle")
    assert costs["gaze"] == pytest.approx(0.2 + 0.7)
    assert costs["directed_gaze"] - costs["gaze"] == pytest.approx(0.3)
    assert costs[POINT] - costs["directed_gaze"] == pytest.approx(1.0)


def test_a_deictic_phrase_is_never_without_a_point_and_rules_out_nothing_itself() -> None:  # B8
    world = apart()
    reference = refer("r", "rectangle", 0.5, option("this", 1, ["trapezoid"], deictic=True))

    chosen = choose([reference], scene(world), body(world, ["rectangle"]), CONFIG)

    rows = {pair.gesture: pair for pair in chosen.choices[0].pairs}
    assert chosen.choices[0].gesture == POINT
    assert "needs a point" in rows["directed_gaze"].reason
    assert len(rows["none"].distractors) == 9
    assert any("'this'" in warning for warning in chosen.warnings)


@pytest.mark.parametrize(
    ("fields", "reach", "reason"),
    [
        ({}, False, "out of reach"),
        ({"no_point": "pointing is inhibited"}, True, "inhibited"),
        ({"zones": (NoPointZone(center=(8.0, 0.0, 0.0), radius=0.5),)}, True, "no-point zone"),
    ],
)
def test_without_a_point_no_deictic_phrase(fields: dict[str, object], reach: bool, reason: str) -> None:  # B9
    world = apart()
    reference = refer("r", "rectangle", 0.9, option("this", 1, deictic=True), option("the rectangle"))
    motions = body(world, ["rectangle"], out_of_reach=[] if reach else ["rectangle"])

    choice = choose([reference], scene(world, **fields), motions, CONFIG).choices[0]

    assert made(choice) == (LOOK, "the rectangle")
    assert all(reason in pair.reason for pair in choice.pairs if pair.gesture == POINT)


def test_inhibited_gaze_leaves_words_only() -> None:
    choice = choice_of(refer("r", "rectangle", 0.5, option("the rectangle"), option("it")), no_gaze="inhibited")

    assert made(choice) == ("none", "it")


def test_what_is_not_understood_well_enough_is_made_as_well_as_possible_and_reported() -> None:  # B10
    world = apart()
    reference = refer("r", "rectangle", 0.99, option("the rectangle"), option("it"))

    chosen = choose([reference], scene(world), body(world, ["rectangle"]), CONFIG)

    assert made(chosen.choices[0]) == (POINT, "it")  # both phrases have R .98: the cheaper one
    (warning,) = chosen.warnings
    assert "0.99" in warning
    assert "0.98" in warning
    assert "'it'" in warning


def test_a_reference_that_cannot_be_made_says_why() -> None:
    with pytest.raises(RunFailed, match="deictic phrase needs a point"):
        choice_of(refer("r", "rectangle", 0.5, THIS), no_point="pointing is inhibited")


def test_distractors_are_those_that_every_channel_leaves() -> None:
    world = flat_world({"a": (0.0, 0.0), "near": (0.08, 0.0), "seen": (0.15, 0.0), "far": (1.0, 0.0)})
    reference = refer("r", "a", 0.5, option("it", distractors=["near", "far"]))

    choice = choose([reference], scene(world), body(world, ["a"]), CONFIG).choices[0]

    distractors = {pair.gesture: pair.distractors for pair in choice.pairs}
    assert distractors == {"none": ("far", "near"), "gaze": ("near",), "directed_gaze": ("near",), POINT: ("near",)}


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        # same cost: a deictic phrase with a point goes first
        ([option("the piece"), option("this piece", deictic=True)], (POINT, "this piece")),
        # then higher R
        ([option("a b", distractors=["trapezoid"]), option("c d")], (POINT, "c d")),
        # then the order of the options
        ([option("first one"), option("other one")], (POINT, "first one")),
    ],
)
def test_ties_are_broken_as_decided(options: list[SpeechOption], expected: tuple[str, str]) -> None:
    world = flat_world({"rectangle": (0.0, 0.0), "trapezoid": (0.05, 0.0), "far": (5.0, 0.0)})
    reference = refer("r", "rectangle", 0.3, *options)
    free = GenerationConfig(seconds_per_head_degree=0, seconds_per_arm_degree=0, wait_weight=0)

    choice = choose([reference], scene(world), body(world, ["rectangle"]), free).choices[0]

    assert made(choice) == expected


def test_where_words_cost_nothing_they_tie_whatever_their_number() -> None:
    world = flat_world({"rectangle": (0.0, 0.0), "trapezoid": (0.05, 0.0)})
    reference = refer("r", "rectangle", 0.3, option("it", distractors=["trapezoid"]), option("the long rectangle"))

    chosen = choose([reference], scene(world), body(world, ["rectangle"]), GenerationConfig(seconds_per_word=0.0))

    assert made(chosen.choices[0]) == ("none", "the long rectangle")  # R .70 instead of .41


def test_with_independent_channels_more_is_needed_for_the_same_minimum() -> None:
    world = apart()
    reference = refer("r", "rectangle", 0.8, option("it"))

    summed, independent = (
        choose([reference], scene(world), body(world, ["rectangle"]), GenerationConfig(channel=channel)).choices[0]
        for channel in ("sum", "independent")  # type: ignore[arg-type]
    )

    assert (made(summed), summed.reliability) == (("gaze", "it"), pytest.approx(0.8))
    assert (made(independent), independent.reliability) == (
        (POINT, "it"), pytest.approx(1 - 0.72 * 0.3),
    )  # fmt: skip
    assert independent.pairs[2].reliability == pytest.approx(0.76)  # directed gaze: 1 - .8 x .3


def test_only_objects_are_distractors_and_the_target_is_none_of_its_own() -> None:
    world = apart()
    everything = [entity.id for entity in world.entities]
    choice = choose(
        [refer("r", "rectangle", 0.1, option("it", distractors=everything))],
        scene(world),
        body(world, ["rectangle"]),
        CONFIG,
    ).choices[0]

    assert set(choice.pairs[0].distractors) == {id for id in everything if id not in ("human", "rectangle")}


def test_of_equal_cost_and_reliability_the_fewer_gestures_win() -> None:
    """Two gestures cannot have one reliability by the formula, so compare the preference itself."""
    one, other = (
        Pair(gesture=gesture, order=0, option=option("it"), distractors=frozenset(), channel=0.7, reliability=0.7)
        for gesture in ("gaze", "directed_gaze")
    )

    assert one.preference < other.preference


def test_every_pair_is_in_the_table_with_its_reason() -> None:
    choice = choice_of(refer("r", "rectangle", 0.85, option("the rectangle"), option("it")))

    assert len(choice.pairs) == 8
    assert [pair.chosen for pair in choice.pairs].count(True) == 1
    reasons = {(pair.gesture, pair.phrase): pair.reason for pair in choice.pairs}
    assert reasons[LOOK, "it"] == "least cost"
    assert reasons["none", "it"] == "R 0.7 below 0.85"
    assert reasons[POINT, "it"] == "dearer by 1 s"


# -- sequences --------------------------------------------------------------------------------------------------


def test_an_arm_that_is_near_already_changes_the_next_choice() -> None:
    """Alone each is said; together the first point pays for the second."""
    world = apart()
    long = "the long name of this thing here"
    references = [refer(str(i), id, 0.65, option(long, 3), THIS) for i, id in enumerate(["rectangle", "trapezoid"])]

    def arm(since: str, target: str) -> float:
        return 40.0 if since == CURRENT_POSE else 0.0

    motions = body(world, ["rectangle", "trapezoid"], head=lambda since, target: 5.0, arm=arm)

    alone = [choose([each], scene(world), motions, CONFIG).choices[0] for each in references]
    together = choose(references, scene(world), motions, CONFIG).choices

    assert [made(choice)[0] for choice in alone] == ["none", "none"]
    assert [made(choice)[0] for choice in together] == [POINT, POINT]
    assert sum(choice.cost for choice in together) < sum(choice.cost for choice in alone)
    assert "dearer over the sequence" not in {pair.reason for pair in together[1].pairs}


def test_a_hand_that_has_just_pointed_elsewhere_starts_from_there_and_the_other_from_home() -> None:
    world = apart()
    targets = ["rectangle", "pink-square", "trapezoid", "blue-square"]
    references = [refer(id, id, 0.95, option("it")) for id in targets]
    sides = dict.fromkeys(targets, "left_arm") | {"trapezoid": "right_arm"}
    degrees = {
        (AT_REST, "blue-square"): 66.0,
        (CURRENT_POSE, "rectangle"): 60.0,
        (CURRENT_POSE, "trapezoid"): 120.0,
        ("rectangle", "pink-square"): 6.0,
    }
    motions = body(world, targets, arm=lambda since, target: degrees.get((since, target), 999.0), arm_for=sides.get)  # type: ignore[arg-type]

    chosen = choose(references, scene(world), motions, CONFIG)

    assert [choice.gesture for choice in chosen.choices] == [POINT] * 4
    assert [choice.cost for choice in chosen.choices] == pytest.approx(
        [0.85 + 1.0, 0.85 + 0.1, 0.85 + 2.0, 0.85 + 1.1]
    )
    assert list(chosen.hands.values()) == ["LEFT_HAND", "LEFT_HAND", "RIGHT_HAND", "LEFT_HAND"]
