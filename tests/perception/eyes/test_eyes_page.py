"""docs/eyes.md: what it shows is right. No camera is here, so its command is read, and not run."""

import re
import shlex
from itertools import pairwise
from pathlib import Path

from engage_hri.services.commandline.shell.roster import group
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.perception.eyes.looking import SourceSettings
from engage_hri.services.runtime.configuration import read
from engage_hri.services.runtime.installation import LANDMARKS, offers
from engage_hri.services.runtime.parcels import FACE_MODELS

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "eyes.md").read_text(encoding="utf-8")


def shown(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


def test_its_command_has_settings_that_there_are():
    (_, install, command), [judged] = [block.strip().splitlines() for block in shown("sh")]
    assert judged.startswith(".venv/bin/engage check-perception tracker.mcap ")
    words = shlex.split(command)
    assert shlex.split(install)[1:] == ["eyes", "install"]
    assert words[:2] == [".venv/bin/engage", "run"]
    assert group(words[2]) == ("eyes",)

    settings = [value for option, value in pairwise(words) if option == "--set"]
    config = read(RobotConfig, settings=settings).eyes
    assert (config.source, config.place) == ("camera", (0.05, 0.0, 1.17))
    for setting in re.findall(r"`eyes\.(\w+)", PAGE):
        assert setting in config.__struct_fields__


def test_its_source_is_one():
    [code] = shown("python")
    names: dict[str, type] = {}
    exec(code, names)
    told = list(names["EmptyRoom"](SourceSettings()).look())

    assert [len(each.faces) for each in told] == [0] * 30


def test_it_tells_of_all_sources_and_of_the_package_of_the_models():
    for offer in offers(LANDMARKS):
        if offer.is_ours:
            assert re.search(rf"^\| .* \| `{offer.name}\b", PAGE, re.MULTILINE), offer.name
    assert f"{FACE_MODELS.name}](https://pypi.org/project/{FACE_MODELS.name}/) {FACE_MODELS.version}" in PAGE
