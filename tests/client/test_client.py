"""The client against a server that answers as the protocol says."""

import asyncio
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.blocks import (
    BehaviorInterrupted,
    Block,
    BlockOutcome,
    InterruptBehavior,
    PerformBlock,
)
from engage_hri.schemas.faults import Fault, InputRefused, NoReply, RunFailed
from engage_hri.schemas.fragments import (
    FragmentOutcome,
    Inhibit,
    InhibitionEnded,
    PerformFragment,
    TurnClosed,
    TurnFragment,
)
from engage_hri.schemas.recognition import ConnectionEvent, Statistics, WindowStatistics
from engage_hri.schemas.requests import Cancel
from engage_hri.schemas.units import Stamp
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.performing import ANSWER_PATIENCE, PerformFailed
from engage_hri.services.client.robot import connect
from engage_hri.services.requests.ends import RequestDesk
from engage_hri.services.runtime.service import Ready, running

HELLO = TurnFragment(id="hello", behaviors=(Speech(id="speech-1", text="Hello"),))
Answering = Callable[[RequestDesk, PerformFragment], Awaitable[None]]


async def server(bus: Bus, ready: Ready, seen: list[object], answer: Answering | None = None) -> None:
    """A stand-in for generation: accepts, and ends requests as done unless `answer` says otherwise."""
    desk = RequestDesk(bus, "generation", seen.append)
    with bus.subscribe(*RequestDesk.patterns("generation")) as inbox:
        ready()
        async for received in inbox:
            request = desk.take(received)
            if isinstance(received.message, Inhibit):
                seen.append(received.message)
            match request:
                case PerformFragment() if answer is not None:
                    await answer(desk, request)
                case PerformFragment(id=id, fragment=fragment):
                    seen.append(fragment)
                    desk.accept(id)
                    desk.end(FragmentOutcome(id=id, fragment=fragment.id, status="done"))
                case Inhibit(id=id):
                    desk.accept(id)
                case Cancel(id=id):
                    seen.append(request)
                    desk.end(InhibitionEnded(id=id, reason="released"))


async def test_perform_returns_the_outcome(hub: MemoryHub) -> None:
    async with running(hub, {"generation": partial(server, seen=[])}), connect(hub=hub) as robot:
        outcome = await robot.perform(HELLO)

    assert (outcome.fragment, outcome.status) == ("hello", "done")


@pytest.mark.parametrize(
    "source",
    [
        '<ebml xmlns="edu.wpi.ebml" id="hello" turnIndex="1" turnStatus="full">'
        '<speech xmlns="org.mindmakers.bml" id="speech-1"><text>Hello</text></speech></ebml>',
        '{"type": "fragment", "id": "hello", "behaviors": [{"type": "speech", "id": "speech-1", "text": "Hello"}]}',
    ],
    ids=["xml", "json"],
)
async def test_a_fragment_may_be_xml_or_json_in_text_bytes_or_a_file(
    hub: MemoryHub, source: str, tmp_path: Path
) -> None:
    file = tmp_path / "hello"
    file.write_text(source)
    seen: list[object] = []
    async with running(hub, {"generation": partial(server, seen=seen)}), connect(hub=hub) as robot:
        for form in (source, source.encode(), file):
            await robot.perform(form)

    for fragment in seen:
        assert isinstance(fragment, TurnFragment)
        assert [(type(it), it.id) for it in fragment.behaviors] == [(Speech, "speech-1")]
    assert len(seen) == 3


async def test_the_client_may_come_before_the_robot(hub: MemoryHub) -> None:
    loop = asyncio.get_running_loop()
    async with connect(hub=hub) as robot, asyncio.TaskGroup() as tasks:
        performing = tasks.create_task(robot.perform(HELLO))
        await asyncio.sleep(3600)
        assert not performing.done()

        async with running(hub, {"generation": partial(server, seen=[])}):
            outcome = await performing

    assert outcome.status == "done"
    assert loop.time() < 3602


async def test_a_robot_that_does_not_come_in_time_is_a_failure_that_says_so(hub: MemoryHub) -> None:
    async with connect(hub=hub) as robot:
        with pytest.raises(RunFailed, match=r"no answer within 5 s.*is generation running"):
            await robot.perform(HELLO, timeout=5)

    assert asyncio.get_running_loop().time() == 5.0


async def test_refused_input_raises_with_the_robots_fault(hub: MemoryHub) -> None:
    async def refuse(desk: RequestDesk, request: PerformFragment) -> None:
        desk.refuse(request.id, Fault(reason="no object 'hexagon'", where="hello: ref-1", line=7))

    service = partial(server, seen=[], answer=refuse)
    async with running(hub, {"generation": service}), connect(hub=hub) as robot:
        with pytest.raises(InputRefused) as refusal:
            await robot.perform(HELLO)

    reason = "no object 'hexagon'"
    assert refusal.value.fault == Fault(reason=reason, where="hello: ref-1", line=7, service="generation")


async def test_a_failure_while_running_raises_with_what_was_done(hub: MemoryHub) -> None:
    async def fail(desk: RequestDesk, request: PerformFragment) -> None:
        desk.accept(request.id)
        fault = Fault(reason="the arm is stuck")
        desk.end(FragmentOutcome(id=request.id, fragment="hello", status="failed", fault=fault))

    async with running(hub, {"generation": partial(server, seen=[], answer=fail)}), connect(hub=hub) as robot:
        with pytest.raises(PerformFailed, match="the arm is stuck") as failure:
            await robot.perform(HELLO)

    assert failure.value.outcome.status == "failed"


async def test_a_cancelled_caller_cancels_what_it_asked_for(hub: MemoryHub) -> None:
    async def never(desk: RequestDesk, request: PerformFragment) -> None:
        desk.accept(request.id)

    seen: list[object] = []
    async with running(hub, {"generation": partial(server, seen=seen, answer=never)}), connect(hub=hub) as robot:
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(robot.perform(HELLO), 1.0)
        await asyncio.sleep(0.1)

    assert [type(it) for it in seen] == [Cancel]


async def test_bad_xml_is_refused_here_and_nothing_is_sent(hub: MemoryHub, tmp_path: Path) -> None:
    file = tmp_path / "bad.xml"
    file.write_text("<ebml>\n<speech</ebml>")
    seen: list[object] = []
    async with running(hub, {"generation": partial(server, seen=seen)}), connect(hub=hub) as robot:
        with pytest.raises(InputRefused, match=r"bad\.xml"):
            await robot.perform(file)

    assert seen == []


async def test_a_lease_is_renewed_while_it_is_held_and_then_released(hub: MemoryHub) -> None:
    seen: list[object] = []
    async with (
        running(hub, {"generation": partial(server, seen=seen)}),
        connect(hub=hub) as robot,
        robot.inhibit_gaze("target", target="table", ttl=3.0),
    ):
        await asyncio.sleep(10.0)

    leases = [it for it in seen if isinstance(it, Inhibit)]
    assert [(it.mode, it.target, it.ttl) for it in leases] == [("target", "table", 3.0)]
    assert [(type(it), it.reason) for it in seen if isinstance(it, Cancel)] == [(Cancel, "released")]


NOD = '<bml id="nod"><head id="h" lexeme="NOD"/></bml>'
EBML = """<ebml:ebml xmlns:ebml="edu.wpi.ebml" xmlns="org.mindmakers.bml" id="ask" turnIndex="1" turnStatus="full">
  <speech id="please"><text>Please move</text></speech></ebml:ebml>"""


async def test_a_block_goes_past_the_policies_to_the_realizer(hub: MemoryHub, tmp_path: Path) -> None:
    async def realizer(bus: Bus, ready: Ready) -> None:
        desk = RequestDesk(bus, "realizer", lambda cancel: None)
        with bus.subscribe(*RequestDesk.patterns("realizer")) as inbox:
            ready()
            async for received in inbox:
                if isinstance(request := desk.take(received), PerformBlock):
                    followed.append(request.follows)
                    desk.accept(request.id)
                    desk.end(BlockOutcome(id=request.id, block=request.block.id, status="done"))

    followed: list[tuple[str, ...]] = []
    async with running(hub, {"realizer": realizer}), connect(hub=hub) as robot:
        outcome = await robot.realize(Block(id="wave"))
        await robot.realize(Block(id="wave"), follows=["one", "two"])
        assert followed == [(), ("one", "two")]
        again = await robot.realize("wave", HELLO.behaviors)  # type: ignore[arg-type]
        (tmp_path / "nod.xml").write_text(NOD)
        for source in (tmp_path / "nod.xml", NOD, NOD.encode()):
            assert (await robot.realize(source)).block == "nod"
        for wrong, why in (
            ("nod.xml", "neither XML nor JSON"),
            (tmp_path / "no.xml", "No such file"),
            (EBML, "use `perform`"),
        ):
            with pytest.raises(InputRefused, match=why):
                await robot.realize(wrong)

    assert (outcome.block, outcome.status) == ("wave", "done")
    assert again.status == "done"


async def test_one_behavior_of_a_block_is_interrupted_by_its_name(hub: MemoryHub) -> None:
    async def realizer(bus: Bus, ready: Ready) -> None:
        desk = RequestDesk(bus, "realizer", lambda cancel: None)
        with bus.subscribe(*RequestDesk.patterns("realizer")) as inbox:
            ready()
            async for received in inbox:
                match desk.take(received):
                    case InterruptBehavior(id=id, block="wave", behavior=behavior):
                        desk.end(BehaviorInterrupted(id=id, block="wave", behavior=behavior, spoken="Hello"))
                    case InterruptBehavior(id=id, block=block):
                        desk.refuse(id, Fault(reason="it is not being performed", where=block))

    async with running(hub, {"realizer": realizer}), connect(hub=hub) as robot:
        outcome = await robot.interrupt("wave", "speech-1")
        with pytest.raises(InputRefused, match="nod: it is not being performed"):
            await robot.interrupt("nod", "head-1")

    assert (outcome.behavior, outcome.spoken, outcome.was_done) == ("speech-1", "Hello", False)


async def test_connection_events_come_from_the_moment_they_are_asked_for(hub: MemoryHub) -> None:
    recognition = hub.join("recognition")
    event = ConnectionEvent(
        id="event-1", kind="directed_gaze", initiator="robot", responder="human", state="started",
        at=Stamp("loop", 0.0), started=Stamp("loop", 0.0), objects=("rectangle",), cause="reference",
    )  # fmt: skip
    async with connect(hub=hub) as robot:
        with robot.connection_events() as events:
            recognition.publish(keys.connection_event("human", event.kind), event)

            assert await events.next() == event
            assert await events.next(timeout=1.0) is None


async def test_iterating_ends_when_the_client_leaves(hub: MemoryHub) -> None:
    async with connect(hub=hub) as robot:
        events = robot.connection_events()

    assert [event async for event in events] == []


async def test_a_manager_may_wait_for_a_person(hub: MemoryHub) -> None:
    perception = hub.join("simulation")
    perception.publish(keys.WORLD, World(entities=(Entity(id="cup", kind="object", position=(0.5, 0.0, 0.7)),)))
    anna = Entity(id="anna", kind="person", position=(1.3, 0.0, 1.2))
    asyncio.get_running_loop().call_later(30.0, perception.publish, keys.WORLD, World(entities=(anna,)))

    async with connect(hub=hub) as robot:
        with pytest.raises(NoReply, match="no person in the world within 5 s"):
            await robot.person(timeout=5)
        assert await robot.person() == anna

    assert asyncio.get_running_loop().time() == 30.0


async def test_world_and_statistics_are_what_was_last_said(hub: MemoryHub) -> None:
    world = World(entities=(Entity(id="cup", kind="object", position=(0.5, 0.0, 0.7)),))
    statistics = Statistics(
        actor="human",
        at=Stamp("loop", 0.0),
        session=WindowStatistics(events=97, mtbce=5.7),
        recent=WindowStatistics(),
    )
    hub.join("simulation").publish(keys.WORLD, world)
    hub.join("recognition").publish(keys.statistics("human"), statistics)

    async with connect(hub=hub) as robot:
        assert await robot.world() == world
        assert await robot.statistics("human") == statistics
        with pytest.raises(NoReply, match="no statistics of all within 2 s"):
            await robot.statistics(timeout=2)


async def test_a_tool_call_is_performed_under_a_name_of_its_own(hub: MemoryHub) -> None:
    seen: list[object] = []
    call = {"turn_status": "full", "parts": [{"say": "Hello"}, {"refer": "cup"}]}
    async with running(hub, {"generation": partial(server, seen=seen)}), connect(hub=hub, name="model") as robot:
        await robot.perform(call)
        await robot.perform(msgspec.json.encode(call))

    ids = [fragment.id for fragment in seen if isinstance(fragment, TurnFragment)]
    assert len(set(ids)) == 2
    assert all(id.startswith("model-") for id in ids)


async def test_an_answer_is_awaited_where_a_turn_ends_and_belongs_to_its_outcome(hub: MemoryHub) -> None:
    def pair(id: str, state: str) -> ConnectionEvent:
        at = Stamp("loop", 0.0)
        return ConnectionEvent(
            id=id, kind="adjacency_pair", initiator="robot", responder="ann", state=state, at=at, started=at,  # type: ignore[arg-type]
        )  # fmt: skip

    async def later(bus: Bus) -> None:
        for delay, id in ((0.0, "ap-0"), (3.0, "ap-1")):  # the first of an earlier turn of that name
            await asyncio.sleep(delay)
            closed = TurnClosed(
                turn="hello", addressee="ann", status="done", fragments=("hello",), events=(pair(id, "succeeded"),)
            )
            bus.publish(keys.TURN_CLOSED, closed)

    async def answer(desk: RequestDesk, request: PerformFragment) -> None:
        desk.accept(request.id)
        events = (pair("ap-1", "started"),)
        desk.end(FragmentOutcome(id=request.id, fragment="hello", status="done", events=events))

    bus = hub.join("generation-too")
    async with running(hub, {"generation": partial(server, seen=[], answer=answer)}), connect(hub=hub) as robot:
        asking = asyncio.create_task(later(bus))
        at_once = await robot.perform(HELLO)
        begun = await robot.perform(replace(HELLO, turn_status="beginning"), await_answer=True)
        assert asyncio.get_running_loop().time() == 0.0
        answered = await robot.perform(HELLO, await_answer=True)
        await asking

    assert [outcome.events[0].state for outcome in (at_once, begun, answered)] == ["started", "started", "succeeded"]
    assert asyncio.get_running_loop().time() == 3.0


async def test_an_answer_that_nobody_tells_of_is_not_awaited_for_ever(hub: MemoryHub) -> None:
    async with running(hub, {"generation": partial(server, seen=[])}), connect(hub=hub) as robot:
        outcome = await robot.perform(HELLO, await_answer=True)

    assert outcome.status == "done"
    assert asyncio.get_running_loop().time() == ANSWER_PATIENCE


@pytest.mark.parametrize(
    "source", ["\udcff", {"turn_status": "full", "parts": [{"say": "\udcff"}]}, {"parts": object()}]
)
async def test_what_cannot_be_written_down_is_refused(hub: MemoryHub, source: object) -> None:
    async with connect(hub=hub) as robot:
        with pytest.raises(InputRefused):
            await robot.perform(source)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("missing.xml", None, "No such file"),
        ("block.xml", '<bml id="b"><wait id="w" duration="1"/></bml>', "a BML block, not a turn fragment"),
        (
            "two.json",
            '[{"id": "a", "behaviors": []}, {"id": "b", "behaviors": []}]',
            "2 things, not one turn fragment",
        ),
    ],
)
async def test_a_file_that_holds_no_fragment_is_refused_by_its_name(
    hub: MemoryHub, tmp_path: Path, name: str, text: str | None, reason: str
) -> None:
    file = tmp_path / name
    if text is not None:
        file.write_text(text)
    async with connect(hub=hub) as robot:
        with pytest.raises(InputRefused, match=reason) as refused:
            await robot.perform(file)

    assert name in refused.value.fault.where
