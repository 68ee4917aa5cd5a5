"""Let processes stand still and cut their links, beside a flood, and see that each hears each other again.

So a link is full, more than one thread waits for it, and Zenoh forgets the one that comes after it
(docs/decisions/0136-a-link-that-zenoh-has-forgotten.md). Exit 1 if anybody stays deaf, or if numbers are left out,
doubled or come in another order. Needs Linux, root, and `ss`, which cuts links.
"""

import argparse
import json
import os
import random
import select
import signal
import subprocess
import sys
import time

from tests.access.fortress import Told
from tests.bus.places import free_endpoint

NAMES = "abcd"
QUIET = 20.0
"""Seconds after which all have to have heard all again."""
NEAR = 500
"""Numbers that may be on their way when it is looked: those of five seconds."""
FLOOD = """
import json, sys, time, zenoh
config = zenoh.Config()
for key, value in {"mode": "client", "connect/endpoints": [sys.argv[1]], "namespace": "robot"}.items():
    config.insert_json5(key, json.dumps(value))
session = zenoh.open(config)
while True:
    session.put("engage/v1/rpc/x/state", bytes(2000), congestion_control=zenoh.CongestionControl.DROP)
    time.sleep(0.0005)
"""


class Speaking(Told):
    module = "tests.rigs.deaf.speaker"


class Speaker:
    """One of the processes, and what it has told last."""

    def __init__(self, endpoint: str, name: str) -> None:
        self.process = Speaking(endpoint, name, ",".join(set(NAMES) - {name}))
        self.said, self.heard, self.wrong, self.refused, self.forgotten = 0, dict[str, int](), 0, 0, 0

    def look(self) -> None:
        self.process.drain()
        for line in self.process.lines:
            if "deaf: " in line:
                self.forgotten += 1
            if line.startswith("{"):
                told = json.loads(line)
                self.said, self.heard, self.wrong = told["said"], told["heard"], told["wrong"]
                self.refused = told["refused"]
        self.process.lines.clear()


def deaf(speakers: dict[str, Speaker]) -> list[str]:
    """Who does not hear whom."""
    for each in speakers.values():
        each.look()
    return [
        f"{name} hears nothing of {other}"
        for name, each in speakers.items()
        for other, number in each.heard.items()
        if number < speakers[other].said - NEAR
    ]


def disturb(speakers: dict[str, Speaker], port: str, chance: random.Random) -> None:
    """Halt one, or cut its link, or first the one and then the other."""
    pid = speakers[chance.choice(NAMES)].process.process.pid
    what = chance.random()
    if what < 0.6:
        os.kill(pid, signal.SIGSTOP)
        select.select([], [], [], chance.choice([0.1, 0.25, 0.3, 0.5, 0.8, 1.5]))
        os.kill(pid, signal.SIGCONT)
        select.select([], [], [], chance.random() * 0.1)
    if what > 0.15:
        listed = subprocess.run(
            ["ss", "-tnpH", f"dport = :{port}"], capture_output=True, text=True, check=True
        ).stdout
        for line in listed.splitlines():
            if f"pid={pid}," in line:
                own = line.split()[3].rpartition(":")[2]
                subprocess.run(["ss", "-K", f"sport = :{own}"], capture_output=True, check=True)
    select.select([], [], [], chance.choice([0.05, 0.1, 0.2, 0.5, 1.0]))


def trial(seconds: float, seed: int) -> int:
    chance, endpoint = random.Random(seed), free_endpoint()
    router = Told("router", "--listen", endpoint)
    router.expect("router is ready")
    speakers = {name: Speaker(endpoint, name) for name in NAMES}
    flood = subprocess.Popen([sys.executable, "-c", FLOOD, endpoint], stdin=subprocess.DEVNULL)
    end, disturbed, left = time.monotonic() + seconds, 0, list[str]()
    while time.monotonic() < end and not left:
        for _ in range(20):
            disturb(speakers, endpoint.rpartition(":")[2], chance)
            disturbed += 1
        until = time.monotonic() + QUIET
        while (left := deaf(speakers)) and time.monotonic() < until:
            select.select([], [], [], 0.5)
    flood.kill()
    wrong = sum(each.wrong for each in speakers.values())
    for each in (*(one.process for one in speakers.values()), router):
        each.end()
    told = sum("deaf: " in line for line in router.lines) + sum(each.forgotten for each in speakers.values())
    mixed = sum(each.refused for each in speakers.values())
    print(
        json.dumps(
            {"disturbed": disturbed, "forgotten": told, "under another key": mixed, "deaf": left, "wrong": wrong}
        )
    )
    return int(bool(left or wrong))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.rigs.deaf", description=__doc__)
    parser.add_argument("--seconds", type=float, default=300.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    sys.exit(trial(options.seconds, options.seed))
