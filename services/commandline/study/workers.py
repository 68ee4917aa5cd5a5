"""Sessions in several child processes at once. The results do not depend on which child plays which session."""

import asyncio
import sys
from asyncio.subprocess import Process
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress

import msgspec

from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.shell.supervisor import ending, killed, spawned, without_threads
from engage_hri.services.commandline.study.session import Order, SessionResult
from engage_hri.services.study.records import SessionRecord

WORKER = (sys.executable, "-P", "-m", "engage_hri", "session")
PATIENCE: Seconds = 600.0
"""Real time that a session may take, as one in which virtual time stands still would never end."""
LONGEST_ANSWER = 2**26
"""Bytes: an hour of connection events is about 200 kB."""

Tell = Callable[[SessionResult], None]


async def play_all(orders: Iterable[Order], jobs: int, tell: Tell, worker: tuple[str, ...] = WORKER) -> None:
    """Play each order in one of `jobs` processes. tell: gets each result as it comes.

    A child that dies costs its session; another takes its place. When cancelled, all children are ended.
    """
    waiting = deque(orders)
    with without_threads():
        async with asyncio.TaskGroup() as group:
            for number in range(min(jobs, len(waiting))):
                group.create_task(_play_some(waiting, tell, worker), name=f"sessions {number}")


async def _play_some(waiting: deque[Order], tell: Tell, worker: tuple[str, ...]) -> None:
    while waiting:
        async with spawned(killed, *worker, limit=LONGEST_ANSWER) as child:
            lost = ""
            while waiting and not lost:
                order = waiting.popleft()
                try:
                    tell(await _ask(child, order))
                except _Lost as loss:
                    lost = str(loss)
                    record = SessionRecord(
                        session=order.session, condition=order.condition, seed=order.seed, finished=False, reason=lost
                    )
                    tell(SessionResult(record=record))


class _Lost(Exception):
    """The child has not answered, and never will."""


async def _ask(child: Process, order: Order) -> SessionResult:
    assert child.stdin is not None
    assert child.stdout is not None
    child.stdin.write(msgspec.json.encode(order) + b"\n")
    try:
        async with asyncio.timeout(PATIENCE):
            with suppress(ConnectionError):  # the child has died; reading will tell so
                await child.stdin.drain()
            line = await child.stdout.readline()
            if line.endswith(b"\n"):
                return msgspec.json.decode(line, type=SessionResult)
            raise _Lost(f"the process that played it ended with {ending(await child.wait())}")
    except TimeoutError:
        raise _Lost(f"no answer within {PATIENCE:g} s") from None
