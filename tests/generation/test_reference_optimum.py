"""The choice against brute force: the best of all sequences, ties and all; and what holds for every choice."""

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behaviors import Reference, SpeechOption
from engage_hri.schemas.faults import RunFailed
from engage_hri.schemas.fragments import ReferenceChoice
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.references.motions import AT_REST, CURRENT_POSE
from engage_hri.services.generation.references.pairs import GESTURES
from engage_hri.services.generation.references.policy import Choices, choose
from tests.generation.oracle import Best, Problem, optimum, optimum_by_gestures
from tests.generation.tables import option, refer
from tests.random_cases import share_of

POINT = "directed_gaze_with_pointing"
NAMES = ("a", "b", "c", "d", "e")
DEGREES = st.sampled_from([0, 0, 15, 30, 45, 90])
MINIMA = st.sampled_from([0.05, 0.3, 0.45, 0.7, 0.8, 0.85, 0.95, 0.99])


@st.composite
def options(draw: st.DrawFn, target: str, most: int) -> list[SpeechOption]:
    offered = []
    for _ in range(draw(st.integers(1, most))):
        text = draw(st.sampled_from(["some words", "other words", "it", "this", ""]))
        others = sorted(draw(st.sets(st.sampled_from([name for name in NAMES if name != target]))))
        offered.append(option(text, draw(st.integers(0, 3)), others, deictic=text == "this"))
    return offered


@st.composite
def problems(draw: st.DrawFn, fewest: int, most: int, phrases: int) -> Problem:
    spots = st.integers(0, 8).map(lambda steps: steps * 0.06)
    targets = draw(st.lists(st.sampled_from(NAMES), min_size=fewest, max_size=most))
    places = (CURRENT_POSE, AT_REST, *NAMES)
    problem = Problem(
        places={name: (draw(spots), draw(spots)) for name in NAMES},
        references=[
            refer(f"ref-{number}", target, draw(MINIMA), *draw(options(target, phrases)))
            for number, target in enumerate(targets)
        ],
        head={(since, target): draw(DEGREES) for since in places for target in NAMES},
        arm={(since, target): draw(DEGREES) for since in places for target in NAMES},
        arm_for=lambda target: "left_arm" if target in "abc" else "right_arm",
        unable=frozenset(draw(st.sets(st.sampled_from(NAMES), max_size=1))),
        refused=frozenset(draw(st.sets(st.tuples(st.sampled_from(NAMES), st.sampled_from(NAMES)), max_size=3))),
        no_gaze=draw(st.sampled_from(["", "", "", "gaze is inhibited"])),
        no_point=draw(st.sampled_from(["", "", "", "pointing is inhibited"])),
        channel=draw(st.sampled_from(["sum", "independent"])),
        apart=frozenset(draw(st.sets(st.sampled_from(["ref-1", "ref-2", "ref-3"])))),
    )
    assume(optimum_by_gestures(problem) is not None)
    return problem


def chosen(problem: Problem) -> Choices:
    config = GenerationConfig(channel=problem.channel)
    return choose(problem.references, problem.scene(), problem.motions(), config, problem.apart)


def pairs_of(choices: Choices) -> list[tuple[int, int]]:
    """Numbers of gesture and option, by the row of the table that is marked."""
    marked = [[pair.chosen for pair in choice.pairs].index(True) for choice in choices.choices]
    phrases = [len(choice.pairs) // len(GESTURES) for choice in choices.choices]
    return [divmod(row, count) for row, count in zip(marked, phrases, strict=True)]


def assert_best(problem: Problem, best: Best | None) -> None:
    assert best is not None
    choices = chosen(problem)

    assert sum(choice.cost for choice in choices.choices) == pytest.approx(best[0] / 600, abs=1e-9)
    assert tuple(pairs_of(choices)) == best[2]


@settings(max_examples=share_of(100), deadline=None)
@given(problems(1, 2, 5))
def test_of_one_or_two_references_the_best_of_all_sequences_is_chosen(problem: Problem) -> None:
    assert_best(problem, optimum(problem))


@settings(max_examples=share_of(30), deadline=None)
@given(problems(3, 3, 5))
def test_of_three_references_the_best_of_all_sequences_is_chosen(problem: Problem) -> None:
    best = optimum(problem)

    assert_best(problem, best)
    assert best == optimum_by_gestures(problem)  # which the next test relies on


@settings(max_examples=share_of(25), deadline=None)
@given(problems(4, 4, 2))
def test_of_four_references_with_two_phrases_the_best_of_all_sequences_is_chosen(problem: Problem) -> None:
    assert_best(problem, optimum(problem))


@settings(max_examples=share_of(60), deadline=None)
@given(problems(4, 5, 5))
def test_of_five_references_with_five_phrases_the_best_of_all_sequences_of_gestures_is_chosen(
    problem: Problem,
) -> None:
    assert_best(problem, optimum_by_gestures(problem))


@settings(max_examples=share_of(100), deadline=None)
@given(problems(1, 4, 4))
def test_what_holds_for_every_choice(problem: Problem) -> None:
    choices = chosen(problem)

    for reference, choice in zip(problem.references, choices.choices, strict=True):
        row = next(pair for pair in choice.pairs if pair.chosen)
        warned = any(f"{reference.id}: nothing reaches" in warning for warning in choices.warnings)
        deictic = {option.text for option in reference.options if option.deictic}
        assert choice.phrase not in deictic or choice.gesture == POINT
        assert (row.reliability >= reference.minimum_reliability - 1e-9) != warned
        assert row.reliability > 0
        assert not problem.no_gaze or choice.gesture == "none"
        assert not problem.no_point or choice.gesture != POINT
        assert choice.target not in problem.unable or choice.gesture != POINT
        assert len(choice.pairs) == 4 * len(reference.options)
        for pair in choice.pairs:
            assert pair.reliability == pytest.approx(
                1 / (len(pair.distractors) + 1 / pair.channel) if pair.channel else 0.0
            )
            assert choice.target not in pair.distractors
            assert pair.reason


@settings(max_examples=share_of(60), deadline=None)
@given(problems(1, 3, 4), st.randoms(use_true_random=False))
def test_the_order_of_the_options_decides_nothing_but_ties(problem: Problem, random: object) -> None:
    def shuffled(reference: Reference) -> Reference:
        mixed = list(reference.options)
        random.shuffle(mixed)  # type: ignore[attr-defined]
        return refer(reference.id, reference.target, reference.minimum_reliability, *mixed)

    def rank(choice: ReferenceChoice) -> tuple[str, float, float]:
        return choice.gesture, round(choice.reliability, 9), round(choice.cost, 9)

    before = chosen(problem)
    after = chosen(problem._replace(references=[shuffled(reference) for reference in problem.references]))

    assert [rank(choice) for choice in after.choices] == [rank(choice) for choice in before.choices]


# -- where a body refuses from one pose what it can do from another ------------------------------------------------


def pointing_at_both(refused: set[tuple[str, str]], *options: SpeechOption) -> Problem:
    places = {"a": (0.0, 0.0), "b": (9.0, 0.0)}
    degrees = {(since, target): 30 for since in (CURRENT_POSE, AT_REST, "a", "b") for target in ("a", "b")}
    this = option("this", 1, deictic=True)
    references = [refer("1", "a", 0.95, this), refer("2", "b", 0.95, this, *options)]
    return Problem(places, references, degrees, degrees, lambda target: "right_arm", refused=frozenset(refused))


def test_a_motion_that_the_body_refuses_from_there_is_not_free() -> None:
    choices = chosen(pointing_at_both({("a", "b")}, option("the one over there")))

    first, second = choices.choices
    assert (first.gesture, first.phrase) == (POINT, "this")
    assert (second.gesture, second.phrase) == ("directed_gaze", "the one over there")
    assert "2: nothing reaches the minimum reliability 0.95" in choices.warnings[0]
    refusals = {pair.reason for pair in second.pairs if pair.gesture == POINT}
    assert refusals == {"cannot point from there: out of reach"}
    assert not any(pair.feasible for pair in second.pairs)


def test_if_then_nothing_is_left_the_reference_cannot_be_made() -> None:
    with pytest.raises(RunFailed, match="cannot be done from where the references before it leave the body"):
        chosen(pointing_at_both({("a", "b")}))


def test_of_two_equally_dear_ways_to_one_posture_the_preferred_one_goes_on() -> None:
    """First a look without a word or a word without a look, both 0.35 s; the second look is needed either way."""
    degrees = {(since, target): 35 for since in (CURRENT_POSE, AT_REST, "a", "b") for target in ("a", "b")}
    references = [refer("1", "a", 0.05, option("", 0), option("it")), refer("2", "b", 0.8, option("it"))]
    problem = Problem({"a": (0.0, 0.0), "b": (9.0, 0.0)}, references, degrees, degrees, lambda target: "right_arm")

    choices = chosen(problem)

    assert [(choice.gesture, choice.phrase) for choice in choices.choices] == [("none", "it"), ("gaze", "it")]
    assert_best(problem, optimum(problem))
