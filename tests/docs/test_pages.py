"""Every command and every snippet of README.md and docs/*.md, run against a robot in processes of its own.

All pages run at once, each in a folder of its own and in its order, while somebody talks with the robot. How a block
is run: `pages.py`. A block that nothing runs fails; what can't be run here is in `EXCUSED`, with the reason.
"""

import asyncio
import re
import shlex
import signal
from collections.abc import Mapping
from pathlib import Path

import msgspec
import pytest

from engage_hri.schemas.summary import Summary
from tests.bus.places import free_endpoint
from tests.cli.command import GOOD_BLOCK
from tests.docs.clone import PATIENCE, ROOT, Clone, Ended, run, run_until_it_prints, start, tell
from tests.docs.pages import (
    Block,
    Shown,
    Span,
    blocks,
    commands,
    is_complete,
    is_endless,
    is_printed,
    left_to_the_reader,
    spans,
)

pytestmark = pytest.mark.real_time

EXCUSED = {
    "make demo": "takes two and a half minutes; it runs with ARGS=--virtual-time",
    "make test": "is all but what is long, as this is; `make test-all` runs both",
    "make docs": "tests/docs/test_site.py builds it and looks at the result",
    "make generate": "writes into the tree; tests/docs/test_generated.py compares",
    ".venv/bin/engage up": "is what all pages are run against",
    "engage up --body pan_tilt.py:PanTilt --voice silent": "needs an SDK; tests/cli/test_bodies.py has one",
    "engage up --body head,face=reachy.py:Head --body left_arm,right_arm=simulated --voice silent": "the same",
    ".venv/bin/engage simulate --sessions 20 --seed 1 --out study": "takes minutes; tests/cli/test_simulate.py",
    "cc examples/connection_events.c -DZENOH_LINUX -lzenohpico -o events": "tests/cli/test_c_example.py",
    "./events tcp/127.0.0.1:7447": "the same",
    "make demo ARGS=--you": "waits for somebody to sit down; tests/console/test_window.py sits down",
    "engage run hearing": "needs a microphone; tests/perception/test_hearing.py has files",
    "engage run hearing --from talk.wav": "the same",
    "engage run door": "tests/door/test_door_page.py has a robot for it",
    "make test-frameworks": "fetches 200 MB; it was run with the versions that the page names",
    "make reachy-mini": "takes a minute and a half; .ci/run does it",
    "make eyes": "fetches 83 MB; .ci/run does it",
}
"""Commands that do not run here, and why."""
INSTALL = re.compile(r"\.venv/bin/python -m pip install -e '\.\[[\w-]+\]'")
"""It would change the environment that the tests run in, and all else that is made there. That there is such an extra
is tested in test_reading_pages.py."""
ELSEWHERE = {
    ("docs/control.md", "python"): "tests/control/test_docs.py",
    ("docs/contract.md", "python"): "tests/control/test_docs.py",
    ("docs/recognition.md", "mermaid"): "tests/recognition/test_tables.py",
    ("docs/recognition.md", "python"): "tests/recognition/test_new_kind.py",
    ("docs/recognition.md", "diff"): "tests/recognition/test_new_kind.py",
    ("docs/bus.md", "mermaid"): "tests/requests/test_request_model.py",
    ("docs/reachy-mini.md", "sh"): "tests/control/reachy_mini/test_docs.py",
    ("docs/generation.md", "python"): "tests/generation/test_head_policies.py",
    ("docs/hearing.md", "sh"): "tests/perception/test_hearing_page.py",
    ("docs/hearing.md", "python"): "tests/perception/test_hearing_page.py",
    ("docs/eyes.md", "sh"): "tests/perception/eyes/test_eyes_page.py",
    ("docs/eyes.md", "python"): "tests/perception/eyes/test_eyes_page.py",
    ("docs/pieces.md", "sh"): "tests/perception/pieces/test_pieces_page.py",
    ("docs/pieces.md", "python"): "tests/perception/pieces/test_pieces_page.py",
    ("docs/pieces.md", "toml"): "tests/perception/pieces/test_pieces_page.py",
    ("docs/people.md", "python"): "tests/client/test_people_page.py",
    ("docs/conversations.md", "python"): "tests/client/conversation/test_page.py",
    ("docs/talk.md", "python"): "tests/client/test_small_talk.py",
    ("docs/console.md", "nginx"): "tests/console/test_path.py",
    ("docs/voice-frameworks.md", "python"): "tests/frameworks/test_voice_page.py",
    ("docs/other-languages.md", "bash"): "tests/door/test_door_page.py",
    ("docs/other-languages.md", "javascript"): "tests/door/test_door_page.py",
    ("docs/hostile.md", "sh"): "tests/hostile/test_command.py",
    ("docs/hostile.md", "python"): "tests/hostile/test_docs.py",
}
"""Blocks that the tests of their part hold to what they say."""
IN_LESS_TIME = {
    "--sessions 200 ": "--sessions 1 ",
    "--embedded": "--embedded --virtual-time",
    "engage console": "engage console --port 0",
}
"""What is put in place of parts of a command, so that nobody waits for it here, or for a port that another has."""
ENDLESS = {"up": 0, "run": 0, "watch": 0, "console": 0, "talk": 0, "demo": 130}
"""Commands that go on until Ctrl-C (docs/commands.md), and their exit code then. Of a demo whose output no page shows
the beginning is enough."""
TALK = """\
from contextlib import suppress
from engage_hri.schemas.faults import InputRefused
from engage_hri.services.client.robot import connect

async with connect() as robot:
    await robot.person()
    while True:
        with suppress(InputRefused):  # generation may see the person a moment after us
            await robot.perform({"turn_status": "full", "parts": [{"say": "This is"}, {"refer": "blue-square"}]})
            print("said", flush=True)
"""
PAGES = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
}
SPANS = [span for page, text in PAGES.items() for span in spans(page, text)]
ITEMS: list[Block | Span] = sorted(
    [block for page, text in PAGES.items() for block in blocks(page, text)]
    + [span for span in SPANS if is_complete(span.text)],
    key=lambda item: (item.page, item.line),
)


class Page:
    """Runs what one page shows, in its order. What is wrong with an item: its complaint, else empty."""

    def __init__(self, name: str, clone: Clone, free: asyncio.Semaphore) -> None:
        self.items = [item for item in ITEMS if item.page == name]
        self._clone = clone
        self._folder = clone.folder(name.replace("/", "-"))
        self._free = free
        (self._folder / "hello.xml").write_text(GOOD_BLOCK)

    async def complaints(self) -> dict[Block | Span, str]:
        found = {}
        for item in self.items:
            try:
                found[item] = await (self._span(item) if isinstance(item, Span) else self._block(item))
            except Exception as error:
                found[item] = f"{type(error).__name__}: {error}"
        return found

    async def _span(self, span: Span) -> str:
        """In a sentence `engage` may stand for a command as such; with a file of the page it is a call."""
        call = span.text.startswith((".venv/", "make ")) or self._names_a_file(span.text)
        return await self._run(Shown(span.text)) if call else ""

    def _names_a_file(self, command: str) -> bool:
        return any((self._folder / word).is_file() for word in shlex.split(command) if word != "hello.xml")

    async def _block(self, block: Block) -> str:
        if (block.page, block.language) in ELSEWHERE:
            return ""
        match block.language:
            case "text":  # a drawing, or what no program prints as it stands
                shown = [
                    line for line in block.text.splitlines() if re.match(r"\$ |(\.venv|engage|make|pip)\b", line)
                ]
                return f"{shown[0]!r} stands in a block of text" if shown else ""
            case "sh" | "console":
                told = [await self._run(shown) for shown in commands(block)]
                return next(filter(None, told), "")
            case "python":
                return await self._python(block)
            case "xml" | "json" | "toml":
                return await self._file(block)
        return f"nothing runs a block of {block.language or 'no language'}"

    async def _run(self, shown: Shown) -> str:
        command = shown.command
        if (called := shlex.join(shlex.split(command, comments=True))) in EXCUSED or INSTALL.fullmatch(called):
            return ""
        for long, short in IN_LESS_TIME.items():
            command = command.replace(long, short)
        endless = re.search(rf"\bengage ({'|'.join(ENDLESS)})\b", command)
        if endless and shown.output is None:
            ended = await run_until_it_prints(command, self._folder)
            code = ended.code - ENDLESS[endless[1]]
            return _complaint(command, ended._replace(code=code), "" if ended.out else "it printed nothing")
        async with self._free:
            ended = await run(command, self._folder)
        if shown.output is None:
            return _complaint(command, ended)
        seen = ended.out + ended.err  # a refusal is shown like anything else
        return "" if is_printed(shown.output, seen) else f"{command}: it printed\n{seen}"

    async def _python(self, block: Block) -> str:
        """Each by itself: whoever copies one block has no other."""
        path = self._folder / f"line-{block.line}.py"
        path.write_text(self._clone.placed(block.text))
        names = " ".join(sorted(left_to_the_reader(block.text)))
        command = f".venv/bin/python {Path(__file__).with_name('snippet.py')} {path.name} {names}"
        if is_endless(block.text):
            ended = await run_until_it_prints(command, self._folder)
        else:
            ended = await run(command, self._folder)
        return _complaint("the snippet", ended, "" if ended.out else "it printed nothing")

    async def _file(self, block: Block) -> str:
        """A file of the page's commands; else it is read as what it is."""
        path = self._folder / (block.name or f"line-{block.line}.{block.language}")
        path.write_text(block.text)
        if block.name and any(block.name in item.text for item in self.items if item.line > block.line):
            return ""
        if '"status"' in block.text:
            msgspec.json.decode(block.text, type=Summary, strict=True)
            return ""
        option = "hello.xml --config" if block.language == "toml" else ""
        if '"entities"' in block.text:
            option = "hello.xml --world"
        return await self._run(Shown(f".venv/bin/engage plan {option} {path.name}"))


def _complaint(what: str, ended: Ended, wrong: str = "") -> str:
    if ended.code or wrong:
        return f"{what}: exit code {ended.code}, {wrong}\n{ended.err}"
    return ""


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Mapping[Block | Span, str]:
    return asyncio.run(_run_all(Clone(tmp_path_factory.mktemp("clone"), free_endpoint())))


async def _run_all(clone: Clone) -> dict[Block | Span, str]:
    robot = clone.folder("robot")
    (robot / "talk.py").write_text(TALK)
    up = await start(".venv/bin/engage up", robot)
    talk = await start(f".venv/bin/python {Path(__file__).with_name('snippet.py')} talk.py", robot)
    try:
        for process in (up, talk):
            assert process.stdout is not None
            assert process.stderr is not None
            async with asyncio.timeout(PATIENCE):
                assert await process.stdout.readline(), (await process.stderr.read()).decode()
        free = asyncio.Semaphore(2)
        pages = [Page(name, clone, free) for name in PAGES]
        return {
            item: complaint
            for complaints in await asyncio.gather(*(page.complaints() for page in pages))
            for item, complaint in complaints.items()
        }
    finally:
        for process in (talk, up):
            tell(process, signal.SIGINT)
            await process.communicate()


@pytest.mark.parametrize("item", ITEMS, ids=str)
def test_what_a_page_shows_works_as_it_stands(item: Block | Span, told: Mapping[Block | Span, str]) -> None:
    assert not told[item], told[item]
