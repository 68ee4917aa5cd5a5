"""The service given nothing but raw perception, over the memory bus: cameras at 30 Hz, a microphone at 50 Hz."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import TurnSignal
from engage_hri.schemas.body import BodyPose, Ray, RobotState
from engage_hri.schemas.messages import encode
from engage_hri.schemas.perception import ActionBegan, HeadPose
from engage_hri.schemas.recognition import EventOutcome, SignalTurn
from engage_hri.schemas.units import Vector
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.service import running
from tests.recognition.observations import HUMAN, ROBOT
from tests.recognition.raw import face, hand, place_of, pose, table, voice
from tests.recognition.test_service import recognition, request

Script = Callable[[float], str]
LAP: Vector = (1.1, 0.2, 0.68)


class Body:
    """A person whom cameras and a microphone watch. The functions say what is so at a time."""

    def __init__(
        self, looks: Script = lambda at: "table", speaks: Callable[[float], bool] = lambda at: False
    ) -> None:
        self.looks = looks
        self.speaks = speaks
        self.hand: Callable[[float], Vector] = lambda at: LAP
        self.hidden: Callable[[float], bool] = lambda at: False
        self.blue: Callable[[float], Vector] = lambda at: place_of("blue")

    async def watched(self, bus: Bus) -> None:
        shown = None
        while True:
            now = bus.now()
            world = table(face(), hand(self.hand(now)), blue=self.blue(now))
            if world != shown:
                bus.publish(keys.WORLD, world)
                shown = world
            if not self.hidden(now):
                bus.publish(keys.head_pose(HUMAN), pose(self.looks(now), now))
            await asyncio.sleep(1 / 30)

    async def heard(self, bus: Bus) -> None:
        while True:
            bus.publish(keys.voice_activity(HUMAN), voice(self.speaks(bus.now()), bus.now()))
            await asyncio.sleep(0.02)


@asynccontextmanager
async def watching(hub: MemoryHub, body: Body) -> AsyncIterator[tuple[Bus, Requester]]:
    bus = hub.join("realizer")
    async with running(hub, recognition()), Requester(bus) as requests, asyncio.TaskGroup() as tasks:
        watchers = [tasks.create_task(body.watched(bus)), tasks.create_task(body.heard(bus))]
        await asyncio.sleep(0.5)
        yield bus, requests
        for watcher in watchers:
            watcher.cancel()


async def decided(requests: Requester, asked: object, key: str = keys.EVENT) -> EventOutcome:
    outcome = await requests.send(key, asked).outcome  # type: ignore[arg-type]
    assert isinstance(outcome, EventOutcome)
    return outcome


async def test_a_look_follows_the_robots(hub: MemoryHub):
    body = Body(looks=lambda at: "blue" if at >= 1.2 else "table")
    async with watching(hub, body) as (bus, requests):
        outcome = await decided(requests, request(bus, "directed_gaze", "blue"))

    assert (outcome.state, outcome.delay) == ("succeeded", pytest.approx(0.7, abs=1 / 30))


async def test_a_look_just_before_the_limit_is_in_time_though_known_after_it(hub: MemoryHub):
    body = Body(looks=lambda at: "blue" if at >= 2.95 else "table")
    async with watching(hub, body) as (bus, requests):
        outcome = await decided(requests, request(bus, "directed_gaze", "blue"))

        assert bus.now() > 3.0
    assert (outcome.state, outcome.delay) == ("succeeded", pytest.approx(2.45, abs=1 / 30))


async def test_a_glance_that_passes_decides_nothing(hub: MemoryHub):
    body = Body(looks=lambda at: "blue" if 1.0 <= at < 1.1 else "table")
    async with watching(hub, body) as (bus, requests):
        outcome = await decided(requests, request(bus, "directed_gaze", "blue"))

    assert (outcome.state, outcome.delay) == ("failed", 2.5)


async def test_faces_meet_where_the_robots_really_is(hub: MemoryHub):
    eyes = (0.0, 0.6, 1.5)
    body = Body()
    async with watching(hub, body) as (bus, requests):
        state = Ray(origin=eyes, axis=(1.0, 0.0, 0.0))
        at = bus.stamp()
        bus.publish(keys.ROBOT_STATE, RobotState(at=at, pose=BodyPose(), gaze=state, left_arm=state, right_arm=state))
        missed = requests.send(keys.EVENT, request(bus, "mutual_facial_gaze", limit=0.5))
        body.looks = lambda at: ROBOT
        assert (await missed.outcome).state == "failed"  # type: ignore[attr-defined]
        met = requests.send(keys.EVENT, request(bus, "mutual_facial_gaze", id="r-2"))
        body.looks = lambda at: eyes  # type: ignore[assignment, return-value]
        outcome = await met.outcome

    assert isinstance(outcome, EventOutcome)
    assert (outcome.state, outcome.delay) == ("succeeded", pytest.approx(0.0, abs=1 / 30))


async def ask(bus: Bus, requests: Requester, *accept: str) -> EventOutcome:
    pair = requests.send(keys.EVENT, request(bus, "adjacency_pair", turn="t-1", accept=accept))
    ended = TurnSignal(id="turn", turn="t-1", signal="ended", actor=HUMAN)
    await requests.send(keys.TURN, SignalTurn(id="s", requester=bus.name, signal=ended, at=bus.stamp())).outcome
    outcome = await pair.outcome
    assert isinstance(outcome, EventOutcome)
    return outcome


async def test_a_spoken_answer_with_gaps_ends_an_adjacency_pair(hub: MemoryHub):
    body = Body(speaks=lambda at: 1.0 <= at < 1.15 or 1.3 <= at < 1.6)
    async with watching(hub, body) as (bus, requests):
        outcome = await ask(bus, requests)

    assert (outcome.state, outcome.response, outcome.delay) == ("succeeded", "speak", pytest.approx(0.5, abs=0.021))


async def test_a_cough_is_no_answer(hub: MemoryHub):
    body = Body(speaks=lambda at: 1.0 <= at < 1.07)
    async with watching(hub, body) as (bus, requests):
        outcome = await ask(bus, requests)

    assert (outcome.state, outcome.response) == ("failed", None)


async def test_a_moved_piece_answers_an_adjacency_pair(hub: MemoryHub):
    def blue(at: float) -> Vector:
        return (0.6 - 0.3 * min(max(at - 2.0, 0.0), 1.0), -0.2, 0.7)

    body = Body()
    body.blue = blue
    body.hand = lambda at: (blue(at)[0], -0.2 + max(2.0 - at, 0.0) * 0.4, 0.73)
    async with watching(hub, body) as (bus, requests):
        outcome = await ask(bus, requests, "speak", "act")

    assert (outcome.state, outcome.response, outcome.delay) == ("succeeded", "act", pytest.approx(1.55, abs=0.06))


@pytest.mark.parametrize("back", [3.45, 9.0])
async def test_a_face_lost_for_two_seconds_ends_what_was_shared_and_not_before(hub: MemoryHub, back: float):
    body = Body(looks=lambda at: ROBOT)
    body.hidden = lambda at: 1.52 < at < back
    watcher = hub.join("console")
    with watcher.subscribe(keys.ANY_CONNECTION_EVENT) as inbox:
        async with watching(hub, body) as (bus, _):
            bus.publish(keys.ROBOT_ACTION, ActionBegan(actor=ROBOT, action="look", at=bus.stamp(), targets=(HUMAN,)))
            await asyncio.sleep(4.5)
        events = [queued.message for queued in list(inbox._queue)]
    ended = [event for event in events if event.state == "completed"]  # type: ignore[union-attr]

    if back < 3.5:
        assert ended == []
    else:
        (event,) = ended
        assert event.at.seconds == pytest.approx(3.5, abs=1e-3), "two seconds after the last pose"  # type: ignore[union-attr]
        assert event.duration == pytest.approx(1.0, abs=1 / 30), "until the last pose"  # type: ignore[union-attr]


async def test_what_it_finds_is_told_to_all(hub: MemoryHub):
    body = Body(looks=lambda at: "blue" if at >= 0.2 else "table")
    listener = hub.join("generation")
    with listener.subscribe(keys.ANY_ACTION) as inbox:
        async with watching(hub, body):
            heard = [received async for received in _taken(inbox, 4)]

    assert {received.key for received in heard} == {keys.RECOGNIZED_ACTION}
    assert [type(received.message).__name__ for received in heard] == [
        "ActorFound", "ActionBegan", "ActionEnded", "ActionBegan",
    ]  # fmt: skip
    last = heard[-1].message
    assert isinstance(last, ActionBegan)
    assert last.targets == ("blue",)


async def _taken(inbox, number):
    for _ in range(number):
        yield await inbox.next()


async def test_nobody_speaks_for_the_robots_head_or_under_anothers_key(hub: MemoryHub):
    bus = hub.join("perception")
    with bus.subscribe(keys.ANY_ACTION) as inbox:
        async with running(hub, recognition()):
            bus.publish(keys.WORLD, table())
            for at in (0.0, 0.1, 0.2):
                about_robot = pose("blue", at, actor=ROBOT)
                bus.publish(keys.head_pose(ROBOT), about_robot)
                bus.publish(keys.head_pose("ann"), pose("blue", at, actor="bob"))
                nowhere = HeadPose(actor="eve", position=(0.0, 0.0, 1.2), direction=(0, 0, 0), at=bus.stamp(at))
                bus.publish(keys.head_pose("eve"), nowhere)
                await asyncio.sleep(0.1)
            await asyncio.sleep(1.0)

        assert len(inbox) == 0


@pytest.mark.parametrize("part", [float("nan"), float("inf"), 1e308])
async def test_what_is_no_place_is_refused_with_a_fault_and_computed_with_by_nobody(hub: MemoryHub, part: float):
    bus = hub.join("perception")
    head = HeadPose(actor="eve", position=(part, 0.0, 1.2), direction=(1.0, 0.0, 0.0), at=bus.stamp())
    with bus.subscribe(keys.ANY_ACTION) as actions, bus.subscribe(keys.fault("recognition")) as faults:
        async with running(hub, recognition()):
            for key, message in ((keys.WORLD, table(red=(part, 0.0, 0.7))), (keys.head_pose("eve"), head)):
                hub.inject(key, encode(message), "application/msgpack")
            await asyncio.sleep(1.0)

        assert len(actions) == 0
        reasons = [str(queued.message) for queued in faults._queue]
    assert "at `$.entities[2].position[0]`" in reasons[0]
    assert "at `$.position[0]`" in reasons[1]
