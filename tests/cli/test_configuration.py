import re
from pathlib import Path

import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.commandline.config import Config, load

ROOT = Path(__file__).parents[2]


def test_every_key_says_what_it_means() -> None:
    page = (ROOT / "docs" / "configuration.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| `(.+?)` \| (?:`.+?`|required) \| (.*) \|$", page, re.MULTILINE)

    assert len(rows) == len(re.findall(r"^\| `", page, re.MULTILINE)) > 60
    assert [name for name, _, meaning in rows if len(meaning.split()) < 2] == []


def test_without_a_file_everything_has_its_default() -> None:
    assert load() == Config()


def test_a_setting_is_stronger_than_the_file_and_the_file_than_a_default(tmp_path: Path) -> None:
    path = tmp_path / "engage.toml"
    path.write_text("robot = 'file'\n[recognition]\ngaze_resolution = 'object'\n[control.variability]\nseed = 3\n")

    config = load(
        path,
        settings=["robot=setting", "control.variability.noise=0.1"],
        defaults=["recognition.gaze_resolution=table", "generation.dwell=0.7"],
    )

    assert config.robot == "setting"
    assert config.recognition.gaze_resolution == "object"
    assert config.generation.dwell == 0.7
    assert (config.control.variability.seed, config.control.variability.noise) == (3, 0.1)


def test_the_example_on_the_page_is_good(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "configuration.md").read_text()
    path = tmp_path / "engage.toml"
    path.write_text(page.partition("```toml\n")[2].partition("```")[0])

    assert load(path).robot == "melvin"


@pytest.mark.parametrize(
    ("setting", "reason"),
    [
        ("robot", "no value"),
        ("=3", "bad setting"),
        ("robot=3", "Expected `str`"),
        ("generation.dwell=long", "`generation.dwell`"),
        ("robot=a b", "cannot be part of a key"),
    ],
)
def test_a_bad_setting_is_refused_with_its_key(setting: str, reason: str) -> None:
    with pytest.raises(InputRefused, match=reason):
        load(settings=[setting])
