"""What docs/other-languages.md shows of the door: the command, its lines for curl, its JavaScript in a browser."""

import json
import re
import shutil
import subprocess
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from tests.bus.places import free_endpoint
from tests.console import browser
from tests.console.windows import engage
from tests.docs.pages import blocks

PAGE = Path(__file__).parents[2] / "docs" / "other-languages.md"
ASK = """\
<ebml:ebml xmlns:ebml="edu.wpi.ebml" xmlns="org.mindmakers.bml" id="ask" turnIndex="1" turnStatus="full">
  <speech id="please"><text>Thank you.</text></speech>
</ebml:ebml>
"""
pytestmark = pytest.mark.real_time


def shown(language: str) -> str:
    [block] = [each.text for each in blocks("docs/other-languages.md", PAGE.read_text()) if each.language == language]
    return block


class RunningDoor(NamedTuple):
    folder: Path
    port: str
    told: str

    def placed(self, text: str) -> str:
        return text.replace(":8138", f":{self.port}")


@contextmanager
def running_door(folder: Path) -> Iterator[RunningDoor]:
    """A robot as a process, and its door as another one, as the page has it."""
    endpoint = free_endpoint()
    port = free_endpoint().rpartition(":")[2]
    door = ("run", "door", "--connect", endpoint, "--set", f"door.port={port}")
    door += ("--set", f"door.folder={json.dumps(str(folder / 'door-tokens'))}")
    with (
        engage(folder / "up", "up", "--in-one", "--listen", endpoint, "--set", "simulation.human=attentive") as up,
        engage(folder / "door", *door) as opened,
    ):
        browser.waited(up, folder / "up", rb"(all services are up)")
        browser.waited(opened, folder / "door", rb"(door is ready)")
        yield RunningDoor(folder, port, (folder / "door").read_text())


def test_the_lines_for_curl_are_answered_and_the_command_tells_where_it_is(tmp_path: Path) -> None:
    if shutil.which("curl") is None:
        pytest.skip("there is no curl on this machine")
    (tmp_path / "ask.xml").write_text(ASK)
    with running_door(tmp_path) as door:
        lines = door.placed(shown("bash")).splitlines()
        answers = []
        for line in lines[1:]:
            script = f"{lines[0]}\n{line}"
            answered = subprocess.check_output(("bash", "-c", script), cwd=tmp_path, timeout=60)
            answers.append(json.loads(answered))

    world, turn, fragment, floor = answers
    assert [each["type"] for each in (world, fragment, floor)] == ["world", "fragment_outcome", "floor"]
    assert (turn["status"], turn["said"], fragment["status"]) == ("done", "Please take the blue square", "done")
    assert f"the door is at http://127.0.0.1:{door.port}/v1/" in door.told
    for role in ("observer", "manager"):
        assert re.search(rf"token of the role {role}: in .*door-tokens/{role}$", door.told, re.MULTILINE)
        assert (tmp_path / "door-tokens" / role).read_text().strip() not in door.told


@asynccontextmanager
async def page(folder: Path) -> AsyncIterator[Any]:
    if browser.CHROMIUM is None:
        pytest.skip("there is no Chromium on this machine")
    (folder / "browser").mkdir()
    with browser.running(folder / "browser") as port:
        async with browser.at_port(port) as opened, opened.page() as shown:
            yield shown


async def test_the_javascript_writes_a_turn_from_a_page_that_is_from_elsewhere(tmp_path: Path) -> None:
    with running_door(tmp_path) as door:
        token = (tmp_path / "door-tokens" / "manager").read_text().strip()
        async with page(tmp_path) as elsewhere:
            script = door.placed(shown("javascript")).replace("console.log(", "told(")
            ends = "speak.addEventListener('message', (it) => JSON.parse(it.data).type === 'over' && end(lines));"
            told = await elsewhere.value(
                f"new Promise((end) => {{ const token = '{token}'; const lines = [];"
                f"const told = (...said) => lines.push(said.join(' ')); {script} {ends} }})"
            )
            seen = await elsewhere.value(
                f"fetch('http://127.0.0.1:{door.port}/v1/world', {{headers: {{authorization: 'Bearer {token}'}}}})"
                ".then((answer) => answer.json()).then((world) => world.type)"
            )

    whole = "Please take the blue square and put it down."
    assert told == [*whole.split(), f"{whole} done"]
    assert seen == "world"
