"""What goes wrong in one request, one driver or one caller, and leaves all others as they are."""

import asyncio
import logging
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gaze, Pointing, Speech, Wait
from engage_hri.schemas.body import RobotState
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerGone
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.performing import PerformFailed
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.control.contract.body import MovementAuthority
from engage_hri.services.runtime.service import running
from tests.cancelling import whole_robot
from tests.test_lives_and_late_answers import HOME, _serve_until, everything, says

# -- what is contained -------------------------------------------------------------------------------------------


def breaking(attribute: str) -> Callable[..., Any]:
    def broken(*arguments: object, **named: object) -> Message:
        raise ZeroDivisionError(f"{attribute} broke")

    return broken


@pytest.mark.contained
@pytest.mark.parametrize(
    ("place", "what"),
    [
        ("engage_hri.services.generation.fragments.Fragments.admit", "perform"),
        ("engage_hri.services.generation.pipeline.weigh", "perform"),
        ("engage_hri.services.generation.fragments.planning", "perform"),
        ("engage_hri.services.realizer.together.planning.plan_tries", "realize"),
        ("engage_hri.services.realizer.perform.performance.Decisions", "realize"),
        ("engage_hri.services.realizer.decide.decisions.Decisions.advance", "realize"),
        ("engage_hri.services.realizer.decide.decisions.Decisions.reach", "realize"),
        ("engage_hri.services.realizer.report.Reporter.reached", "realize"),
        ("engage_hri.services.realizer.perform.behavior_run.BehaviorRun._by_body", "realize"),
        ("engage_hri.services.control.service._Control._begin", "realize"),
        ("engage_hri.services.control.serving.intake.ControlIntake._begin", "realize"),
        ("engage_hri.services.control.serving.intake.ControlIntake._report", "realize"),
        ("engage_hri.services.control.torso.body.SimulatedBody.perform", "realize"),
        ("engage_hri.services.control.torso.body.SimulatedBody.estimate", "realize"),
        ("engage_hri.services.control.torso.body.SimulatedBody.state", "realize"),
        ("engage_hri.services.recognition.events.session.Session._request", "perform"),
        ("engage_hri.services.recognition.recognizer.Recognizer.feed", "perform"),
    ],
)
async def test_a_bug_ends_one_request_and_the_next_is_served(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch, place: str, what: str
) -> None:
    async def do(robot: Robot, id: str) -> str:
        try:
            if what == "perform":
                parts = [{"say": "Look at"}, {"refer": "blue-square", "certainty": "high"}]
                return (await robot.perform({"turn_status": "full", "parts": parts})).status
            return (await robot.realize(id, [Gaze(id="g", target="human"), Speech(id="s", text="one two")])).status
        except Exception as error:
            return f"{type(error).__name__}: {error}"

    async with whole_robot(hub) as robot:
        with monkeypatch.context() as patch:
            patch.setattr(place, breaking(place.rpartition(".")[2]))
            first = await asyncio.wait_for(do(robot, "first"), 120.0)
        await asyncio.sleep(15.0)
        second = await asyncio.wait_for(do(robot, "second"), 120.0)

    assert isinstance(first, str)
    assert second == "done"


async def test_a_question_that_breaks_its_server_is_answered_with_a_fault(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    request.node.add_marker(pytest.mark.contained)
    bus = hub.join("server")
    bus.answer(keys.DESCRIBE, breaking("describe"))
    with pytest.raises(InputRefused, match="ZeroDivisionError: describe broke"):
        await hub.join("asker").query(keys.DESCRIBE, HOME)
    assert bus.health.failures == 1


@pytest.mark.parametrize("gone", ["killed", "cut"])
@pytest.mark.parametrize("how", ["cancelled", "timeout", "own error"])
async def test_who_leaves_a_lease_leaves_it_at_once_whatever_became_of_generation(
    hub: MemoryHub, gone: str, how: str
) -> None:
    async def hold(robot: Robot) -> None:
        async with robot.inhibit_gaze(ttl=5.0):
            if how == "own error":
                await asyncio.sleep(1.0)
                raise KeyError("mine")
            await asyncio.sleep(100.0)

    async with whole_robot(hub) as robot:
        holding = asyncio.create_task(hold(robot) if how != "timeout" else asyncio.wait_for(hold(robot), 1.0))
        await asyncio.sleep(0.5)
        if gone == "cut":
            hub.partition("generation")
        else:
            hub.announce(PeerGone(participant="generation"))
        await asyncio.sleep(0.5)
        if how == "cancelled":
            holding.cancel()
        began = robot.now()
        expected = {"cancelled": asyncio.CancelledError, "timeout": TimeoutError, "own error": KeyError}[how]
        with pytest.raises(expected):
            await holding
        assert robot.now() - began < 0.1
        hub.heal()


def cancelled_by_itself(*arguments: object, **named: object) -> Any:
    raise asyncio.CancelledError


@pytest.mark.contained
@pytest.mark.parametrize("method", ["perform", "estimate", "home"])
async def test_a_driver_that_is_cancelled_by_itself_ends_one_behavior(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    behaviors = [Gaze(id="g", target="human"), Speech(id="s", text="one two")]
    async with whole_robot(hub) as robot:
        with monkeypatch.context() as patch:
            patch.setattr(f"engage_hri.services.control.torso.body.SimulatedBody.{method}", cancelled_by_itself)
            for number in range(2):
                began = robot.now()
                with suppress(InputRefused, PerformFailed):
                    composition: Any = ("MERGE", "REPLACE")[number]
                    await asyncio.wait_for(robot.realize(f"b{number}", behaviors, composition=composition), 60.0)
                assert robot.now() - began < 5.0
        await asyncio.sleep(15.0)
        assert (await robot.realize("after", behaviors, composition="REPLACE")).status == "done"


async def test_a_way_home_that_never_ends_is_not_asked_for_for_ever(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def never(*arguments: object) -> None:
        await asyncio.Event().wait()

    monkeypatch.setattr("engage_hri.services.control.torso.body.SimulatedBody.home", never)
    with hub.join("ear").subscribe(keys.keep_alive("control")) as pulses:
        async with whole_robot(hub) as robot:
            for number in range(3):
                asking = robot.realize(f"b{number}", [Pointing(id="p", target="blue-square")], composition="REPLACE")
                await asyncio.wait([asyncio.ensure_future(asking)], timeout=1.0)
            await asyncio.sleep(60.0)
            await everything(pulses)
            await asyncio.sleep(60.0)
            assert not any(kept.kind == "go_home" for each in await everything(pulses) for kept in each.message.live)


@pytest.mark.parametrize(
    "call",
    [
        lambda robot: robot.realize("c", [Speech(id="s", text="half a \ud83d")]),
        lambda robot: robot.realize("c", [Speech(id="s", text=None)]),  # type: ignore[arg-type]
        lambda robot: robot.realize("c", [Wait(id="w", duration=2**70)]),
        lambda robot: robot.perform(TurnFragment(id="f", turn_status="nope")),  # type: ignore[arg-type]
        lambda robot: robot.interrupt("\ud83d", "s"),
    ],
)
async def test_what_cannot_be_sent_is_refused_and_other_requests_live_on(hub: MemoryHub, call: Any) -> None:
    async with whole_robot(hub) as robot:
        other = asyncio.create_task(robot.realize("b", [Wait(id="w", duration=20.0)]))
        await asyncio.sleep(1.0)
        with pytest.raises(InputRefused):
            await call(robot)
        assert (await other).status == "done"


@pytest.fixture
def unlogged() -> Iterator[None]:
    """What pytest could not write down, either."""
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


@pytest.mark.contained
@pytest.mark.usefixtures("unlogged")
@pytest.mark.parametrize("text", ["j\udcf6rg/beat.qi", None], ids=["surrogate", "none"])
async def test_an_error_of_a_driver_that_cannot_even_be_written_down_ends_one_behavior(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch, text: str | None
) -> None:
    class Odd(OSError):
        def __str__(self) -> str:
            return text  # type: ignore[return-value]

    def broken(*arguments: object) -> Any:
        raise Odd

    async with whole_robot(hub) as robot:
        with monkeypatch.context() as patch:
            patch.setattr("engage_hri.services.control.torso.body.SimulatedBody.perform", broken)
            with pytest.raises(PerformFailed):  # It had nothing else in it.
                await asyncio.wait_for(robot.realize("b", [Speech(id="s", text="one")]), 60.0)
        await asyncio.sleep(5.0)
        assert (await robot.realize("c", [Speech(id="s", text="one")])).spoken[0].text == "one"


async def test_a_new_life_of_a_server_leaves_what_a_client_asked_for_that_has_left(hub: MemoryHub) -> None:
    config = load(settings=["simulation.human=listening"])
    services = {name: roster.service(name, config) for name in ("realizer", "recognition", "control", "simulation")}
    generation = {"generation": roster.service("generation", config)}
    with hub.join("ear").subscribe(keys.FRAGMENT_FEEDBACK, keys.FEEDBACK) as heard:
        async with running(hub, services):
            first = asyncio.create_task(_serve_until(hub, generation, stop := asyncio.Event()))
            async with connect(hub=hub) as robot:
                await robot.person()
                assert (await robot.perform(says("f", "hello"))).status == "done"
            hub.kill("generation")
            stop.set()
            await first
            second = asyncio.create_task(_serve_until(hub, generation, again := asyncio.Event()))
            await asyncio.sleep(10.0)
            again.set()
            await second
        said = [each for each in await everything(heard) if getattr(each.message, "sync", "") == "start"]

    assert [each.message.behavior for each in said].count("s") == 1


@pytest.mark.contained
async def test_a_driver_that_breaks_as_it_is_told_to_stop_is_taken_home_all_the_same(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = MovementAuthority._tell

    def broken(authority: MovementAuthority) -> None:
        real(authority)
        if authority.revoked and authority._watchers:
            raise ZeroDivisionError("watcher broke")

    async with whole_robot(hub) as robot:
        monkeypatch.setattr(MovementAuthority, "_tell", broken)
        asking = asyncio.create_task(
            robot.realize("b", [Pointing(id="p", target="blue-square"), Wait(id="w", duration=9.0)])
        )
        await asyncio.sleep(1.0)
        hub.kill("realizer")
        await asyncio.sleep(8.0)
        state = await robot_state(hub)
        asking.cancel()
        await asyncio.gather(asking, return_exceptions=True)

    assert state.right_arm.tip is not None
    assert state.right_arm.tip[2] == pytest.approx(0.8, abs=1e-2)


async def robot_state(hub: MemoryHub) -> RobotState:
    with hub.join("camera").subscribe(keys.ROBOT_STATE) as states:
        received = await states.next()
    assert received is not None
    assert isinstance(received.message, RobotState)
    return received.message
