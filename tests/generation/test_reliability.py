"""R(j, s) against the values of the thesis' formula, both channel models, and what a configuration may not say."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas.fragments import GestureChoice
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.references.pairs import channel_reliability, reliability


@pytest.mark.parametrize(
    ("distractors", "expected"),
    [(0, (0.70, 0.90, 0.98)), (1, (0.4118, 0.4737, 0.4949)), (2, (0.2917, 0.3214, 0.3311))],
)
def test_reliability_has_the_golden_values(distractors: int, expected: tuple[float, ...]) -> None:
    assert tuple(round(reliability(distractors, r), 4) for r in (0.70, 0.90, 0.98)) == expected


@pytest.mark.parametrize(
    ("gesture", "expected"),
    [("none", 0.70), ("gaze", 0.80), ("directed_gaze", 0.90), ("directed_gaze_with_pointing", 0.98)],
)
def test_defaults_give_the_reliabilities_of_the_scenario(gesture: GestureChoice, expected: float) -> None:
    assert reliability(0, channel_reliability(gesture, "it", GenerationConfig())) == pytest.approx(expected)


def test_neither_gesture_nor_phrase_is_understood_by_nobody() -> None:
    assert channel_reliability("none", "", GenerationConfig()) == 0
    assert reliability(0, 0.0) == 0


def test_independent_channels_fail_only_together() -> None:
    config = GenerationConfig(channel="independent")

    assert channel_reliability("directed_gaze", "it", config) == pytest.approx(1 - 0.8 * 0.3)
    assert channel_reliability("directed_gaze", "", config) == pytest.approx(0.2)


@pytest.mark.parametrize(("distractors", "channel"), [(-1, 0.5), (0, 1.0), (0, -0.1), (0, 1.5)])
def test_values_outside_the_formula_are_refused(distractors: int, channel: float) -> None:
    with pytest.raises(ValueError):
        reliability(distractors, channel)


@given(st.integers(0, 50), st.floats(0.01, 0.99), st.floats(0.01, 0.99))
def test_fewer_distractors_and_a_better_channel_are_more_reliable(count: int, one: float, other: float) -> None:
    assert 0 < reliability(count + 1, one) < reliability(count, one) < 1
    assert (reliability(count, one) <= reliability(count, other)) == (one <= other)


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"gaze_reliability": 0.0}, "gaze_reliability"),
        ({"gaze_reliability": 0.2, "directed_gaze_reliability": 0.2}, "directed_gaze_reliability"),
        ({"directed_gaze_reliability": 0.3}, "pointing_reliability"),
        ({"pointing_reliability": 0.30}, "phrase_reliability"),
        ({"phrase_reliability": 1.0}, "phrase_reliability"),
        ({"phrase_reliability": 0.0, "channel": "independent"}, "phrase_reliability"),
        ({"seconds_per_word": -0.1}, "seconds_per_word"),
        ({"barge_in": 0.0}, "barge_in"),
        ({"gaze_half_angle": 0.0}, "gaze_half_angle"),
        ({"gaze_half_angle": float("nan")}, "gaze_half_angle must be between 0 and pi"),
        ({"seconds_per_head_degree": float("nan")}, "seconds_per_head_degree must be a finite number"),
        ({"wait_weight": float("inf")}, "wait_weight must be a finite number"),
    ],
)
def test_a_bad_configuration_is_refused_by_name(values: dict[str, float], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        GenerationConfig(**values)  # type: ignore[arg-type]


def test_independent_channels_may_be_better_than_their_sum_allows() -> None:
    config = GenerationConfig(channel="independent", pointing_reliability=0.9)

    assert channel_reliability("directed_gaze_with_pointing", "it", config) == pytest.approx(0.97)
