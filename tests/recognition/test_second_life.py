"""Recognition that is killed and started again goes on with what its former life has kept in a file."""

import asyncio
import random
from pathlib import Path

import pytest
from msgspec.structs import astuple

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import EVENT_KINDS, Cause, Event, TurnSignal
from engage_hri.schemas.perception import ActionBegan, ActionEnded, Utterance
from engage_hri.schemas.recognition import (
    ConnectionEvent,
    EventState,
    Interjection,
    KindStatistics,
    RequestEvent,
    SignalTurn,
    Statistics,
    WindowStatistics,
)
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import connect
from engage_hri.services.recognition.service import FormerLife
from engage_hri.services.recognition.statistics.tally import EventTally
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.service import running
from tests.random_cases import share_of
from tests.recognition.observations import HUMAN, ROBOT, world
from tests.recognition.test_service import recognition


async def ask(bus: Bus, requests: Requester, number: int) -> None:
    """Have the robot ask the person something, and end its turn."""
    turn, at = f"turn-{number}", bus.stamp()
    asked = Event(id="ask", kind="adjacency_pair", responder=HUMAN, turn=turn)
    ended = TurnSignal(id="end", turn=turn, signal="ended", actor=HUMAN)
    request = RequestEvent(id=f"ask-{number}", requester=bus.name, block=f"block-{number}", at=at, event=asked)
    await requests.send(keys.EVENT, request).accepted
    await asyncio.sleep(0.5)
    signal = SignalTurn(id=f"end-{number}", requester=bus.name, signal=ended, at=bus.stamp())
    await requests.send(keys.TURN, signal).outcome


async def answer(bus: Bus) -> None:
    for kind in (ActionBegan, ActionEnded):
        bus.publish(keys.PERCEIVED_ACTION, kind(actor=HUMAN, action="speak", at=bus.stamp()))
        await asyncio.sleep(1.0)


async def last(bus: Bus, actor: str) -> Statistics:
    with bus.subscribe(keys.statistics(actor)) as inbox:
        await asyncio.sleep(2.0)
        *_, received = [await inbox.next() for _ in range(len(inbox))]
    assert received is not None
    assert isinstance(received.message, Statistics)
    return received.message


def pairs(statistics: Statistics) -> tuple[int, int, int]:
    """How many pairs there were, how many of them succeeded, and how many failed."""
    return next(
        (each.count, each.succeeded, each.failed)
        for each in statistics.session.kinds
        if each.kind == "adjacency_pair"
    )


@pytest.mark.parametrize("actor", [HUMAN, "all"])
async def test_counts_go_on_and_a_question_is_answered_once(hub: MemoryHub, tmp_path: Path, actor: str) -> None:
    memory, bus = str(tmp_path / "recognition.json"), hub.join("realizer")
    told: list[ConnectionEvent] = []
    async with Requester(bus) as requests, connect(hub=hub) as robot:
        with robot.connection_events() as events:
            async with running(hub, recognition(memory=memory)):
                bus.publish(keys.WORLD, world())
                await ask(bus, requests, 1)
                await answer(bus)
                before = await last(bus, actor)
                await ask(bus, requests, 2)
                hub.kill("recognition")
            await asyncio.sleep(0.5)
            async with running(hub, recognition(memory=memory)):
                reborn = await last(bus, actor)
                await answer(bus)
                after = await last(bus, actor)
            while (event := await events.next(0.5)) is not None:
                told.append(event)

    old, new = told[-5].id, told[-1].id
    assert [(event.id, event.state, event.retold) for event in told[-5:]] == [
        (old, "started", False), (old, "lost", False),
        (new, "started", True), (new, "succeeded", False), (new, "completed", False),
    ]  # fmt: skip
    assert (told[-1].response, told[-1].delay, told[-1].started) == ("speak", None, told[-5].started)
    assert [pairs(one) for one in (before, reborn, after)] == [(1, 1, 0), (2, 1, 0), (2, 2, 0)]
    assert before.level == reborn.level == "engaged"


async def test_a_question_that_nobody_answers_fails_in_the_next_life(hub: MemoryHub, tmp_path: Path) -> None:
    memory, bus = str(tmp_path / "recognition.json"), hub.join("realizer")
    async with Requester(bus) as requests:
        async with running(hub, recognition(memory=memory)):
            bus.publish(keys.WORLD, world())
            await ask(bus, requests, 1)
        async with running(hub, recognition(memory=memory)):
            await asyncio.sleep(5.0)
            after = await last(bus, HUMAN)

    assert pairs(after) == (1, 0, 1)


async def test_what_the_bus_remembers_is_not_counted_again(hub: MemoryHub, tmp_path: Path) -> None:
    """The history of 2 s has the answer, which by itself would be a question of the person."""
    memory, bus = str(tmp_path / "recognition.json"), hub.join("realizer")
    async with Requester(bus) as requests:
        async with running(hub, recognition(memory=memory)):
            bus.publish(keys.WORLD, world())
            await ask(bus, requests, 1)
            await answer(bus)
        async with running(hub, recognition(memory=memory)):
            after = await last(bus, HUMAN)

    assert pairs(after) == (1, 1, 0)


async def test_words_that_the_bus_remembers_are_no_second_question(hub: MemoryHub, tmp_path: Path) -> None:
    """Nothing but the words told of it: somebody typed a line, which the robot answered before it was killed."""
    memory, bus = str(tmp_path / "recognition.json"), hub.join("perception")
    body = hub.join("control")
    async with running(hub, recognition(memory=memory)):
        bus.publish(keys.WORLD, world())
        at = bus.stamp()
        bus.publish(keys.UTTERANCE, Utterance(actor=HUMAN, id="line", text="which one?", began=at, ended=at, at=at))
        await asyncio.sleep(0.2)
        for kind in (ActionBegan, ActionEnded):
            body.publish(keys.ROBOT_ACTION, kind(actor=ROBOT, action="speak", at=body.stamp(), behavior="b:s"))
            await asyncio.sleep(0.5)
        hub.kill("recognition")
    async with running(hub, recognition(memory=memory)):
        after = await last(bus, HUMAN)

    assert pairs(after) == (1, 1, 0)


@pytest.mark.parametrize("words_after", [0.2, 1.0])
async def test_what_is_said_into_the_robots_words_is_told_once(
    hub: MemoryHub, tmp_path: Path, words_after: float
) -> None:
    """Recognition is killed 0.6 s after the person has begun. The words come before that, or in the next life.

    The bus remembers all of it.
    """
    memory, bus, body = str(tmp_path / "recognition.json"), hub.join("perception"), hub.join("control")

    async def says(words: str) -> None:
        began = bus.stamp()
        bus.publish(keys.PERCEIVED_ACTION, ActionBegan(actor=HUMAN, action="speak", at=began))
        await asyncio.sleep(words_after)
        ended = bus.stamp()
        bus.publish(keys.PERCEIVED_ACTION, ActionEnded(actor=HUMAN, action="speak", at=ended))
        heard = Utterance(actor=HUMAN, id=str(began.seconds), text=words, began=began, ended=ended, at=ended)
        bus.publish(keys.UTTERANCE, heard)

    with bus.subscribe(keys.ANY_INTERJECTION) as told:
        async with running(hub, recognition(memory=memory)):
            bus.publish(keys.WORLD, world())
            await says("good morning")
            await asyncio.sleep(0.5)
            robots = ActionBegan(actor=ROBOT, action="speak", at=body.stamp(), behavior="b:s")
            body.publish(keys.ROBOT_ACTION, robots)
            await asyncio.sleep(0.2)
            saying = asyncio.create_task(says("uh-huh"))
            await asyncio.sleep(0.6)
            hub.kill("recognition")
        async with running(hub, recognition(memory=memory)):
            await saying
            await asyncio.sleep(3.0)
        received = [await told.next() for _ in range(len(told))]

    messages = [each.message for each in received if each is not None]
    readings = [(each.reading, each.words) for each in messages if isinstance(each, Interjection)]
    assert readings == [("open", ""), ("backchannel", "uh-huh")]


async def test_without_a_file_all_begins_anew(hub: MemoryHub) -> None:
    bus = hub.join("realizer")
    async with Requester(bus) as requests:
        async with running(hub, recognition()):
            bus.publish(keys.WORLD, world())
            await ask(bus, requests, 1)
            await answer(bus)
        await asyncio.sleep(keys.HISTORY_MAX_AGE)
        async with running(hub, recognition()):
            after = await last(bus, "all")

    assert pairs(after) == (0, 0, 0)


@pytest.mark.parametrize("kept", [b"{", b'{"type":"world","entities":[]}'])
async def test_a_file_that_cannot_be_read_is_told_and_stops_nothing(
    hub: MemoryHub, tmp_path: Path, kept: bytes
) -> None:
    path, bus = tmp_path / "recognition.json", hub.join("realizer")
    path.write_bytes(kept)
    with bus.subscribe(keys.fault("recognition")) as faults:
        async with running(hub, recognition(memory=str(path))):
            after = await last(bus, "all")
            told = await faults.next()

    assert pairs(after) == (0, 0, 0)
    assert told is not None


@pytest.mark.parametrize(("clock", "seconds"), [("another boot", 1.0), ("loop", 2000.0), ("loop", -700.0)])
async def test_a_life_of_another_boot_or_of_long_ago_is_not_gone_on_with(
    hub: MemoryHub, tmp_path: Path, clock: str, seconds: float
) -> None:
    path, bus = tmp_path / "recognition.json", hub.join("realizer")
    counted = WindowStatistics(kinds=(KindStatistics(kind="adjacency_pair", count=3),), events=3)
    former = Statistics(actor="", at=Stamp(clock, seconds), session=counted, recent=WindowStatistics())
    FormerLife(str(path)).keep(keys.statistics("all"), former)
    async with running(hub, recognition(memory=str(path))):
        assert pairs(await last(bus, "all")) == (0, 0, 0)


def test_who_is_forgotten_is_kept_no_longer(tmp_path: Path) -> None:
    path = tmp_path / "recognition.json"
    life = FormerLife(str(path))
    for actor in ("ann", "bob"):
        nothing = WindowStatistics()
        life.keep(
            keys.statistics(actor), Statistics(actor=actor, at=Stamp("loop", 1.0), session=nothing, recent=nothing)
        )
    life.forget((keys.open_events("ann"), keys.statistics("ann")))

    assert [state.actor for state in FormerLife(str(path)).recall()] == ["bob"]


@pytest.mark.parametrize("seed", range(share_of(20)))
def test_numbers_of_a_life_that_was_broken_off_are_those_of_one(seed: int) -> None:
    """But for the number of starts without maintenance, if maintenance caused the first of all."""
    chance = random.Random(seed)
    one, other = EventTally(30.0), EventTally(30.0)
    at = 0.0
    for number in range(60):
        at += chance.expovariate(0.3)
        cause: Cause = chance.choice(("human", "maintenance")) if number else "human"
        kind = chance.choice(tuple(EVENT_KINDS))
        states: tuple[EventState, ...] = ("started", chance.choice(("succeeded", "failed", "preempted")), "completed")
        for state in states:
            event = ConnectionEvent(
                id=f"{seed}-{number}", kind=kind, initiator=HUMAN, responder=ROBOT, state=state, cause=cause,
                at=Stamp("loop", at), started=Stamp("loop", at), delay=chance.random(),
            )  # fmt: skip
            one.feed(event)
            other.feed(event)
        if number % 20 == 19:
            former, other = other.session(), EventTally(30.0)
            other.resume(former)

    left, right = one.session(), other.session()
    assert [flat(each) for each in right.kinds] == [pytest.approx(flat(each)) for each in left.kinds]
    names = ("mtbce", "mtbce_without_maintenance", "max_gap", "events")
    assert [getattr(right, name) for name in names] == pytest.approx([getattr(left, name) for name in names])
    assert (right.last_start, right.last_start_without_maintenance) == (
        left.last_start,
        left.last_start_without_maintenance,
    )


def flat(numbers: KindStatistics) -> list[float | None]:
    return [value for value in astuple(numbers) if not isinstance(value, str)]
