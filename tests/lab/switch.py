"""Switch of the laboratory: a process that carries frames between the cards of machines, as late as it is told.

`python -m tests.lab.switch SOCKET SEED`. Machines hand their cards over at SOCKET (see inside.py). Orders come as
lines of JSON on standard input, each answered by a line on standard output.
"""

import asyncio
import json
import os
import socket
import sys
from typing import Any

from tests.lab.fabric import Counts, Fabric

LONGEST = 2048
"""Bytes of the longest frame."""
AT_ONCE = 64
"""Frames that are read from one card before others have their turn."""


class Switch:
    """Frames between cards. Machines are known by their numbers."""

    def __init__(self, seed: int) -> None:
        self._loop = asyncio.get_running_loop()
        self._fabric = Fabric(seed)
        self._cards: dict[int, int] = {}
        self._timer: asyncio.TimerHandle | None = None

    def plug(self, machine: int, card: int) -> None:
        """Join a machine to the network; one that was there with another card has started anew."""
        self.unplug(machine)
        self._cards[machine] = card
        self._fabric.machines.add(machine)
        self._loop.add_reader(card, self._read, machine, card)

    def unplug(self, machine: int) -> None:
        """Take a machine off the network."""
        if (card := self._cards.pop(machine, None)) is not None:
            self._loop.remove_reader(card)
            os.close(card)
        self._fabric.machines.discard(machine)

    def _read(self, machine: int, card: int) -> None:
        now = self._loop.time()
        for _ in range(AT_ONCE):
            try:
                frame = os.read(card, LONGEST)
            except BlockingIOError:
                break
            except OSError:  # the machine has ended
                self.unplug(machine)
                break
            self._fabric.take(machine, frame, now)
        self._deliver()

    def _deliver(self) -> None:
        for machine, frame in self._fabric.due(self._loop.time()):
            if (card := self._cards.get(machine)) is not None:
                try:
                    os.write(card, frame)
                except BlockingIOError:
                    pass  # its card is full, as cards are
                except OSError:
                    self.unplug(machine)
        if self._timer is not None:
            self._timer.cancel()
        after = self._fabric.next
        self._timer = None if after is None else self._loop.call_at(after, self._deliver)

    def order(self, words: dict[str, Any]) -> dict[str, Any]:
        """Carry out an order: `path` (since, to, and what changes), `counts`; `unplug`, `plugged` (machine)."""
        match words:
            case {"order": "path", "since": since, "to": to, **changes}:
                path = self._fabric.path(since, to)
                for name, value in changes.items():
                    if name != "order":
                        setattr(path, name, value)
            case {"order": "unplug", "machine": machine}:
                self.unplug(machine)
            case {"order": "plugged", "machine": machine}:
                return {"plugged": machine in self._cards}
            case {"order": "counts"}:
                counts = self._fabric.counts
                return {f"{since}-{to}": _told(each) for (since, to), each in counts.items()}
            case _:
                return {"error": f"unknown order {words}"}
        return {}


def _told(counts: Counts) -> dict[str, int]:
    return {"passed": counts.passed, "lost": counts.lost, "cut": counts.cut}


async def main() -> None:
    """Carry frames until standard input ends."""
    door, seed = sys.argv[1], int(sys.argv[2])
    loop = asyncio.get_running_loop()
    switch = Switch(seed)
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    listening.bind(door)
    listening.listen()
    listening.setblocking(False)

    machines: list[socket.socket] = []

    def come() -> None:
        machine, _ = listening.accept()
        machine.setblocking(True)
        number, cards, _, _ = socket.recv_fds(machine, 1, 1)
        switch.plug(number[0], cards[0])
        machines.append(machine)  # open for as long as the switch runs: machines end with it

    loop.add_reader(listening, come)
    orders = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(orders), sys.stdin)
    print("{}", flush=True)
    async for line in orders:
        print(json.dumps(switch.order(json.loads(line))), flush=True)


if __name__ == "__main__":
    asyncio.run(main())
