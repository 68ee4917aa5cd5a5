"""Whole robots in which somebody is late, comes back, or uses an id again: nobody dies of it, or is told lies."""

import asyncio
from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gaze, Gesture, Pointing, Speech, Wait
from engage_hri.schemas.blocks import Block, BlockOutcome, InterruptBehavior, PerformBlock
from engage_hri.schemas.body import GoHome, PerformBehavior
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome, Inhibit, PerformFragment, TurnFragment
from engage_hri.schemas.messages import encode_json
from engage_hri.schemas.requests import Refused, Request
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.service import running
from tests.cancelling import change_mind_often, whole_robot
from tests.commanding import command
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import stage

WORDS = "one two three four five six seven"


def says(id: str = "f", text: str = WORDS) -> TurnFragment:
    return TurnFragment(id=id, turn_status="full", behaviors=(Speech(id="s", text=text),))


# -- callers that change their mind ------------------------------------------------------------------------------


async def test_after_a_cancelled_request_the_next_one_comes_to_its_end(hub: MemoryHub) -> None:
    async with whole_robot(hub) as robot:
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(robot.perform(says()), 1.0)
        await asyncio.sleep(2.0)

        outcome = await asyncio.wait_for(robot.perform(says("g", "hello")), 60.0)

    assert outcome.status == "done"


@pytest.mark.parametrize("seed", range(share_of(3)))
async def test_so_it_does_after_cancellations_of_every_kind_at_any_moment(seed: int) -> None:
    async with whole_robot() as robot:
        await change_mind_often(robot, 40, seed)


async def test_a_client_whose_listening_has_died_says_so_at_every_call(hub: MemoryHub) -> None:
    bus = hub.join("manager")
    async with Robot.on(bus) as robot:
        waiting = asyncio.create_task(robot.realize("b", [Wait(id="w")]))
        await asyncio.sleep(1.0)
        await bus.leave()
        for call in (waiting, robot.realize("c", [Wait(id="w")]), robot.perform(says())):
            with pytest.raises(Exception, match="hears nothing any more: it has left the bus"):
                await call
        for feed in (robot.connection_events, robot.turns, robot.faults, robot.worlds):
            with pytest.raises(Exception, match="hears nothing any more"):
                feed()


# -- answers that come late --------------------------------------------------------------------------------------


@pytest.mark.parametrize("cut", [0.5, 4.0, 8.0, 20.0])
async def test_a_body_that_was_cut_off_answers_late_and_the_robot_goes_on(hub: MemoryHub, cut: float) -> None:
    async with whole_robot(hub) as robot:
        block = (Pointing(id="p", target="blue-square", timing=()), Speech(id="s", text=WORDS))
        performing = asyncio.create_task(robot.realize("b", block))
        await asyncio.sleep(0.6)
        hub.partition("control")
        performing.cancel()
        await asyncio.sleep(cut)
        hub.heal()
        await asyncio.sleep(10.0)

        assert (await robot.realize("c", [Gaze(id="g", target="human"), Wait(id="w", duration=1.0)])).status == "done"


@pytest.mark.parametrize("behavior", [Gesture(id="beat", lexeme="BEAT"), Speech(id="beat", text="one two")])
async def test_a_body_deaf_to_an_abort_is_given_up_with_a_fault_and_its_late_answer_is_nobodys(
    hub: MemoryHub, behavior: Any
) -> None:
    point = "stroke" if isinstance(behavior, Gesture) else "end"
    with hub.join("ear").subscribe(keys.fault("realizer")) as faults:
        async with stage(FakeBody({"beat": Script(stall=point, deaf=True)}), hub=hub) as seen:
            for number in range(2):
                pending = seen.ask(Block(id=f"b{number}", behaviors=(behavior,)))
                await asyncio.sleep(1.0)
                seen.requests.cancel(f"r-b{number}")
                outcome = await pending.outcome
                assert isinstance(outcome, BlockOutcome)
                assert outcome.status == "interrupted"
        fault = await faults.next()

    assert fault is not None
    assert isinstance(fault.message, Fault)
    assert "control has not ended it within 5 s of its cancellation" in str(fault.message)


async def test_aborts_that_nobody_answers_leave_nothing_behind(hub: MemoryHub) -> None:
    async with stage(FakeBody({"s": Script(stall="end", deaf=True)}), hub=hub) as seen:
        for number in range(50):
            pending = seen.ask(Block(id=f"b{number}", behaviors=(Speech(id="s", text="one two"),)))
            await asyncio.sleep(1.0)
            seen.requests.cancel(f"r-b{number}")
            await pending.outcome
        await asyncio.sleep(120.0)
        before = hub.sent
        await asyncio.sleep(3600.0)

        assert hub.sent == before


async def test_what_is_accepted_is_not_sent_again(hub: MemoryHub) -> None:
    with hub.join("ear").subscribe(keys.BLOCK) as blocks:
        async with stage(hub=hub) as seen:
            await seen.perform(Block(id="b", behaviors=(Wait(id="w", duration=60.0),)))

        assert len(blocks) == 1


# -- ids that are used again -------------------------------------------------------------------------------------

FRAGMENT = PerformFragment(id="1", fragment=says())
BAD = PerformFragment(id="1", fragment=TurnFragment(id="f", turn_status="end"))
INHIBIT = Inhibit(id="1", ttl=2.0)
BLOCK = PerformBlock(id="1", block=Block(id="b", behaviors=(Speech(id="s", text=WORDS),)))
INTERRUPT = InterruptBehavior(id="1", block="b", behavior="s")
BEHAVIOR = PerformBehavior(id="1", block="x", behavior=Wait(id="w", duration=3.0), through="end")
HOME = GoHome(id="1")


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ((keys.INHIBIT, INHIBIT), (keys.FRAGMENT, FRAGMENT)),
        ((keys.INHIBIT, INHIBIT), (keys.FRAGMENT, BAD)),
        ((keys.FRAGMENT, FRAGMENT), (keys.INHIBIT, INHIBIT)),
        ((keys.BLOCK, BLOCK), (keys.BLOCK, INTERRUPT)),
        ((keys.BEHAVIOR, BEHAVIOR), (keys.BEHAVIOR, HOME)),
    ],
)
@pytest.mark.parametrize("by", ["one", "two"])
async def test_an_id_of_another_kind_or_of_somebody_else_ends_nobody(
    hub: MemoryHub, first: tuple[str, Request], second: tuple[str, Request], by: str
) -> None:
    async with whole_robot(hub) as robot:
        with hub.join("ear").subscribe(keys.ANY_REQUEST_STATE) as states:
            for (expression, request), name in zip((first, second), ("one", by), strict=True):
                key = keys.command(expression, "manager", name)
                hub.inject(key, encode_json(request), "application/json")  # type: ignore[arg-type]
                await asyncio.sleep(0.2)
            await asyncio.sleep(10.0)
            told = [each.message for each in await everything(states)]
        assert (await robot.realize("after", [Wait(id="w", duration=0.1)])).status == "done"

    refusals = [each for each in told if isinstance(each, Refused) and "is the id of a live" in each.fault.reason]
    assert [each.requester for each in refusals] == (["one"] if by == "one" else [])
    assert {each.requester for each in told if hasattr(each, "requester") and each.id == "1"} == {"one", by}  # type: ignore[union-attr]


async def test_two_clients_with_one_id_each_get_their_own_outcome(hub: MemoryHub) -> None:
    async with stage(hub=hub) as seen, Requester(hub.join("ann")) as ann, Requester(hub.join("bob")) as bob:
        hers = ann.send(
            keys.BLOCK, PerformBlock(id="1", block=Block(id="a", behaviors=(Wait(id="w", duration=2.0),)))
        )
        his = bob.send(keys.BLOCK, PerformBlock(id="1", block=Block(id="b", behaviors=(Wait(id="w", duration=1.0),))))
        outcomes = [await hers.outcome, await his.outcome]

    assert [(each.requester, each.id, each.block) for each in outcomes if isinstance(each, BlockOutcome)] == [
        ("ann", "1", "a"), ("bob", "1", "b"),
    ]  # fmt: skip
    assert seen.times("a")["w:end"] == 2.0


async def test_an_interruption_that_comes_again_is_answered_again_and_ends_no_block(hub: MemoryHub) -> None:
    async with stage(hub=hub) as seen:
        pending = seen.ask(Block(id="a", behaviors=(Pointing(id="p", target="x"), Wait(id="w", duration=9.0))))
        await asyncio.sleep(1.0)
        bus = hub.join("wizard")
        interruption = InterruptBehavior(id="i", block="a", behavior="p")
        for revision in (0, 1, 0, 2):
            command(bus, keys.BLOCK, replace(interruption, revision=revision))
        outcome = await pending.outcome

    assert isinstance(outcome, BlockOutcome)
    assert (outcome.status, outcome.interrupted) == ("done", ("p",))


# -- second lives ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pause", [0.0, 8.0])
async def test_a_manager_of_a_fixed_name_and_id_that_comes_again_is_heard_again(hub: MemoryHub, pause: float) -> None:
    lengths = []
    async with whole_robot(hub):
        for _ in range(3):
            async with connect(hub=hub, name="honest") as manager:
                began = manager.now()
                assert (await manager.perform(says("v0"))).status == "done"
                lengths.append(manager.now() - began)
            await asyncio.sleep(pause)

    assert min(lengths) > 2.0


@pytest.mark.parametrize("pause", [9.0, 21.0])
async def test_a_program_without_a_life_that_uses_its_id_again_is_heard_again_after_a_while(
    hub: MemoryHub, pause: float
) -> None:
    payload = encode_json(PerformFragment(id="1", fragment=says()))
    async with whole_robot(hub):
        with hub.join("ear").subscribe(keys.request_state("generation"), keys.FEEDBACK) as heard:
            for _ in range(2):
                hub.inject(keys.command(keys.FRAGMENT, "manager", "me"), payload, "application/json")
                await asyncio.sleep(pause)
            told = [each.message for each in await everything(heard)]

    said = [each for each in told if getattr(each, "sync", "") == "start" and getattr(each, "behavior", "") == "s"]
    assert len([each for each in told if isinstance(each, FragmentOutcome)]) == 2
    assert len(said) == (1 if pause == 9.0 else 2)


@pytest.mark.parametrize("back_after", [0.3, 1.5, None])
async def test_a_recognition_that_dies_does_not_keep_the_robot_waiting(
    hub: MemoryHub, back_after: float | None
) -> None:
    """In mid-fragment: its new life can never decide what its former life was asked."""
    config = load(settings=["simulation.human=listening"])
    services = {name: roster.service(name, config) for name in ("generation", "realizer", "control", "simulation")}
    recognition = {"recognition": roster.service("recognition", config)}
    fragment = {"turn_status": "full", "parts": [{"say": "Look at"}, {"refer": "blue-square", "certainty": "high"}]}
    async with running(hub, services), connect(hub=hub) as robot:
        async with asyncio.timeout(600.0):
            first = asyncio.create_task(_serve_until(hub, recognition, stop := asyncio.Event()))
            await robot.person()
            await robot.statistics()
            performing = asyncio.create_task(robot.perform(fragment))
            await asyncio.sleep(1.5)
            began = robot.now()
            hub.kill("recognition")
            stop.set()
            await first
            second = None
            if back_after is not None:
                await asyncio.sleep(back_after)
                second = asyncio.create_task(_serve_until(hub, recognition, again := asyncio.Event()))
            outcome = await performing
            took = robot.now() - began
            if second is not None:
                again.set()
                await second

    assert outcome.status == "done"
    assert took < 6.0


async def _serve_until(hub: MemoryHub, services: Any, stop: asyncio.Event) -> None:
    async with running(hub, services):
        await stop.wait()


async def everything(inbox: Any) -> list[Any]:
    return [await inbox.next() for _ in range(len(inbox))]
