"""A new kind of event costs the two files that docs/recognition.md shows, and comes to all who list or count events.

The page is carried out in a copy of the tree; `laughing` runs there.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.real_time

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "recognition.md").read_text(encoding="utf-8").partition("## Add a kind of event")[2]
MODULE = "services/recognition/events/shared_laughter.py"


def shown(language: str) -> str:
    """The block of this language in the section."""
    (block,) = re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    return str(block)


def patched(text: str, patch: str) -> str:
    for hunk in patch.split("@@\n"):
        before = "".join(line[1:] for line in hunk.splitlines(keepends=True) if line[0] != "+")
        after = "".join(line[1:] for line in hunk.splitlines(keepends=True) if line[0] != "-")
        assert text.count(before) == 1, before
        text = text.replace(before, after)
    return text


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Any:
    tree = tmp_path_factory.mktemp("tree")
    for folder in ("engage_hri", "schemas", "services"):
        shutil.copytree(ROOT / folder, tree / folder, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    (tree / "tests").symlink_to(ROOT / "tests")
    behaviors = tree / "schemas" / "behaviors.py"
    behaviors.write_text(patched(behaviors.read_text(encoding="utf-8"), shown("diff")), encoding="utf-8")
    assert f"`{MODULE}`" in PAGE
    (tree / MODULE).write_text(shown("python"), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "tests.recognition.laughing"],
        cwd=tree, env={**os.environ, "PYTHONPATH": str(tree)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_both_begin_and_end_it(seen: Any) -> None:
    assert seen["plays"] == {
        "the person begins": [
            "sl-1 human started 1", "sl-1 human succeeded 1.5 delay 0.5",
            "sl-1 human completed 3 delay 0.5 lasting 1.5",
        ],
        "the robot begins": [
            "sl-1 robot started 1", "sl-1 robot succeeded 1.25 delay 0.25",
            "sl-1 robot completed 2 delay 0.25 lasting 0.75",
        ],
        "nobody joins in": ["sl-1 human started 1", "sl-1 human failed 3 delay 2"],
        "it is to somebody else": [],
        "it is asked for, and the person goes": [
            "sl-1 robot started 1", "sl-1 robot succeeded 2 delay 1", "sl-1 robot completed 4.5 delay 1 lasting 0.5",
            "answer: succeeded",
        ],
        "the person laughs already": [
            "sl-1 human started 1", "sl-1 human succeeded 1.5 delay 0.5", "answer: succeeded",
        ],
        "it is asked for in vain": [
            "sl-1 robot started 1", "sl-1 robot withdrawn 1.5", "sl-2 robot started 2",
            "sl-2 robot failed 3 delay 1", "answer: withdrawn", "answer: failed",
        ],
    }  # fmt: skip


def test_it_is_told_counted_and_asked_for_on_the_bus(seen: Any) -> None:
    assert seen["bus"] == {
        "states": ["started", "succeeded", "completed"], "open": ["shared_laughter"],
        "counted": [["shared_laughter", 1, 1]],
    }  # fmt: skip


def test_people_see_it(seen: Any) -> None:
    assert seen["shown"].pop("log") == [
        "0:01.0  human laughs with the robot",
        "0:01.0  * shared laughter, human → robot (human): waiting",
        "0:01.5  * shared laughter, human → robot (human): succeeded 0.50 s",
        "",
    ]
    assert seen["shown"] == dict.fromkeys(("tally", "live view", "window", "study"), True)
