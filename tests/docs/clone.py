"""A clone as a newcomer has it after `make demo`, but with an endpoint of its own, and commands that run in it."""

import asyncio
import os
import shutil
import signal
import sys
from asyncio.subprocess import DEVNULL, PIPE, Process
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
RENDEZVOUS = "tcp/127.0.0.1:7447"
"""Where all that runs on this machine would meet, other runs of these tests too."""
HOLDS = ("engage_hri", "schemas", "services", "examples", "docs", "Makefile", "pyproject.toml", "constraints.txt")
PATIENCE = 120.0
"""Seconds. A limit of failure, never waited for."""


class Ended(NamedTuple):
    code: int
    out: str
    err: str


class Clone:
    """endpoint: stands wherever the repository, or what runs in the clone, has that of this machine."""

    def __init__(self, place: Path, endpoint: str) -> None:
        self._place = place
        self._endpoint = endpoint
        self._copy = place / "copy"
        self._copy.mkdir(parents=True)
        for name in HOLDS:
            if (ROOT / name).is_dir():
                shutil.copytree(ROOT / name, self._copy / name, symlinks=True)
            else:
                shutil.copy2(ROOT / name, self._copy / name)
        for path in self._copy.rglob("*.py"):
            if RENDEZVOUS in (text := path.read_text(encoding="utf-8")):
                path.write_text(self.placed(text), encoding="utf-8")
        self._programs()

    def _programs(self) -> None:
        programs = self._copy / ".venv" / "bin"
        programs.mkdir(parents=True)
        python = f'PYTHONPATH="{self._copy}" exec "{sys.executable}"'
        for name, call in {"python": f'{python} "$@"', "engage": f'{python} -m engage_hri "$@"'}.items():
            (programs / name).write_text(f"#!/bin/sh\n{call}\n")
            (programs / name).chmod(0o755)
        for stamp in (".demo", ".ready"):
            (programs.parent / stamp).touch()  # make has nothing to do

    def placed(self, text: str) -> str:
        return text.replace(RENDEZVOUS, self._endpoint)

    def folder(self, name: str) -> Path:
        """The clone as the root of one page's commands, apart from the files of others."""
        folder = self._place / name
        folder.mkdir()
        for each in self._copy.iterdir():
            (folder / each.name).symlink_to(each)
        return folder


async def start(command: str, folder: Path) -> Process:
    """A line of a shell, in a session of its own."""
    settings = {
        "PATH": f"{folder / '.venv' / 'bin'}{os.pathsep}{os.environ['PATH']}",
        "PYTHONUNBUFFERED": "1",
        "PIP_DRY_RUN": "1",  # the python is that of the tests: a page that installs would break what they stand on
        "PYTHONDONTWRITEBYTECODE": "",  # every process would compile the copy anew
    }
    return await asyncio.create_subprocess_exec(
        *("bash", "-euo", "pipefail", "-c", command), cwd=folder, env={**os.environ, **settings},
        stdin=DEVNULL, stdout=PIPE, stderr=PIPE, start_new_session=True, limit=2**20,
    )  # fmt: skip


async def finish(process: Process) -> Ended:
    async with asyncio.timeout(PATIENCE):
        out, err = await process.communicate()
    assert process.returncode is not None
    return Ended(process.returncode, out.decode(), err.decode())


async def run(command: str, folder: Path) -> Ended:
    process = await start(command, folder)
    try:
        return await finish(process)
    finally:
        tell(process, signal.SIGKILL)


async def run_until_it_prints(command: str, folder: Path) -> Ended:
    """Then Ctrl-C. out: the first line; empty if it ended without any."""
    process = await start(command, folder)
    try:
        assert process.stdout is not None
        async with asyncio.timeout(PATIENCE):
            first = await process.stdout.readline()
        tell(process, signal.SIGINT)
        ended = await finish(process)
        return ended._replace(out=first.decode() + ended.out)
    finally:
        tell(process, signal.SIGKILL)


def tell(process: Process, what: signal.Signals) -> None:
    if process.returncode is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, what)
