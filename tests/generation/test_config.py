"""The configuration of generation: refused at start by file and key, with what is allowed."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.generation.config import GenerationConfig


@dataclass
class Bad:
    toml: str
    says: str


BAD = [
    Bad("pointing_reliability = nan", "nan is not a number, in `generation.pointing_reliability`"),
    Bad("barge_in = inf", "barge_in must be a finite number, not inf"),
    Bad("wait_weight = -0.1", "wait_weight must not be negative, not -0.1"),
    Bad("glance_factor = 0", "glance_factor must be positive, not 0.0"),
    Bad("gaze_reliability = 0", "0 < gaze_reliability < directed_gaze_reliability"),
    Bad("gaze_reliability = 0.2", "does not hold: 0.2, 0.2, 0.28"),
    Bad("directed_gaze_reliability = 0.3", "does not hold: 0.1, 0.3, 0.28"),
    Bad("phrase_reliability = 1.0", "phrase_reliability must be in (0, 1), not 1.0"),
    Bad("phrase_reliability = 1.5", "Expected `float` <= 1.0, in `generation.phrase_reliability`"),
    Bad("phrase_reliability = 0.72", "pointing_reliability 0.28 + phrase_reliability 0.72 reaches 1"),
    Bad("phrase_reliability = 0.72", 'or set channel = "independent"'),
    Bad("gaze_half_angle = 5.7", "gaze_half_angle must be between 0 and pi/2 radians, not 5.7"),
    Bad("gaze_half_angle = 0", "gaze_half_angle must be between 0 and pi/2 radians"),
    Bad("pointing_radius = -0.1", "pointing_radius must be positive"),
    Bad("barge_in = true", "Expected `float | null`, got `bool`, in `generation.barge_in`"),
    Bad("barge_in = 'long'", "Expected `float | null`, got `str`, in `generation.barge_in`"),
    Bad("bargein = 0.3", "unknown key `bargein`; do you mean `barge_in`?, in `generation`"),
    Bad("zzz = 1", "unknown key `zzz`; known are condition, profile, channel"),
    Bad("channel = 'max'", "'max' is none of 'sum', 'independent', in `generation.channel`"),
    Bad(
        "condition = 'degraded'",
        "'degraded' is none of 'operational', 'degraded-generation', 'degraded-recognition'",
    ),
]


@pytest.mark.parametrize("bad", BAD, ids=lambda bad: bad.toml)
def test_a_bad_value_is_refused_by_file_and_key_with_what_is_allowed(tmp_path: Path, bad: Bad) -> None:
    path = tmp_path / "engage.toml"
    path.write_text(f"[generation]\n{bad.toml}\n")

    with pytest.raises(InputRefused) as refusal:
        load(path)

    assert bad.says in refusal.value.fault.reason
    assert "`generation" in refusal.value.fault.reason
    assert str(refusal.value).startswith(f"{path}: ")
    assert "docs/configuration.md" in str(refusal.value)


@pytest.mark.parametrize(
    ("toml", "says"),
    [
        ("[gneration]\nbarge_in = 1", "unknown key `gneration`; do you mean `generation`?"),
        ("generation = 3", "Expected `object`, got `int`, in `generation`"),
        (
            "[control.variability]\nslow = [{part = 3}]",
            "Expected `str`, got `int`, in `control.variability.slow[0].part`",
        ),
        ("[control.variability]\nstall = [{pat = 'head'}]", "unknown key `pat`; do you mean `part`?"),
        ("[recognition]\ngaze_resolution = 'eye'", "'eye' is none of 'object', 'table'"),
        ("[generation\n", "not TOML"),
    ],
)
def test_a_bad_table_is_refused(tmp_path: Path, toml: str, says: str) -> None:
    path = tmp_path / "engage.toml"
    path.write_text(toml)

    with pytest.raises(InputRefused) as refusal:
        load(path)

    assert says in str(refusal.value)


def test_channels_that_add_up_to_more_are_possible_when_they_are_independent() -> None:
    config = GenerationConfig(channel="independent", phrase_reliability=0.9, pointing_reliability=0.95)

    assert config.phrase_reliability + config.pointing_reliability > 1


def test_every_number_has_a_range() -> None:
    numbers = [name for name, value in defaults() if isinstance(value, float | int) and not isinstance(value, bool)]
    unchecked = []
    for name in numbers:
        try:
            GenerationConfig(**{name: -1.0})  # type: ignore[arg-type]
        except ValueError:
            continue
        unchecked.append(name)

    assert len(numbers) > 10
    assert unchecked == []


def defaults() -> list[tuple[str, object]]:
    config = GenerationConfig()
    return [(name, getattr(config, name)) for name in config.__struct_fields__]
