"""Connection events as a product: what is open for who comes late, then each change once; one person, one kind."""

import asyncio
from functools import partial
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent, EventOutcome, OpenEvents, RequestEvent
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.event_stream import EventStream
from engage_hri.services.client.feeds import EventFeed
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.recognition.events.open_events import OpenEventTracker
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.service import running
from tests.recognition.observations import ROBOT, world
from tests.recognition.test_service import recognition, request


def looks(bus: Bus, actor: str, target: str) -> None:
    bus.publish(keys.PERCEIVED_ACTION, ActionBegan(actor=actor, action="look", at=bus.stamp(), targets=(target,)))


def looks_away(bus: Bus, actor: str) -> None:
    bus.publish(keys.PERCEIVED_ACTION, ActionEnded(actor=actor, action="look", at=bus.stamp()))


async def told(feed: EventFeed, patience: float = 0.5) -> list[tuple[str, str, str]]:
    """Who, kind and state of what comes before nothing comes for so long."""
    found = []
    while (event := await feed.next(patience)) is not None:
        found.append((event.person(ROBOT), event.kind, event.state))
    return found


MUTUAL = "mutual_facial_gaze"


async def test_who_comes_late_gets_what_is_open_and_then_each_change_once(hub: MemoryHub):
    perception = hub.join("perception")
    async with running(hub, recognition()), connect(hub=hub) as robot:
        perception.publish(keys.WORLD, world())
        looks(perception, "ann", ROBOT)
        looks(perception, "bob", ROBOT)
        looks_away(perception, "bob")
        await told(robot.connection_events())

        with robot.connection_events(open=True) as events, robot.connection_events() as changes:
            assert await told(events) == [("ann", MUTUAL, "started")]
            assert [event.person(ROBOT) for event in events.open] == ["ann"]
            looks_away(perception, "ann")
            assert await told(events) == [("ann", MUTUAL, "failed")]
            assert events.open == ()
            assert await told(changes) == [("ann", MUTUAL, "failed")]


async def test_an_event_that_has_ended_is_never_told_as_open(hub: MemoryHub):
    perception = hub.join("perception")
    async with running(hub, recognition()), connect(hub=hub) as robot:
        perception.publish(keys.WORLD, world())
        looks(perception, "ann", ROBOT)
        looks_away(perception, "ann")
        assert len(await told(robot.connection_events())) == 2

        with robot.connection_events(open=True) as events:
            assert await told(events) == []


async def test_one_may_listen_to_one_person_and_some_kinds(hub: MemoryHub):
    perception = hub.join("perception")
    async with running(hub, recognition()), connect(hub=hub) as robot:
        perception.publish(keys.WORLD, world())
        for actor in ("ann", "bob"):
            looks(perception, actor, ROBOT)
        await robot.statistics("bob")
        with (
            robot.connection_events("ann", open=True) as anns,
            robot.connection_events(kind=MUTUAL, open=True) as mutual,
            robot.connection_events("bob", ["directed_gaze", "adjacency_pair"], open=True) as bobs,
        ):
            point = ActionBegan(actor="bob", action="point", at=perception.stamp(), targets=("blue-square",))
            perception.publish(keys.PERCEIVED_ACTION, point)

            assert await told(anns, 0.1) == [("ann", MUTUAL, "started")]
            assert [who for who, _, state in await told(mutual, 0.1) if state == "started"] == ["ann", "bob"]
            assert await told(bobs, 0.1) == [("bob", "directed_gaze", "started")]


async def test_statistics_of_one_person_or_of_each(hub: MemoryHub):
    perception = hub.join("perception")
    async with running(hub, recognition()), connect(hub=hub) as robot:
        perception.publish(keys.WORLD, world())
        for actor in ("ann", "bob"):
            looks(perception, actor, ROBOT)
        await robot.statistics("bob")

        with robot.statistics_updates() as everybodys, robot.statistics_updates("ann") as anns:
            actors = {one.actor for one in [await everybodys.next(1) for _ in range(3)] if one}
            own = await anns.next(1)

    assert actors == {"", "ann", "bob"}
    assert own is not None
    assert (own.actor, own.session.events) == ("ann", 1)


@pytest.mark.parametrize("wanted", [{"actor": "a/b"}, {"actor": "*"}, {"actor": "@ann"}, {"kind": "gaze"}])
async def test_what_cannot_be_listened_to_is_refused_at_once(hub: MemoryHub, wanted: dict[str, Any]):
    async with connect(hub=hub) as robot:
        with pytest.raises(ValueError, match=next(iter(wanted.values())).replace("*", r"\*")):
            robot.connection_events(**wanted)


async def watched(hub: MemoryHub, robot: Robot, perception: Bus) -> EventFeed:
    """A feed that has been told of an open event of ann."""
    perception.publish(keys.WORLD, world())
    look = ActionBegan(actor=ROBOT, action="look", at=perception.stamp(), targets=("ann",))
    perception.publish(keys.ROBOT_ACTION, look)
    looks(perception, "ann", ROBOT)
    events = robot.connection_events("ann")
    assert await told(events, 0.1) == [("ann", MUTUAL, "started"), ("ann", MUTUAL, "succeeded")]
    return events


async def test_the_events_of_a_dead_recognition_are_lost_after_the_grace(hub: MemoryHub):
    async with running(hub, recognition()), connect(hub=hub) as robot:
        events = await watched(hub, robot, hub.join("perception"))
        killed = robot.now()
        hub.kill("recognition")
        lost = await events.next()

        assert lost is not None
        assert (lost.state, lost.delay, robot.local(lost.at), robot.now()) == (
            "lost",
            0.0,
            killed + 2.0,
            killed + 2.0,
        )
        assert events.open == ()
        with robot.connection_events(open=True) as late:
            assert await told(late, 5.0) == []


async def test_the_grace_counts_from_the_death_however_late_it_is_read(hub: MemoryHub):
    async with running(hub, recognition()), connect(hub=hub) as robot:
        events = await watched(hub, robot, hub.join("perception"))
        hub.kill("recognition")
        await asyncio.sleep(1.5)

        assert await events.next(0.25) is None
        assert await told(events, 0.5) == [("ann", MUTUAL, "lost")]


async def test_a_return_is_heard_before_the_loss_however_late_it_is_read(hub: MemoryHub):
    async with running(hub, recognition()), connect(hub=hub) as robot:
        events = await watched(hub, robot, hub.join("perception"))
        run = hub._buses["recognition"].run
        hub.announce(PeerGone(participant="recognition"))
        await asyncio.sleep(1.0)
        hub.announce(PeerAlive(participant="recognition", run=run))
        await asyncio.sleep(5.0)

        assert await told(events) == []
        assert len(events.open) == 1


async def test_the_events_of_the_former_life_are_lost_as_the_next_one_comes(hub: MemoryHub):
    perception = hub.join("perception")
    async with running(hub, recognition()), connect(hub=hub) as robot:
        events = await watched(hub, robot, perception)
        former = events.open[0].id
        hub.kill("recognition")
        async with running(hub, recognition()):
            looks(perception, "ann", ROBOT)
            lost, started = await events.next(), await events.next()

    assert lost is not None
    assert started is not None
    assert (lost.id, lost.state) == (former, "lost")
    assert (started.state, started.kind) == ("started", MUTUAL)
    assert started.session != lost.session


async def test_the_event_of_a_request_is_found_from_it_and_keeps_its_id(hub: MemoryHub):
    bus = hub.join("realizer")
    async with running(hub, recognition()), Requester(bus) as requests, connect(hub=hub) as robot:
        with robot.connection_events() as events:
            bus.publish(keys.WORLD, world())
            asked: RequestEvent = request(bus, "directed_gaze", "blue-square", limit=1.0)
            outcome = await requests.send(keys.EVENT, asked).outcome
            life = [await events.next(), await events.next()]

    assert isinstance(outcome, EventOutcome)
    assert [(one.id, one.block, one.behavior) for one in life if one] == [
        (outcome.event, asked.block, asked.event.id)
    ] * 2


async def test_the_same_run_gives_the_same_ids(hub: MemoryHub):
    async def run() -> list[str]:
        async with MemoryHub() as fresh:
            perception = fresh.join("perception")
            async with running(fresh, recognition()), connect(hub=fresh) as robot:
                with robot.connection_events() as events:
                    perception.publish(keys.WORLD, world())
                    for actor in ("ann", "bob"):
                        looks(perception, actor, ROBOT)
                    return [event.id async for event in _first(events, 3)]

    assert await run() == await run()


async def _first(feed: EventFeed, count: int) -> Any:
    for _ in range(count):
        yield await feed.next()


# -- the stream alone ------------------------------------------------------------------------------------------------

STATES = {"dies": ("started", "failed"), "lives": ("started", "succeeded", "completed")}


def change(number: int, actor: str, state: str, at: float) -> ConnectionEvent:
    return ConnectionEvent(
        id=f"life-dg-{number}", kind="directed_gaze", initiator=ROBOT, responder=actor, state=state,  # type: ignore[arg-type]
        at=Stamp("loop", at), started=Stamp("loop", at),
    )  # fmt: skip


@st.composite
def histories(draw: st.DrawFn) -> list[ConnectionEvent]:
    """Lives of some events of two persons, shuffled together."""
    lives = draw(st.lists(st.tuples(st.sampled_from(("ann", "bob")), st.sampled_from(list(STATES))), max_size=5))
    waiting = [
        [change(number, actor, state, 0.0) for state in STATES[life]] for number, (actor, life) in enumerate(lives)
    ]
    changes: list[ConnectionEvent] = []
    while any(waiting):
        changes.append(draw(st.sampled_from([life for life in waiting if life])).pop(0))
    cut = draw(st.integers(0, len(changes)))
    return changes[:cut]


def stream(began: float = 0.0) -> EventStream:
    return EventStream(began, partial(Stamp, "loop"))


@settings(max_examples=50)
@given(histories(), st.integers(0, 20), st.integers(0, 20))
def test_whenever_one_comes_nothing_is_missed_repeated_or_stale(
    history: list[ConnectionEvent], joins: int, remembered: int
):
    joins = min(joins, len(history))
    book, reader, states = OpenEventTracker(ROBOT, "life"), stream(began=float(joins)), {}
    for before in history[:joins]:
        states |= {state.actor: state for state in book.feed([before], before.at)}
    open_then = [event for state in states.values() for event in state.events]
    heard = reader.feed(PeerAlive(participant="recognition", run="life"), 0, 0)
    for before in history[max(0, joins - remembered) : joins]:  # what the bus still has of the last seconds
        heard += reader.feed(before, joins - 1.0, joins, past=True)
    for state in states.values():
        heard += reader.feed(state, joins - 1.0, joins, past=True)
    for after in history[joins:]:
        heard += reader.feed(after, joins, joins)
        for state in book.feed([after], after.at):
            heard += reader.feed(state, joins, joins)

    assert heard == [*open_then, *history[joins:]]
    still_open = {event.id: event for event in history}
    assert reader.open == {id: event for id, event in still_open.items() if event.state not in ENDINGS}


def test_a_cut_longer_than_the_grace_ends_events_that_come_back_with_it():
    reader = stream()
    started, succeeded = change(1, "ann", "started", 0.0), change(1, "ann", "succeeded", 4.0)
    reader.feed(PeerAlive(participant="recognition", run="life"), 0, 0)
    reader.feed(started, 0, 0)
    reader.feed(PeerGone(participant="recognition"), 1.0, 1.0)

    assert reader.deadline == 3.0
    assert [event.state for event in reader.expire(3.0)] == ["lost"]
    assert reader.feed(PeerAlive(participant="recognition", run="life"), 5.0, 5.0) == [started]
    assert reader.feed(succeeded, 4.0, 5.0) == [succeeded]


def test_who_asks_before_the_deadline_is_told_nothing():
    reader = stream()
    reader.feed(change(1, "ann", "started", 0.0), 0, 0)
    assert reader.expire(0.5) == []
    reader.feed(PeerGone(participant="recognition"), 1.0, 1.0)

    assert reader.expire(2.9) == []  # others have deadlines of their own, as `following`
    assert reader.deadline == 3.0
    assert [event.state for event in reader.expire(3.0)] == ["lost"]


def test_a_short_cut_changes_nothing():
    reader = stream()
    reader.feed(change(1, "ann", "started", 0.0), 0, 0)
    reader.feed(PeerGone(participant="recognition"), 1.0, 1.0)

    assert reader.feed(PeerAlive(participant="recognition", run="life"), 2.5, 2.5) == []
    assert reader.deadline is None
    assert list(reader.open) == ["life-dg-1"]


def test_a_state_heals_what_never_came():
    reader = stream()
    lost, kept = change(1, "ann", "started", 0.0), change(2, "ann", "started", 0.0)
    for event in (lost, kept):
        reader.feed(event, 0, 0)
    decided = change(2, "ann", "succeeded", 1.0)
    state = OpenEvents(actor="ann", session="life", at=Stamp("loop", 1.0), events=(decided,))

    told = reader.feed(state, 1.0, 1.0)

    assert [(event.id, event.state) for event in told] == [(lost.id, "lost"), (decided.id, "succeeded")]
    assert reader.feed(decided, 1.0, 1.1) == []


@pytest.mark.parametrize("opening", [True, False])
def test_what_comes_twice_is_told_once(opening: bool):
    reader, book = EventStream(0.0, partial(Stamp, "loop"), opening=opening), OpenEventTracker(ROBOT, "life")
    life = [change(1, "ann", state, 0.0) for state in ("started", "failed")]
    told = []
    for each in life:
        for message in (each, *book.feed([each], each.at)):
            told += [*reader.feed(message, 0, 0), *reader.feed(message, 0, 0)]

    assert told == life


def told_again(event: ConnectionEvent, words: str, at: float) -> ConnectionEvent:
    return replace(event, words=words, retold=True, at=Stamp("loop", at))


@pytest.mark.parametrize("state", ["succeeded", "completed"])
def test_words_that_come_later_are_told_once(state: str):
    one, (begun, changed) = stream(), (change(1, "ann", each, at) for at, each in ((1.0, "started"), (2.0, state)))
    again = told_again(changed, "yes", 3.0)
    told = [one.feed(each, each.at.seconds, 3.0) for each in (begun, changed, again, again)]

    assert told == [[begun], [changed], [again], []]


def test_words_of_an_event_that_ended_before_it_was_followed_are_told_too():
    one = stream(began=2.5)
    again = told_again(change(1, "ann", "completed", 2.0), "yes", 3.0)

    assert one.feed(again, 3.0, 3.0) == [again]


def test_an_open_event_has_its_words_for_who_comes_late():
    tracker, one = OpenEventTracker(ROBOT, "s"), stream(began=5.0)
    begun = change(1, "ann", "started", 1.0)
    tracker.feed([begun], Stamp("loop", 1.0))
    (state,) = tracker.feed([told_again(begun, "where is it", 2.0)], Stamp("loop", 2.0))

    (told,) = one.feed(state, 2.0, 5.0, past=True)
    assert (told.words, told.retold) == ("where is it", False)


def test_an_older_change_takes_no_words_away():
    one, begun = stream(), change(1, "ann", "started", 1.0)
    again = told_again(begun, "where is it", 2.0)
    for each in (begun, again):
        one.feed(each, each.at.seconds, 2.0)

    assert one.feed(begun, 1.0, 2.0) == []
