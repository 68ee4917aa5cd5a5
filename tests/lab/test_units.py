"""The units of docs/deploy run under systemd, as the first process of a machine of its own."""

import asyncio
import re
import shutil
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest

from engage_hri.services.bus.certificates import initialize
from tests.lab.lab import PATHS, _child_of, missing
from tests.lab.systemd import INIT
from tests.lab.test_deploy import FILES

LONG = 90.0
USER = 64001
"""Id of the user `engage` on that machine."""
TARGETS = {
    "sysinit": "", "basic": "", "shutdown": "", "network-online": "",
    "multi-user": "Wants=engage-router.service engage@control.service engage@realizer.service taken.service",
}  # fmt: skip
"""What there is of systemd's own units: nothing that does anything."""
QUICK = """
[Service]
# For the test: what is said goes to a file, and nobody waits.
RestartSec=100ms
StandardOutput=append:/run/lab/log/%n
StandardError=append:/run/lab/log/%n
"""


def why_not() -> str:
    return missing("cgroup") or ("" if INIT and shutil.which("systemctl") else "needs systemd")


class Booted:
    """A machine that systemd runs. folder: what of the host it sees as /run/lab."""

    def __init__(self, folder: Path, process: asyncio.subprocess.Process) -> None:
        self.folder = folder
        self._init = _child_of(process.pid)

    async def systemctl(self, *words: str) -> str:
        asking = await asyncio.create_subprocess_exec(
            "nsenter", "--target", str(self._init), "--mount", "--pid", "--net", "systemctl", *words,
            stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
        )  # fmt: skip
        return (await asking.communicate())[0].decode()

    async def shown(self, unit: str) -> dict[str, str]:
        told = await self.systemctl("show", unit, "-p", "NRestarts,ActiveState,SubState,Result,ExecMainStatus")
        return dict(line.split("=", 1) for line in told.splitlines())

    async def until(self, unit: str, holds: Callable[[dict[str, str], str], bool]) -> dict[str, str]:
        """Wait until something holds of what systemd shows of a unit and of what that has said."""
        loop = asyncio.get_running_loop()
        deadline = loop.time() + LONG
        while loop.time() < deadline:
            seen = await self.shown(unit)
            if holds(seen, self.said(unit)):
                return seen
            await asyncio.sleep(0.3)
        raise AssertionError(f"{unit}: {seen}\n{self.said(unit)[-2000:]}")

    def said(self, unit: str) -> str:
        log = self.folder / "log" / unit
        return log.read_text() if log.exists() else ""


@asynccontextmanager
async def booted(folder: Path) -> AsyncIterator[Booted]:
    """A machine with our units and keys.conf, and nothing in /etc/engage yet."""
    units = folder / "units"
    for name in ("units", "etc", "bin", "log"):
        (folder / name).mkdir(parents=True)
    for name, more in TARGETS.items():
        (units / f"{name}.target").write_text(f"[Unit]\nDescription={name}\nDefaultDependencies=no\n{more}\n")
    for name, keys in (("engage-router.service", "router-keys.conf"), ("engage@.service", "keys.conf")):
        shutil.copy(FILES / name, units)
        (units / f"{name}.d").mkdir()
        shutil.copy(FILES / keys, units / f"{name}.d" / "keys.conf")
        (units / f"{name}.d" / "quick.conf").write_text(QUICK)
    listens = f"{sys.executable} -m http.server --bind 127.0.0.1 7447"
    (units / "taken.service").write_text(f"[Service]\nExecStart={listens}\n")
    command = folder / "bin" / "engage"
    command.write_text(f'#!/bin/sh\nPYTHONPATH={PATHS["PYTHONPATH"]} exec {sys.executable} -m engage_hri "$@"\n')
    command.chmod(0o755)
    (folder / "passwd").write_text(f"engage:x:{USER}:{USER}::/:/usr/sbin/nologin\n")
    process = await asyncio.create_subprocess_exec(
        "unshare", "--fork", "--kill-child", "--mount-proc", "--pid", "--mount", "--uts", "--ipc", "--net",
        "--cgroup", sys.executable, "-m", "tests.lab.systemd", str(folder),
        stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.DEVNULL,
    )  # fmt: skip
    try:
        async with asyncio.timeout(LONG):
            while True:
                with suppress(ProcessLookupError):
                    machine = Booted(folder, process)
                    if "ActiveState=active" in await machine.systemctl("show", "multi-user.target"):
                        break
                await asyncio.sleep(0.2)
        yield machine
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()


def hand_out(ring: Path, etc: Path) -> None:
    """Put the keys where units look for them."""
    shutil.copytree(ring, etc / "keys")
    for path in (etc / "keys", *(etc / "keys").rglob("*")):
        shutil.chown(path, USER, USER)


def variables(name: str) -> str:
    """The file of variables, for a robot and a router on this machine."""
    text = (FILES / name).read_text()
    return re.sub(r"(?<=_ROBOT=).*", "robot", text).replace("10.77.0.1", "127.0.0.1")


@pytest.mark.real_time
@pytest.mark.skipif(bool(why_not()), reason=why_not())
async def test_units_that_failed_twenty_times_come_by_themselves_once_their_cause_is_gone(tmp_path: Path) -> None:
    """No variables, then no keys, then an endpoint that somebody else has; a misspelled word waits for a person."""
    control, router = "engage@control.service", "engage-router.service"
    initialize(tmp_path / "keys", "robot", [], ["127.0.0.1"], 2)
    async with booted(tmp_path / "machine") as machine:
        etc = machine.folder / "etc"
        unset = await machine.until(control, lambda seen, said: int(seen["NRestarts"]) >= 10)
        assert unset["Result"] == "resources"  # systemd's own: there is no file of variables

        (etc / "bus.env").write_text(variables("bus-keys.env"))
        for unit in (control, router):
            await machine.until(unit, lambda seen, said: said.count("no keys of") >= 20)

        hand_out(tmp_path / "keys", etc)
        await machine.until(router, lambda seen, said: said.count("Address already in use") >= 2)
        await machine.systemctl("stop", "taken.service")
        await machine.until(router, lambda seen, said: "router is ready" in said)
        for name in ("control", "realizer"):
            await machine.until(f"engage@{name}.service", lambda seen, said: " is ready" in said)

        await machine.systemctl("kill", "--signal=KILL", control)
        await machine.until(control, lambda seen, said: said.count("control is ready") == 2)

        await machine.systemctl("start", "engage@contorl.service")
        wrong = await machine.until("engage@contorl.service", lambda seen, said: seen["ActiveState"] == "failed")
        assert (wrong["NRestarts"], wrong["ExecMainStatus"]) == ("0", "2"), machine.said("engage@contorl.service")
