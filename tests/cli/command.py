"""Run `engage` as people do: in this process where that is enough, else as a process of its own."""

import asyncio
import os
import re
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from engage_hri.services.bus.certificates import initialize
from engage_hri.services.commandline.app import main
from engage_hri.services.commandline.shell import logs
from tests.bus.places import OWN_ADDRESS, free_endpoint

GOOD_BLOCK = """\
<bml id="hello">
  <gaze id="look" target="rectangle"/>
  <speech id="words" start="look:stroke"><text>A rectangle.</text></speech>
</bml>
"""
FRAGMENT = """\
<ebml:ebml xmlns:ebml="edu.wpi.ebml" xmlns="org.mindmakers.bml" id="ask" turnIndex="1" turnStatus="full">
  <speech id="please"><text>Please move</text></speech>
  <ebml:reference id="piece" target="blue-square" minimumReliability="0.95">
    <ebml:speechOption text="the blue piece" cost="3"/>
  </ebml:reference>
</ebml:ebml>
"""


ALONE = re.sub(r"  <speech.*", "", FRAGMENT)
"""The fragment without words but those of its reference: nothing of it is left if the object is unknown."""


class Result(NamedTuple):
    code: int
    out: str
    err: str


Engage = Callable[..., Result]


def engage(capsys: pytest.CaptureFixture[str]) -> Engage:
    """Runs one command line in this process."""

    def run(*arguments: object) -> Result:
        with pytest.raises(SystemExit) as exit:
            main([str(argument) for argument in arguments])
        logs.configure()  # a file that it has logged to is closed
        captured = capsys.readouterr()
        return Result(int(exit.value.code or 0), captured.out, captured.err)

    return run


async def start(*arguments: object, stdout: int = PIPE, **settings: str) -> Process:
    """A process of its own, with its log on stderr. settings: environment variables."""
    return await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "engage_hri", *map(str, arguments)),
        stdin=PIPE, stdout=stdout, stderr=PIPE, env={**os.environ, **settings},
    )  # fmt: skip


def threads(pid: int) -> list[str]:
    """The names of all threads of a process but its first; Zenoh names its own, Python's carry the program's name."""
    tasks = Path(f"/proc/{pid}/task")
    return [(task / "comm").read_text().strip() for task in tasks.iterdir() if task.name != str(pid)]


async def closed(folder: Path) -> tuple[Process, tuple[object, ...], tuple[object, ...]]:
    """Start a router with keys for the robot `closed`. Returns it, and the options of services and of alice."""
    ring, endpoint = folder / "ring", free_endpoint().replace("tcp/", "tls/")
    initialize(ring, "closed", [("manager", "alice")], [OWN_ADDRESS], 2)
    where = ("--robot", "closed", "--connect", endpoint, "--keys")
    return await start("router", "--listen", endpoint, "--keys", ring), (*where, ring), (*where, ring / "alice")
