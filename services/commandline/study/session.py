"""Sessions of a study, and the child process that plays them on order.

The child reads orders from standard input and answers each on standard output, a line of JSON both ways: it needs no
bus, and ends with its parent.
"""

import asyncio
import sys
import traceback
from dataclasses import dataclass

import msgspec
from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.embedding import play_tangram
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.shell.process import DONE
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
