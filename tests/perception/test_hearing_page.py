"""docs/hearing.md: what it shows is right. No microphone is here, so its command is read, and not run."""

import re
import shlex
from itertools import pairwise
from pathlib import Path

import numpy as np

from engage_hri.services.commandline.shell.roster import group
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.perception.hearing.microphone import RECORDERS
from engage_hri.services.perception.hearing.recognizing import RecognizerSettings, SpeechWords, settings_of
from engage_hri.services.runtime.configuration import read
from engage_hri.services.runtime.installation import RECOGNIZERS, TURN_DETECTORS, offers

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "hearing.md").read_text(encoding="utf-8")


def shown(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


def test_its_commands_have_settings_that_there_are():
    commands = [block.strip().splitlines()[-1] for block in shown("sh")]
    configs = []
    for words in map(shlex.split, commands):
        assert words[:2] == [".venv/bin/engage", "run"]
        assert group(words[2]) == ("hearing",)
        settings = [value for option, value in pairwise(words) if option == "--set"]
        configs.append(read(RobotConfig, settings=settings).hearing)
    assert settings_of(configs[0]).phrases == ("yes", "no", "the blue one")
    assert configs[1].turn_detector in {each.name for each in offers(TURN_DETECTORS)}
    for setting in re.findall(r"`hearing\.(\w+)", PAGE):
        assert setting in configs[0].__struct_fields__


def test_its_recognizer_is_one():
    [code] = shown("python")
    names: dict[str, type] = {}
    exec(code, names)
    listening = names["MyRecognizer"](RecognizerSettings()).listen()
    listening.hear(np.zeros(160, np.int16))
    assert listening.end() == SpeechWords("160 samples")


def test_it_tells_of_all_recognizers_and_programs_that_record():
    rows = set(re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE))
    assert rows == {each.name for each in offers(RECOGNIZERS) if each.is_ours}
    for name in RECORDERS:
        assert f"`{name}`" in PAGE
