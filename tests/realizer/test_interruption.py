"""Ending one behavior of a block on request: the others go on, and the words that were said are told."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Event, Gaze, GazeShift, Gesture, Head, Mark, Pointing, Speech, Wait
from engage_hri.schemas.blocks import BehaviorInterrupted, Block, BlockOutcome
from engage_hri.schemas.body import GoHome, RobotState
from engage_hri.schemas.world import World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.service import embody
from engage_hri.services.control.testing import WORLD
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.requests.ends import Pending, Requester, RequestRefused
from engage_hri.services.runtime.service import running
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import FakeRecognition, Stage, after, block, stage, together
from tests.realizer.steering import interrupt

BEAT = Gesture(id="beat", lexeme="BEAT", mode="RIGHT_HAND")
"""Takes 2.25 s: 0.5, 0.25, 0.5, 0.25, 0.25, 0.5."""
STORY = Speech(id="s", text="one two three", marks=(Mark("m1", 3), Mark("m2", 7)))
"""A second to each mark."""


def ask(seen: Stage, behavior: str, block: str = "b") -> Pending:
    return interrupt(seen.requests, block, behavior)


async def interrupted(seen: Stage, behavior: str) -> BehaviorInterrupted:
    outcome = await ask(seen, behavior).outcome
    assert isinstance(outcome, BehaviorInterrupted)
    return outcome


async def test_the_behavior_ends_and_the_block_goes_on_to_be_done() -> None:
    async with stage() as seen:
        performing = seen.ask(block((BEAT, STORY)))
        await seen.seen("beat:stroke_start")
        answer = await interrupted(seen, "beat")
        outcome = await performing.outcome

    assert (answer.block, answer.behavior, answer.was_done) == ("b", "beat", False)
    assert isinstance(outcome, BlockOutcome)
    assert (outcome.status, outcome.interrupted, outcome.dropped) == ("done", ("beat",), ())
    assert list(seen.times()) == ["beat:start", "s:start", "beat:ready", "beat:stroke_start", "s:m1", "s:m2", "s:end"]
    told = [(each.kind, each.behavior, each.message) for each in seen.warnings()]
    assert told == [("INTERRUPTED", "beat", "stopped on request")]


async def test_what_waited_for_it_waits_no_longer() -> None:
    waiting = Pointing(id="p", target="a", mode="LEFT_HAND")
    async with stage() as seen:
        performing = seen.ask(block((BEAT, waiting), after("beat:end", "p:start")))
        await seen.seen("beat:ready")
        await interrupted(seen, "beat")
        await performing.outcome

    assert seen.times()["p:start"] == seen.times()["beat:ready"] == 0.5


async def test_a_stroke_under_way_is_not_cut_though_nothing_is_tied_to_it_any_more() -> None:
    one, other = (Gesture(id=id, lexeme="BEAT", mode="RIGHT_HAND") for id in ("g", "h"))
    waits = [Wait(id="w", duration=3.0), Wait(id="v", duration=0.25)]
    async with stage() as seen:
        pending = seen.ask(block((*waits, one, other), together("w:end", "g:relax"), after("v:end", "h:start")))
        await asyncio.sleep(0.8)
        await interrupted(seen, "w")
        outcome = await pending.outcome

    assert isinstance(outcome, BlockOutcome)
    assert outcome.dropped == ()
    assert seen.times()["g:stroke_end"] == seen.times()["h:start"] == 1.5


async def test_a_required_behavior_may_be_interrupted_and_its_block_does_not_fail() -> None:
    needed = Gesture(id="beat", lexeme="BEAT", required=True)
    async with stage() as seen:
        performing = seen.ask(block((needed, STORY)))
        await seen.seen("beat:ready")
        await interrupted(seen, "beat")
        outcome = await performing.outcome

    assert isinstance(outcome, BlockOutcome)
    assert (outcome.status, outcome.fault) == ("done", None)


async def test_what_has_not_begun_never_does() -> None:
    async with stage() as seen:
        performing = seen.ask(block((BEAT, STORY), after("s:end", "beat:start")))
        await seen.seen("s:m1")
        await interrupted(seen, "beat")
        await performing.outcome

    assert list(seen.times()) == ["s:start", "s:m1", "s:m2", "s:end"]


@pytest.mark.parametrize("waits", [Wait(id="w", duration=60.0), Event(id="w", kind="backchannel", responder="human")])
async def test_waiting_ends_at_once(waits: Wait | Event) -> None:
    async with stage(recognition=FakeRecognition({"w": None})) as seen:
        performing = seen.ask(block((waits, STORY), after("w:end", "s:start")))
        await seen.seen("w:start")
        await interrupted(seen, "w")
        outcome = await performing.outcome

    assert isinstance(outcome, BlockOutcome)
    assert (outcome.status, outcome.interrupted) == ("done", ("w",))
    assert (seen.times()["s:start"], seen.times()["s:end"]) == (0.0, 3.0)
    assert seen.recognition.cancelled == [each.id for each in seen.recognition.events]  # nobody looks out for it now


@pytest.mark.parametrize("behavior", ["x", "s"])
async def test_what_is_not_or_no_longer_performed_cannot_be_interrupted(behavior: str) -> None:
    async with stage() as seen:
        performing = seen.ask(block((STORY, Wait(id="w", duration=5.0))))
        await seen.seen("s:end")
        with pytest.raises(RequestRefused, match=f"b: {behavior}: it is not being performed"):
            await ask(seen, behavior).outcome
        with pytest.raises(RequestRefused, match=f"other: {behavior}2: it is not being performed"):
            await ask(seen, f"{behavior}2", block="other").outcome
        await performing.outcome

    assert seen.warnings() == []


async def test_a_body_that_does_not_answer_is_given_up_after_a_while() -> None:
    deaf = FakeBody({"beat": Script(stall="stroke", deaf=True)})
    async with stage(deaf) as seen:
        performing = seen.ask(block((BEAT, STORY)))
        await seen.seen("beat:stroke_start")
        asking = ask(seen, "beat")
        outcome = await performing.outcome
        answer = await asking.outcome

    assert isinstance(answer, BehaviorInterrupted)
    assert isinstance(outcome, BlockOutcome)
    assert (outcome.status, outcome.interrupted) == ("done", ("beat",))


class Live:
    """A realizer with the simulated torso. states: what the body shows."""

    def __init__(self, seen: Stage) -> None:
        self.seen = seen
        self.states: list[RobotState] = []
        self.sent_home: list[GoHome] = []


@asynccontextmanager
async def live(world: World = WORLD) -> AsyncIterator[Live]:
    hub = MemoryHub()
    eyes = hub.join("simulation")
    eyes.publish(keys.WORLD, world)
    services = {
        "control": partial(embody, config=ControlConfig()),
        "realizer": partial(realize, config=RealizerConfig()),
    }
    async with running(hub, services):
        bus = hub.join("test")
        async with Requester(bus) as requests:
            seen = Live(Stage(hub, FakeBody(), FakeRecognition(), requests))
            listening = asyncio.create_task(_listen(bus, seen))
            try:
                yield seen
            finally:
                listening.cancel()
                await asyncio.gather(listening, return_exceptions=True)
        await bus.leave()
    await eyes.leave()


async def _listen(bus, seen: Live) -> None:  # type: ignore[no-untyped-def]
    with bus.subscribe(keys.FEEDBACK, keys.ROBOT_STATE, keys.BEHAVIOR) as inbox:
        async for received in inbox:
            match received.message:
                case RobotState() as state:
                    seen.states.append(state)
                case GoHome() as home:
                    seen.sent_home.append(home)
                case feedback:
                    seen.seen.feedback.append(feedback)
                    seen.seen.news.set()


async def test_speech_ends_at_a_word_and_the_words_are_told() -> None:
    text = "Please take the large red triangle"
    async with live() as robot:
        performing = robot.seen.ask(block((Speech(id="s", text=text), Gaze(id="g", target="human"))))
        await robot.seen.seen("s:start")
        await asyncio.sleep(1.0)
        answer = await interrupted(robot.seen, "s")
        outcome = await performing.outcome

    assert isinstance(outcome, BlockOutcome)
    assert "" != answer.spoken != text
    assert text.startswith(f"{answer.spoken} ")
    assert [(each.text, each.complete) for each in outcome.spoken] == [(answer.spoken, False)]
    assert robot.seen.warnings()[0].message == f"stopped on request, after {answer.spoken!r}"
    assert outcome.status == "done"


async def test_a_gesture_relaxes_and_a_nod_leaves_the_gaze_alone() -> None:
    shift = Block(id="base", behaviors=(GazeShift(id="shift", target="far-left"),))
    nods = Head(id="nods", lexeme="NOD", repetition=4)
    async with live() as robot:
        await robot.seen.perform(shift)
        performing = robot.seen.ask(block((Gaze(id="g", target="human"), nods, BEAT, Wait(id="w", duration=6.0))))
        await robot.seen.seen("nods:stroke")
        before = len(robot.states)
        await asyncio.gather(interrupted(robot.seen, "nods"), interrupted(robot.seen, "beat"))
        await asyncio.sleep(3.0)
        looks = {state.looking_at for state in robot.states[before:]}
        outcome = await performing.outcome
        await asyncio.sleep(2.0)

    assert isinstance(outcome, BlockOutcome)
    assert (outcome.status, set(outcome.interrupted)) == ("done", {"nods", "beat"})
    assert looks == {"human"}
    assert robot.states[-1].looking_at == "far-left"
    assert robot.sent_home == []
    assert arm(robot.states[-1]) == pytest.approx(arm(robot.states[0]))


def arm(state: RobotState) -> list[float]:
    return [each.angle for each in state.pose.joints if each.joint.startswith("right_")]
