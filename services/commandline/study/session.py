"""Sessions of a study, played in several child processes at once. The results do not depend on which plays which.

A child reads orders from standard input and answers each on standard output, a line of JSON both ways: it needs no
bus, and ends with its parent.
"""

import asyncio
import sys
import traceback
from asyncio.subprocess import Process
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass

import msgspec
from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.embedding import play_tangram
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.shell.process import DONE
from engage_hri.services.commandline.shell.supervisor import ending, killed, spawned, without_threads
from engage_hri.services.runtime.virtual_time import run_virtual
from engage_hri.services.study.records import EventRecord, SessionRecord, SessionRecorder


class Order(Struct, frozen=True, kw_only=True):
    """Order to play one session.

    limit: time after which it is broken off, in virtual time.
    """

    session: int
    condition: str
    seed: int
    limit: Seconds
    config: Config


class SessionResult(Struct, frozen=True, kw_only=True):
    """Result of a session. trace: of the exception, if it failed by a bug of ours."""

    record: SessionRecord
    events: tuple[EventRecord, ...] = ()
    trace: str = ""


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command: none."""


def main(options: Options) -> int:
    """Play the orders on standard input, until it ends."""
    orders = msgspec.json.Decoder(Order)
    for line in sys.stdin.buffer:
        sys.stdout.buffer.write(msgspec.json.encode(play(orders.decode(line))) + b"\n")
        sys.stdout.buffer.flush()
    return DONE


def play(order: Order) -> SessionResult:
    """Play one session in virtual time. An error is in the result; nothing is raised."""
    recording = SessionRecorder(order.config.robot)
    reason = trace = ""
    try:
        run_virtual(_play(order, recording))
    except TimeoutError:
        reason = f"not over after {order.limit:g} s"
    except Exception as error:  # a bug of ours: this session tells of it, the others go on
        reason, trace = _reason(error), traceback.format_exc()
    record = recording.session(session=order.session, condition=order.condition, seed=order.seed, reason=reason)
    events = recording.events(session=order.session, condition=order.condition)
    return SessionResult(record=record, events=events, trace=trace)


async def _play(order: Order, recording: SessionRecorder) -> None:
    """Play the tangram. Raises TimeoutError at the limit."""
    async with asyncio.timeout(order.limit):
        await play_tangram(order.config, (recording,))


def _reason(error: BaseException) -> str:
    """First cause of an exception, on one line."""
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return " ".join(f"{type(error).__name__}: {error}".split())


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
