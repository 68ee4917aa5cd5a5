"""Which events `play` waits for after the last outcome, and for how long."""

import asyncio

import pytest

from engage_hri.schemas.behaviors import Event, EventKind
from engage_hri.schemas.blocks import Block, SyncPointProgress
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.recognition import ConnectionEvent, EventState
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.commandline.talk.played import GRACE, Played


def event(state: EventState, kind: EventKind = "adjacency_pair", *, block: str = "ask") -> ConnectionEvent:
    at = Stamp("loop", 0.0)
    return ConnectionEvent(
        id="e-1", kind=kind, initiator="robot", responder="human", state=state, at=at, started=at, limit=1.5,
        block=block, behavior="pair",
    )  # fmt: skip


def asking(status: str = "full") -> Played:
    return Played([TurnFragment(id="ask", turn_status=status)])  # type: ignore[arg-type]


async def settling(played: Played) -> Seconds:
    began = asyncio.get_running_loop().time()
    await played.settle()
    return asyncio.get_running_loop().time() - began


async def test_with_nothing_open_it_is_over_at_once() -> None:
    played = asking()
    played(event("started"), 0.0)
    played(event("failed"), 0.0)

    assert await settling(played) == 0.0


async def test_an_event_is_awaited_until_its_end_not_its_decision() -> None:
    played = asking()
    played(event("started"), 0.0)
    loop = asyncio.get_running_loop()
    loop.call_later(0.5, played, event("succeeded"), 0.5)
    loop.call_later(1.25, played, event("completed"), 1.25)

    assert await settling(played) == pytest.approx(1.25)


async def test_an_event_that_does_not_end_is_awaited_for_its_limit() -> None:
    played = asking()
    played(event("started", "mutual_facial_gaze"), 0.0)
    played(event("succeeded", "mutual_facial_gaze"), 0.0)

    assert await settling(played) == pytest.approx(1.5 + GRACE)


@pytest.mark.parametrize("status", ["beginning", "middle"])
async def test_the_pair_of_a_turn_that_goes_on_is_not_awaited(status: str) -> None:
    played = asking(status)
    played(event("started"), 0.0)

    assert await settling(played) == 0.0


async def test_the_start_of_a_blocks_event_may_come_after_the_block() -> None:
    played = Played([Block(id="b", behaviors=(Event(id="pair", kind="adjacency_pair", responder="human"),))])
    played(SyncPointProgress(block="b", behavior="pair", sync="start", at=Stamp("loop", 0.0), time=0.0), 0.0)
    loop = asyncio.get_running_loop()
    loop.call_later(0.25, played, event("started", block="b"), 0.25)
    loop.call_later(1.75, played, event("failed", block="b"), 1.75)

    assert await settling(played) == pytest.approx(1.75)


async def test_a_blocks_event_that_nobody_recognizes_is_awaited_for_the_grace_alone() -> None:
    played = Played([Block(id="b", behaviors=(Event(id="pair", kind="adjacency_pair", responder="human"),))])
    played(SyncPointProgress(block="b", behavior="pair", sync="start", at=Stamp("loop", 0.0), time=0.0), 0.0)

    assert await settling(played) == pytest.approx(GRACE)


async def test_the_events_of_others_concern_nobody_here() -> None:
    played = asking()
    played(event("started", block="another"), 0.0)

    assert not played.concerns(event("started", block="another"))
    assert await settling(played) == 0.0
