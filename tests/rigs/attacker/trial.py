"""A robot in processes, a manager who performs one fragment after the other, and an attacker beside it."""

import asyncio
import json
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.services.bus.certificates import initialize
from engage_hri.services.client.robot import Robot, connect
from tests.access.fortress import Told
from tests.bus.places import OWN_ADDRESS, free_endpoint
from tests.rigs.attacker.attacks import NOBODY

HOLDERS = {
    NOBODY: "somebody", "observer": "viewer", "manager": "mallory", "operator": "operator", "wizard": "wizard",
    "perception": "simulation", "generation": "generation", "realizer": "realizer", "recognition": "recognition",
    "control": "control",
}  # fmt: skip
"""A holder of each role."""
HUNG = 30.0
"""Seconds after which a fragment counts as lost."""


@dataclass
class Performed:
    """What became of the fragments of a manager. seconds: that each took."""

    seconds: list[float] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)

    @property
    def slowest(self) -> float:
        return max(self.seconds, default=0.0)


class Siege:
    """A router and all services as processes, with keys or without. Use as a context manager."""

    def __init__(self, folder: Path, *, has_keys: bool = True) -> None:
        self.ring = folder / "ring" if has_keys else None
        self.endpoint = free_endpoint()
        if self.ring is not None:
            self.endpoint = self.endpoint.replace("tcp/", "tls/")
            initialize(self.ring, "robot", [("manager", "alice"), ("manager", "mallory")], [OWN_ADDRESS], 2)
        self._log = folder / "log"
        self._number = 0

    def __enter__(self) -> "Siege":
        keys = ("--keys", self.ring) if self.ring else ()
        self.router = Told("router", "--listen", self.endpoint, *keys)
        self.router.expect("router is ready")
        environment = {"ENGAGE_BUS_CONNECT": self.endpoint, **({"ENGAGE_BUS_KEYS": str(self.ring)} if keys else {})}
        mode = {} if keys else {"ENGAGE_BUS_MODE": "client"}
        self.up = Told("up", "--log", self._log, **environment, **mode)
        self.up.expect("all services are up")
        return self

    def __exit__(self, *raised: object) -> None:
        for each in (self.up, self.router):
            each.end()

    def memory(self) -> float:
        """Memory of the router's processes, in MB."""
        return sum(map(_memory, self.family))

    @property
    def family(self) -> list[int]:
        """Processes of the router: the one that watches, then the one that routes."""
        return _family(self.router.process.pid)

    @property
    def environment(self) -> list[bytes]:
        """Variables of the process that routes."""
        return Path(f"/proc/{self.family[1]}/environ").read_bytes().split(b"\0")

    def told_of(self, role: str) -> list[str]:
        """Lines of the router so far about the holder of a role, or about one without a name."""
        self.router.drain()
        name = f"robot/{role}/{HOLDERS[role]}"
        words = ("refused a link", "loud: ", "somebody") if role == NOBODY else (name,)
        return [line for line in self.router.lines if any(word in line for word in words)]

    @property
    def restarts(self) -> int:
        """Number of times that the router was started anew."""
        self.router.drain()
        return sum("started anew" in line for line in self.router.lines)

    def manager(self) -> Robot:
        """A manager of ours, as a context manager."""
        if self.ring is None:
            return connect("robot", connect=[self.endpoint])
        return connect("robot", connect=[self.endpoint], keys=str(self.ring / "alice"))

    async def perform(self, robot: Robot, until: float, fragments: int = 10**9) -> Performed:
        """Perform fragments, one after the other. until: a time of `time.monotonic`."""
        done = Performed()
        while time.monotonic() < until and fragments > len(done.seconds) + len(done.lost):
            self._number += 1
            began = time.monotonic()
            speech = Speech(id="s", text="well")
            fragment = TurnFragment(id=f"f{self._number}", turn_status="full", behaviors=(speech,))
            try:
                async with asyncio.timeout(HUNG):
                    outcome = await robot.perform(fragment)
            except (EngageError, TimeoutError) as error:
                done.lost.append(f"{type(error).__name__}: {error}")
                continue
            if outcome.status == "done":
                done.seconds.append(time.monotonic() - began)
            else:
                done.lost.append(f"{outcome.status}: {outcome.fault}")
        return done

    async def attack(self, role: str, attack: str, seconds: float) -> asyncio.subprocess.Process:
        """Start an attacker."""
        return await asyncio.create_subprocess_exec(
            sys.executable, "-m", "tests.rigs.attacker.attacks", self.endpoint, str(self.ring or ""),
            f"{role}={HOLDERS[role]}", attack, str(seconds), stdout=asyncio.subprocess.PIPE,
        )  # fmt: skip


@dataclass
class Result:
    """An attack and what came of it. memory: the most of the router, in MB. told: lines that name the attacker.

    restarts: of the router.
    """

    role: str
    attack: str
    times: int
    refused: int
    performed: Performed
    memory: float
    told: list[str]
    restarts: int


async def attacked(siege: Siege, robot: Robot, role: str, attack: str, seconds: float) -> Result:
    """Perform while somebody attacks."""
    known, restarts = len(siege.told_of(role)), siege.restarts
    attacker = await siege.attack(role, attack, seconds)
    memory = 0.0

    async def watch() -> None:
        nonlocal memory
        while True:
            memory = max(memory, siege.memory())
            siege.router.drain()  # as the journal of a system would
            await asyncio.sleep(0.1)

    watching = asyncio.create_task(watch())
    performed = await siege.perform(robot, time.monotonic() + seconds)
    out, _ = await attacker.communicate()
    watching.cancel()
    count = json.loads(out or b'{"times": -1, "refused": 0}')
    told = siege.told_of(role)[known:]
    return Result(
        role, attack, **count, performed=performed, memory=memory, told=told, restarts=siege.restarts - restarts
    )


def _family(pid: int) -> list[int]:
    """A process and those that it has started."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [pid, *(each for child in children for each in _family(int(child)))]


def _memory(pid: int) -> float:
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1000
    return 0.0
