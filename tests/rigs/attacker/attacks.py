"""The attacks, as plain Zenoh: `python -m tests.rigs.attacker.attacks ENDPOINT KEYS ROLE=NAME ATTACK SECONDS`.

Each runs in a process of its own, until its time is over. To add one, write a function of an `Attacker` that does its
worst once, and put it into `ATTACKS`: it is called again and again.
"""

import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from secrets import token_hex
from typing import Any

import zenoh

from engage_hri.schemas import access, keys
from engage_hri.schemas.access import BESIDE, Holder, most
from engage_hri.services.bus.zenoh.router import MOST_TOKENS

COMMAND = [sys.executable, "-m", "tests.rigs.attacker.attacks"]
HUNDRED_MB = 100_000_000
NOBODY = "stranger"
"""Role of one without keys."""


class Attacker:
    """A session with the keys of a holder, or without, and all that this holder may do."""

    def __init__(self, endpoint: str, ring: Path | None, role: str, name: str) -> None:
        self._endpoint, self._ring = endpoint, ring
        self.role, self.name = role, name
        mark = Holder(robot="robot", role=role, name=name).mark
        self.run = f"{mark}{token_hex(12)}"
        self.session: Any = None
        self.turn = 0
        self.kept: list[Any] = []
        """What it has declared."""
        self.others: list[subprocess.Popen[bytes]] = []

    def open(self) -> None:
        """Connect, with the own keys if there are any; raises `zenoh.ZError` when it is not let in."""
        settings: dict[str, object] = {
            "mode": "client", "connect/endpoints": [self._endpoint], "connect/timeout_ms": 3000, "id": self.run,
            "connect/exit_on_failure": True, "scouting/multicast/enabled": False, "namespace": "robot",
        }  # fmt: skip
        if self._ring is not None:
            tls: dict[str, object] = {"root_ca_certificate": str(self._ring / "ca.pem")}
            if self.role != NOBODY:
                own = self._ring / self.name
                tls |= {
                    "enable_mtls": True, "connect_certificate": str(own / "certificate.pem"),
                    "connect_private_key": str(own / "private.pem"),
                }  # fmt: skip
            settings["transport/link/tls"] = tls
        config = zenoh.Config()
        for key, value in settings.items():
            config.insert_json5(key, json.dumps(value))
        self.session = zenoh.open(config)

    def may(self, does: access.Does) -> list[str]:
        """Keys of the rows of its role; a stranger takes those of a manager."""
        role = "manager" if self.role == NOBODY else self.role
        return [access.owned(key, self.name).replace("*", self.name) for key in access.rows(role, does)]

    @property
    def puts(self) -> list[str]:
        return [*self.may("publishes"), keys.own(self.run, "pulse/news")]

    @property
    def questions(self) -> list[str]:
        flows = {flow for key in self.may("publishes") for flow in keys.flows(key)}
        own = ("past", "clock", *(f"flush/{flow}" for flow in sorted(flows)))
        return [*self.may("asks"), *(keys.own("*", subject) for subject in own)]

    def next_of(self, them: list[str]) -> str:
        """One after the other of these, in each call."""
        self.turn += 1
        return them[self.turn % len(them)]

    def put(self, key: str, payload: bytes, **more: object) -> None:
        self.session.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK, **more)

    def ask(self, key: str, payload: bytes) -> None:
        self.session.get(
            key, zenoh.handlers.Callback(lambda reply: None, indirect=False), payload=payload, timeout=1.0,
            priority=zenoh.Priority.REAL_TIME,
        )  # fmt: skip


def one_byte_more(by: Attacker) -> None:
    """Messages and questions of one byte more than their key allows."""
    for key in by.puts:
        by.put(key, bytes(most(key) + BESIDE + 1))
    for key in by.questions:
        by.ask(key, bytes(most(key) + BESIDE + 1))
    select.select([], [], [], 0.2)


def huge(by: Attacker) -> None:
    """Messages of 100 MB."""
    by.put(by.next_of(by.puts), bytes(HUNDRED_MB))
    select.select([], [], [], 0.3)


def huge_questions(by: Attacker) -> None:
    """Questions of 100 MB."""
    by.ask(by.next_of(by.questions), bytes(HUNDRED_MB))
    select.select([], [], [], 0.3)


def as_large_as_allowed(by: Attacker) -> None:
    """Messages of all that a key allows, as fast as the link takes them."""
    key = by.next_of(by.puts)
    by.put(key, bytes(most(key)), encoding="application/msgpack")


def pulses(by: Attacker) -> None:
    """Small pulses, as fast as the link takes them."""
    by.put(keys.own(by.run, "pulse/news"), b"\x80")


def small_messages(by: Attacker) -> None:
    """Small messages that nobody can read, as fast as the link takes them."""
    by.put(by.next_of(by.puts), b"\xc1" * 100, encoding="application/msgpack")


def urgent_messages(by: Attacker) -> None:
    """Small messages that nobody can read, with the highest priority, as fast as the link takes them."""
    by.put(by.next_of(by.puts), b"\xc1" * 100, encoding="application/msgpack", priority=zenoh.Priority.REAL_TIME)


def questions(by: Attacker) -> None:
    """Small questions with the highest priority, as fast as the link takes them."""
    by.ask(by.next_of(by.questions), b"")


def encodings(by: Attacker) -> None:
    """Names of encodings, attachments and keys as long as Zenoh takes them."""
    key = by.next_of(by.puts)
    by.put(key, b"{}", encoding="application/json;" + "x" * 250)
    by.put(key, b"\x80", encoding="application/msgpack", attachment=bytes(most(key)))
    by.put(f"{key}/{'x' * 60_000}", b"")


def unread_links(by: Attacker) -> None:
    """Links that are never read, and what fills them."""
    if by.turn % 100 == 0 and by.turn < 1000:
        by.others.append(subprocess.Popen([*COMMAND, *sys.argv[1:4], "stand-still", "0"], stdin=subprocess.DEVNULL))
    key = by.next_of(by.may("publishes"))
    by.put(key, b"\xc1" * min(60_000, most(key)), encoding="application/msgpack")
    select.select([], [], [], 0.002)


def stand_still(by: Attacker) -> None:
    """Subscribe to all that there is for this role, and halt."""
    nothing = zenoh.handlers.Callback(lambda sample: None, indirect=False)
    for key in by.may("subscribes"):
        by.kept.append(by.session.declare_subscriber(key, nothing))
    select.select([], [], [], 0.1)
    os.kill(os.getpid(), signal.SIGSTOP)


def ghosts(by: Attacker) -> None:
    """Tokens of processes that do not exist, almost as many as one may have; each says that it has a past."""
    mark = by.run[: -len(token_hex(12))]
    for number in range(MOST_TOKENS - 10 - len(by.kept)):
        key = keys.own(f"{mark}{number:024x}", "log/news")
        by.kept.append(by.session.liveliness().declare_token(key))
    select.select([], [], [], 0.2)


ATTACKS: Mapping[str, Callable[[Attacker], None]] = {
    each.__name__.replace("_", "-"): each
    for each in (
        one_byte_more, huge, huge_questions, as_large_as_allowed, pulses, small_messages, urgent_messages, questions,
        encodings, unread_links, ghosts,
    )
}  # fmt: skip


def main(endpoint: str, ring: str, holder: str, attack: str, seconds: str) -> None:
    """Attack until the time is over. Prints how often, and how often the link was refused or lost."""
    role, _, name = holder.partition("=")
    by = Attacker(endpoint, Path(ring) if ring else None, role, name)
    os.nice(15)  # it stands for one on another machine, and takes no processor of the robot
    if attack == "stand-still":
        with suppress(zenoh.ZError):
            by.open()
            stand_still(by)
        return
    end, times, refused = time.monotonic() + float(seconds), 0, 0
    while time.monotonic() < end:
        try:
            if by.session is None:
                by.open()
            ATTACKS[attack](by)
            times += 1
        except zenoh.ZError:
            refused += 1
            by.session = None
            select.select([], [], [], 0.3)
    for other in by.others:
        other.kill()
    print(json.dumps({"times": times, "refused": refused}), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
