"""`engage steer condition` beside a generation in a process of its own, over real sockets."""

import asyncio
import re
from asyncio.subprocess import Process

import pytest

from tests.bus.places import free_endpoint
from tests.cli.command import start
from tests.cli.test_processes import PATIENCE, line, stopped

pytestmark = pytest.mark.real_time


async def said(process: Process) -> tuple[int, str, str]:
    out, err = await asyncio.wait_for(process.communicate(), PATIENCE)
    assert process.returncode is not None
    return process.returncode, out.decode().strip(), err.decode().strip()


async def shown(*where: str) -> str:
    """The present condition, without for how long."""
    code, out, error = await said(await start("steer", "condition", *where))
    assert (code, error) == (0, "")
    text, count = re.subn(r", for \d+ s$", "", out)
    assert count == 1
    return text


async def test_a_condition_is_begun_shown_and_ended_from_the_command_line() -> None:
    where = ("--robot", "studied", "--connect", endpoint := free_endpoint())
    generation = await start("run", "generation", "--robot", "studied", "--listen", endpoint)
    try:
        await line(generation, "generation is ready")
        assert await shown(*where) == "condition of the study: none"

        begun = await start("steer", "condition", "words alone", "--speech-only", "--by", "Anna", *where)
        assert await said(begun) == (
            0, "condition of the study, from now on: words alone, speech only", ""
        )  # fmt: skip
        assert await shown(*where) == "condition of the study: words alone, speech only, set by Anna"

        assert await said(await start("steer", "condition", "none", "--by", "Anna", *where)) == (
            0, "condition of the study, from now on: none", ""
        )  # fmt: skip
        assert await shown(*where) == "condition of the study: none, set by Anna"
    finally:
        await stopped(generation)


async def test_what_is_no_condition_is_refused_before_anything_is_asked() -> None:
    assert await said(await start("steer", "condition", "--speech-only")) == (
        2, "",
        "--speech-only: of which condition? (give its name, or `none`; without a name the present one is shown)",
    )  # fmt: skip
    code, out, error = await said(await start("steer", "condition", "x" * 81))
    assert (code, out) == (2, "")
    assert error == "xxxxxxxxxxxxxxxxxxxx...: 81 characters; a name has 80 at most"
