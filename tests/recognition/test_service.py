"""The service on a memory bus in virtual time, with the test in the places of realizer, body and perception."""

import asyncio
from functools import partial

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Event, TurnSignal
from engage_hri.schemas.blocks import BlockProgress, SyncPointProgress
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.recognition import ConnectionEvent, EventOutcome, RequestEvent, SignalTurn, Statistics
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.deadlines import LATE
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryBus, MemoryHub
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.service import recognize
from engage_hri.services.reports.action_reports import REPORT_GRACE
from engage_hri.services.requests.ends import Requester, RequestRefused
from engage_hri.services.runtime.service import Service, running
from tests.commanding import command
from tests.recognition.observations import HUMAN, ROBOT, world
from tests.standing_still import stand_still


def recognition(**config: object) -> dict[str, Service]:
    return {"recognition": partial(recognize, config=RecognitionConfig(**config))}  # type: ignore[arg-type]


def request(bus: Bus, kind: str, *objects: str, id: str = "r-1", **event: object) -> RequestEvent:
    asked = Event(id=f"{kind}-1", kind=kind, responder=HUMAN, objects=objects, **event)  # type: ignore[arg-type]
    return RequestEvent(id=id, requester=bus.name, block="block-1", at=bus.stamp(), event=asked)


def perceive(bus: Bus, target: str, at: float | None = None) -> None:
    look = ActionBegan(actor=HUMAN, action="look", at=bus.stamp(at), targets=(target,))
    bus.publish(keys.PERCEIVED_ACTION, look)


async def test_directed_gaze_is_decided_by_the_look_of_the_person(hub: MemoryHub):
    bus = hub.join("realizer")
    async with running(hub, recognition()), Requester(bus) as requests:
        bus.publish(keys.WORLD, world())
        pending = requests.send(keys.EVENT, request(bus, "directed_gaze", "blue-square"))
        await pending.accepted
        at = bus.now()
        hub._loop.call_later(0.75, perceive, bus, "blue-square")
        outcome = await pending.outcome

    assert isinstance(outcome, EventOutcome)
    assert (outcome.state, outcome.delay, outcome.at) == ("succeeded", 0.75, Stamp("loop", at + 0.75))


async def test_the_outcome_tells_how_wrong_its_delay_can_be(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(MemoryBus, "error", lambda bus, clock: 0.25)
    bus = hub.join("realizer")
    async with running(hub, recognition()), Requester(bus) as requests:
        bus.publish(keys.WORLD, world())
        pending = requests.send(keys.EVENT, request(bus, "directed_gaze", "blue-square"))
        await pending.accepted
        hub._loop.call_later(0.75, perceive, bus, "blue-square")
        outcome = await pending.outcome

    assert isinstance(outcome, EventOutcome)
    assert outcome.delay_error == 0.5  # that of the person and that of the robot


async def test_directed_gaze_fails_at_its_limit_after_the_last_anchor(hub: MemoryHub):
    bus = hub.join("realizer")
    async with running(hub, recognition()), Requester(bus) as requests:
        bus.publish(keys.WORLD, world())
        anchors = ("gaze-1:stroke", "phrase-1:start")
        pending = requests.send(keys.EVENT, request(bus, "directed_gaze", "blue-square", anchors=anchors))
        for behavior, sync, after in (("gaze-1", "stroke", 0.4), ("phrase-1", "start", 1.0)):
            point = SyncPointProgress(block="block-1", behavior=behavior, sync=sync, at=bus.stamp(after), time=after)
            hub._loop.call_at(after, bus.publish, keys.FEEDBACK, point)
        outcome = await pending.outcome

    assert isinstance(outcome, EventOutcome)
    assert (outcome.state, bus.now(), outcome.delay) == ("failed", 3.5, 2.5)


async def test_mutual_gaze_and_adjacency_pair_over_the_bus(hub: MemoryHub):
    bus = hub.join("realizer")
    async with running(hub, recognition()), Requester(bus) as requests:
        bus.publish(keys.WORLD, world())
        pair = requests.send(keys.EVENT, request(bus, "adjacency_pair", id="ap", turn="t-1"))
        gaze = requests.send(keys.EVENT, request(bus, "mutual_facial_gaze", id="mfg", optional=True))
        ended = TurnSignal(id="turn", turn="t-1", signal="ended", actor=HUMAN)
        turn = requests.send(keys.TURN, SignalTurn(id="s", requester=bus.name, signal=ended, at=bus.stamp()))
        perceived = ActionBegan(actor=HUMAN, action="nod", at=bus.stamp(1.0))
        hub._loop.call_at(1.0, bus.publish, keys.PERCEIVED_ACTION, perceived)
        await turn.outcome
        answered, looked = await pair.outcome, await gaze.outcome

    assert isinstance(answered, EventOutcome)
    assert isinstance(looked, EventOutcome)
    assert (answered.state, answered.response, answered.delay) == ("succeeded", "nod", 1.0)
    assert (looked.state, looked.delay) == ("failed", 1.9)


async def test_unknown_actor_is_refused_with_the_known_ones(hub: MemoryHub):
    bus = hub.join("realizer")
    async with running(hub, recognition()), Requester(bus) as requests:
        bus.publish(keys.WORLD, world())
        pending = requests.send(keys.EVENT, request(bus, "mutual_facial_gaze"))
        stranger = Event(id="mfg-1", kind="mutual_facial_gaze", responder="stranger")
        refused = requests.send(
            keys.EVENT,
            RequestEvent(id="r-2", requester=bus.name, block="block-1", at=bus.stamp(), event=stranger),
        )

        with pytest.raises(RequestRefused, match="block-1: mfg-1: unknown actor 'stranger'"):
            await refused.outcome
        await pending.accepted


async def test_time_is_that_of_the_stamps_not_of_the_arrival(hub: MemoryHub):
    bus = hub.join("realizer")
    async with running(hub, recognition()), Requester(bus) as requests:
        bus.publish(keys.WORLD, world())
        pending = requests.send(keys.EVENT, request(bus, "mutual_facial_gaze"))
        hub._loop.call_at(1.0, perceive, bus, ROBOT, 0.8)
        outcome = await pending.outcome

    assert isinstance(outcome, EventOutcome)
    assert (bus.now(), outcome.delay) == (1.0, 0.8)


async def test_statistics_are_there_for_a_late_joiner(hub: MemoryHub):
    bus = hub.join("perception")
    async with running(hub, recognition()):
        bus.publish(keys.WORLD, world())
        robot_look = ActionBegan(actor=ROBOT, action="look", at=bus.stamp(), targets=(HUMAN,))
        bus.publish(keys.ROBOT_ACTION, robot_look)
        perceive(bus, ROBOT)
        with bus.subscribe(keys.ANY_CONNECTION_EVENT) as inbox:
            received = await inbox.next()
        with hub.join("console").subscribe(keys.ANY_STATISTICS) as late:
            statistics = [await late.next(), await late.next()]

    assert received is not None
    assert isinstance(received.message, ConnectionEvent)
    assert (received.message.id, received.message.state) == ("2-mfg-1", "started")
    assert {one.key for one in statistics if one} == {keys.statistics("all"), keys.statistics(HUMAN)}
    assert all(isinstance(one.message, Statistics) and one.message.session.events == 1 for one in statistics if one)


async def test_only_the_body_says_what_the_robot_does(hub: MemoryHub):
    bus = hub.join("perception")
    async with running(hub, recognition()):
        bus.publish(keys.WORLD, world())
        bus.publish(keys.PERCEIVED_ACTION, ActionBegan(actor=ROBOT, action="look", at=bus.stamp(), targets=(HUMAN,)))
        perceive(bus, ROBOT)
        with bus.subscribe(keys.ANY_CONNECTION_EVENT) as inbox:
            first, second = await inbox.next(), await inbox.next()

    assert first is not None
    assert second is not None
    assert [first.message.state, second.message.state] == ["started", "failed"]  # type: ignore[union-attr]


async def test_the_death_of_the_requester_withdraws_its_events(hub: MemoryHub):
    realizer, watcher = hub.join("realizer"), hub.join("console")
    realizer.declare_alive()
    async with running(hub, recognition()):
        realizer.publish(keys.WORLD, world())
        command(realizer, keys.EVENT, request(realizer, "directed_gaze", "blue-square"))
        with watcher.subscribe(keys.ANY_CONNECTION_EVENT) as inbox:
            started = await inbox.next()
            hub.kill("realizer")
            ended = await inbox.next()

    assert started is not None
    assert ended is not None
    assert ended.message.state == "withdrawn"  # type: ignore[union-attr]
    assert ended.at == 2.0


async def test_the_death_of_perception_closes_what_is_open_with_the_people_it_reports(hub: MemoryHub):
    cameras, others, control = hub.join("cameras"), hub.join("others"), hub.join("control")
    cameras.declare_alive()
    async with running(hub, recognition()):
        cameras.publish(keys.WORLD, world(HUMAN, "ann"))
        control.publish(
            keys.ROBOT_ACTION, ActionBegan(actor=ROBOT, action="look", at=control.stamp(), targets=(HUMAN,))
        )
        with control.subscribe(keys.ANY_CONNECTION_EVENT) as inbox:
            others.publish(keys.PERCEIVED_ACTION, ActionBegan(actor="ann", action="speak", at=others.stamp()))
            perceive(cameras, ROBOT)
            hub._loop.call_at(1.0, hub.kill, "cameras")
            while (received := await inbox.next()) and received.at < 1.0:
                continue

    assert received is not None
    assert isinstance(received.message, ConnectionEvent)
    assert (received.message.id, received.message.state, received.message.duration) == ("4-mfg-1", "completed", 1.0)
    assert received.at == 1.0 + REPORT_GRACE


async def test_a_block_that_ends_stops_the_wait_for_its_anchors(hub: MemoryHub):
    bus = hub.join("realizer")
    async with running(hub, recognition()), Requester(bus) as requests:
        bus.publish(keys.WORLD, world())
        pending = requests.send(keys.EVENT, request(bus, "directed_gaze", "blue-square", anchors=("gone-1:start",)))
        end = BlockProgress(block="block-1", progress="end", at=bus.stamp(1.0), status="done")
        hub._loop.call_at(1.0, bus.publish, keys.FEEDBACK, end)
        await pending.outcome

    assert bus.now() == 3.5


async def test_bad_names_never_end_the_service(hub: MemoryHub):
    bus = hub.join("perception")
    faults = bus.subscribe(keys.fault("recognition"))
    async with running(hub, recognition()):
        for actor in ("", "a/b", "**", "#", "@b"):
            bus.publish(
                keys.PERCEIVED_ACTION, ActionBegan(actor=actor, action="look", at=bus.stamp(), targets=(ROBOT,))
            )
            bus.publish(keys.PERCEIVED_ACTION, ActionEnded(actor=actor, action="look", at=bus.stamp()))
        bus.publish(keys.PERCEIVED_ACTION, ActionBegan(actor="ann", action="look", at=bus.stamp(), targets=(ROBOT,)))
        with bus.subscribe(keys.ANY_CONNECTION_EVENT) as inbox:
            received = await inbox.next()

    assert received is not None
    assert received.message.initiator == "ann"  # type: ignore[union-attr]
    told = [queued.message.reason for queued in faults._queue]  # type: ignore[union-attr]
    assert told == [f"{name!r} can't be in a key" for name in ("", "a/b", "**", "#", "@b")]


async def test_who_asks_before_anything_has_happened_is_told_so(hub: MemoryHub) -> None:
    async with running(hub, recognition()):
        with hub.join("watcher").subscribe(keys.statistics("all")) as inbox:
            received = await inbox.next(10.0)

    assert received is not None
    assert isinstance(received.message, Statistics)
    assert (received.message.session.events, received.message.level) == (0, "unknown")


async def test_the_states_of_who_is_forgotten_are_withdrawn(hub: MemoryHub):
    """Visitors come and go, each under a name of its own. Who asks later is told of those who are remembered."""
    bus = hub.join("camera")

    def look(actor: str) -> None:
        bus.publish(keys.PERCEIVED_ACTION, ActionBegan(actor=actor, action="look", at=bus.stamp(), targets=(ROBOT,)))

    async with running(hub, recognition()):
        for name in ("ann", "bob", "carl"):
            bus.publish(keys.PERCEIVED_ACTION, ActorFound(actor=name, at=bus.stamp()))
            look(name)
            await asyncio.sleep(400.0)
            bus.publish(keys.PERCEIVED_ACTION, ActorLost(actor=name, at=bus.stamp()))
        look("dora")
        await asyncio.sleep(1.0)
        with hub.join("late").subscribe(keys.ANY_STATISTICS, keys.ANY_OPEN_EVENTS) as inbox:
            told = {one.key for one in [await inbox.next() for _ in range(len(inbox))] if one is not None}

    remembered = ("bob", "carl", "dora")
    states = {key(actor) for key in (keys.statistics, keys.open_events) for actor in remembered}
    assert told == {keys.statistics("all"), *states}


async def test_where_a_person_looks_is_known_again_once_perception_is_back(hub: MemoryHub):
    """As after a cut: perception says once that a look has begun."""
    bus, camera = hub.join("realizer"), hub.join("camera")
    camera.declare_alive()
    async with running(hub, recognition()), Requester(bus) as requests:
        camera.publish(keys.WORLD, world())
        perceive(camera, "blue-square")
        await asyncio.sleep(1.0)
        hub.announce(PeerGone(participant="camera"))
        await asyncio.sleep(5.0)
        hub.announce(PeerAlive(participant="camera", run=camera.run))
        await asyncio.sleep(1.0)
        outcome = await requests.send(keys.EVENT, request(bus, "directed_gaze", "blue-square")).outcome

    assert isinstance(outcome, EventOutcome)
    assert (outcome.state, outcome.delay) == ("succeeded", 0.0)


@pytest.mark.parametrize(("came", "state"), [(0.5 * LATE, "succeeded"), (2.0 * LATE, "failed")])
async def test_what_a_person_did_while_recognition_stood_still_is_heard_before_its_limit_is_judged(
    hub: MemoryHub, came: float, state: str
):
    """The look is at 0.75, the limit at 2.0; recognition stands still from 0.5 to 5."""
    bus, loop = hub.join("realizer"), asyncio.get_running_loop()
    async with running(hub, recognition()), Requester(bus) as requests:
        bus.publish(keys.WORLD, world())
        pending = requests.send(keys.EVENT, request(bus, "directed_gaze", "blue-square", limit=2.0))
        await pending.accepted
        loop.call_at(loop.time() + 0.5, stand_still, 5.0)
        loop.call_at(5.0 + came, perceive, bus, "blue-square", loop.time() + 0.75)
        outcome = await pending.outcome

    assert isinstance(outcome, EventOutcome)
    assert outcome.state == state
