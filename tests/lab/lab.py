"""The laboratory, as tests use it: machines that run commands, paths between them that can be cut, and faults."""

import asyncio
import json
import os
import shutil
import signal
import sys
import uuid
from collections.abc import AsyncIterator, Iterable, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from itertools import permutations
from pathlib import Path
from typing import Any

from tests.lab.inside import ip_of

PATIENCE = 20.0
"""Seconds within which a machine must have started, or an order must be carried out."""
TOOLS = ("unshare", "nsenter", "mount")
Process = asyncio.subprocess.Process


def missing(*spaces: str) -> str:
    """Why there can be no laboratory on this machine; empty if there can. spaces: further namespaces it needs."""
    if not sys.platform.startswith("linux"):
        return "the laboratory needs Linux"
    if os.geteuid() != 0:
        return "the laboratory needs root, to make network namespaces"
    if lacking := [tool for tool in TOOLS if shutil.which(tool) is None]:
        return f"the laboratory needs {', '.join(lacking)}"
    if not Path("/dev/net/tun").exists():
        return "the laboratory needs /dev/net/tun"
    if lacking := [space for space in spaces if not Path(f"/proc/self/ns/{space}").exists()]:
        return f"the laboratory needs namespaces for {', '.join(lacking)}"
    return ""


_ROOT = str(Path(__file__).parents[2])
PATHS = {"PYTHONPATH": os.pathsep.join(filter(None, (_ROOT, os.environ.get("PYTHONPATH"))))}
"""Where programs on a machine find the tests' own modules: they begin in the root folder."""


class Machine:
    """One machine: processes, a network and a boot of its own. It shares the files of the host.

    number, ip: on the laboratory's network.
    """

    def __init__(self, number: int, lab: "Lab") -> None:
        self.number = number
        self.ip = ip_of(number)
        self.ahead = 0
        """Seconds by which its monotonic clock is ahead of the host's, from its next boot on."""
        self.processes: list[Process] = []
        self._lab = lab
        self._first: Process | None = None
        self._init = 0
        """Id of the machine's first process, as the host sees it."""

    async def boot(self) -> None:
        """Start the machine, with nothing running on it."""
        boot_id = self._lab.folder / f"boot-{self.number}"
        boot_id.write_text(f"{uuid.UUID(int=self._lab.boots.pop() << 96)}\n")
        self._first = await asyncio.create_subprocess_exec(
            "unshare", "--net", "--mount", "--uts", "--pid", "--fork", "--kill-child", "--mount-proc",
            *(("--time", "--monotonic", str(self.ahead)) if self.ahead else ()),
            sys.executable, "-m", "tests.lab.inside", str(self._lab.door), str(self.number), str(boot_id),
            stdin=asyncio.subprocess.DEVNULL,
        )  # fmt: skip
        await self._lab.until_plugged(self)
        self._init = _child_of(self._first.pid)

    async def crash(self) -> None:
        """End everything on the machine at once, as when its power fails."""
        assert self._first is not None
        await self._lab.order(order="unplug", machine=self.number)
        self._first.kill()
        await self._first.wait()
        for process in self.processes:
            self._go_on(process)
            await process.wait()
        self.processes.clear()

    async def spawn(self, *command: str, env: Mapping[str, str] | None = None, **files: Any) -> Process:
        """Run a command on the machine, in a session of its own. files: as `create_subprocess_exec` takes them."""
        inside = ("nsenter", "--target", str(self._init), "--net", "--mount", "--uts", "--pid")
        inside += ("--time",) if self.ahead else ()
        process = await asyncio.create_subprocess_exec(
            *inside, *command, env=os.environ | PATHS | {"LAB_AHEAD": str(self.ahead)} | dict(env or {}),
            start_new_session=True, **files
        )  # fmt: skip
        self.processes.append(process)
        return process

    async def kill(
        self, process: Process, number: signal.Signals = signal.SIGKILL, *, its_child: bool = False
    ) -> None:
        """Send a signal to a process of this machine; if it is to be killed, wait until it is.

        its_child: send it to the one child of that process instead, which it watches over.
        """
        meant = _child_of(process.pid)  # the process itself only stands for it on the host
        if its_child:
            os.kill(_child_of(meant), number)
            return
        os.kill(meant, number)
        if number in (signal.SIGKILL, signal.SIGCONT):
            self._go_on(process)
        if number == signal.SIGKILL:
            await process.wait()

    def _go_on(self, process: Process) -> None:
        """Let what stands for a process on the host go on: it stops with that, and nobody else wakes it."""
        if process.returncode is None:
            process.send_signal(signal.SIGCONT)

    async def stop(self) -> None:
        """End everything on the machine, and the machine."""
        if self._first is not None and self._first.returncode is None:
            await self.crash()


class Lab:
    """Machines on one switch."""

    def __init__(self, folder: Path, switch: Process, machines: Sequence[int]) -> None:
        self.folder = folder
        self.door = folder / "door"
        self.boots = list(range(1, 10_000))[::-1]
        self.machines = {number: Machine(number, self) for number in machines}
        self._switch = switch
        self._turn = asyncio.Lock()

    async def order(self, **words: object) -> dict[str, Any]:
        """Give the switch an order (see `Switch.order`); returns its answer."""
        assert self._switch.stdin is not None
        assert self._switch.stdout is not None
        async with self._turn:
            self._switch.stdin.write(json.dumps(words).encode() + b"\n")
            answer: dict[str, Any] = json.loads(await asyncio.wait_for(self._switch.stdout.readline(), PATIENCE))
        if "error" in answer:
            raise ValueError(answer["error"])
        return answer

    async def path(self, *ends: int, **changes: float | bool) -> None:
        """Change the paths between these machines, in both directions: delay, jitter, loss, is_cut."""
        for since, to in permutations(ends, 2):
            await self.order(order="path", since=since, to=to, **changes)

    async def network(self, **changes: float | bool) -> None:
        """Change all paths."""
        await self.path(*self.machines, **changes)

    async def cut(self, one: int, other: int) -> None:
        """Let nothing pass between two machines."""
        await self.path(one, other, is_cut=True)

    async def heal(self, one: int, other: int) -> None:
        """Let frames pass again between two machines."""
        await self.path(one, other, is_cut=False)

    async def isolate(self, machine: int, *, is_cut: bool = True) -> None:
        """Cut a machine off from all others, or join it to them again."""
        for other in self.machines.keys() - {machine}:
            await self.path(machine, other, is_cut=is_cut)

    async def cut_for(self, seconds: float, machine: int, *others: int) -> None:
        """Cut a machine off from these others, none: from all, and join it to them again after so many seconds."""
        ends = others or tuple(self.machines.keys() - {machine})
        for is_cut in (True, False):
            for other in ends:
                await self.path(machine, other, is_cut=is_cut)
            if is_cut:
                await asyncio.sleep(seconds)

    async def until_plugged(self, machine: Machine) -> None:
        """Wait until the switch has the card of a machine that is starting."""
        deadline = asyncio.get_running_loop().time() + PATIENCE
        while not (await self.order(order="plugged", machine=machine.number))["plugged"]:
            if asyncio.get_running_loop().time() > deadline:
                raise TimeoutError(f"machine {machine.number} has not started in {PATIENCE:g} s")
            await asyncio.sleep(0.02)


@asynccontextmanager
async def laboratory(
    folder: Path, machines: Iterable[int] = (1, 2, 3), seed: int = 0, ahead: Mapping[int, int] = {}
) -> AsyncIterator[Lab]:
    """Machines of these numbers (1 to 254) on one network, started; all ends with the `async with`.

    ahead: seconds by which the clocks of machines are ahead of the host's.
    """
    pipe = asyncio.subprocess.PIPE
    door = folder / "door"
    switch = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "tests.lab.switch", str(door), str(seed), stdin=pipe, stdout=pipe
    )
    lab = Lab(folder, switch, tuple(machines))
    try:
        assert switch.stdout is not None
        await asyncio.wait_for(switch.stdout.readline(), PATIENCE)
        for number, seconds in ahead.items():
            lab.machines[number].ahead = seconds
        await asyncio.gather(*(machine.boot() for machine in lab.machines.values()))
        yield lab
    finally:
        await asyncio.gather(*(machine.stop() for machine in lab.machines.values()))
        with suppress(ProcessLookupError):
            switch.send_signal(signal.SIGKILL)
        await switch.wait()


def _child_of(process: int) -> int:
    """Id of the one child of a process."""
    for each in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            if int(each.read_text().rpartition(")")[2].split()[1]) == process:
                return int(each.parent.name)
    raise ProcessLookupError(f"{process} has no child")
