"""Control on the bus: requests in, sync points, actions and states out, and home by itself when nobody directs it."""

import asyncio
from typing import Any

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Emit, Gaze, GazeShift, Head, Mark, Pointing, Speech, Wait
from engage_hri.schemas.body import (
    AbortBehavior,
    BehaviorOutcome,
    Capabilities,
    DescribeBody,
    EstimateBehaviors,
    EstimateItem,
    Estimates,
    GoHome,
    HomeReached,
    PerformBehavior,
    RobotState,
    SyncPointArrived,
    SyncPointReached,
    WordSpoken,
)
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.requests import Outcome
from engage_hri.schemas.world import World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import Displaced, Slow, Variability
from engage_hri.services.control.testing import WORLD
from engage_hri.services.control.testing.motions import STEP
from engage_hri.services.requests.ends import RequestRefused
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop
from tests.commanding import command
from tests.control.directing import robot, tip

POINT = Pointing(id="point-1", target="near-right")


async def test_a_behavior_goes_from_request_to_outcome(hub: MemoryHub):
    async with robot(hub) as client:
        await asyncio.sleep(1.0)
        pending = client.perform(POINT)
        await pending.accepted
        outcome = await client.outcome(pending)
        answer = await client.bus.query(keys.ESTIMATE, EstimateBehaviors(items=(EstimateItem(behavior=POINT),)))

    assert isinstance(answer, Estimates)
    at = client.reached("point-1")
    assert list(at) == ["start", "ready", "stroke_start", "stroke", "stroke_end", "relax", "end"]
    assert at["start"] == 1.0
    for phase in answer.items[0].phases:
        assert at[phase.to] - at[phase.since] == pytest.approx(phase.natural)
    assert (outcome.status, outcome.block, outcome.behavior) == ("done", "block-1", "point-1")
    assert outcome.at.seconds == at["end"]


async def test_a_covered_object_is_pointed_at_where_it_was_and_one_that_has_gone_is_not(hub: MemoryHub):
    without = World(entities=tuple(one for one in WORLD.entities if one.id != POINT.target))
    async with robot(hub) as client:
        client.bus.publish(keys.WORLD, without)
        await asyncio.sleep(9.0)
        outcome = await client.outcome(client.perform(POINT))
        await asyncio.sleep(2.0)
        client.bus.publish(keys.WORLD, without)
        with pytest.raises(RequestRefused, match="near-right"):
            await client.perform(Pointing(id="point-2", target="near-right")).outcome

    assert outcome.status == "done"


async def test_it_holds_until_its_authority_is_extended(hub: MemoryHub):
    async with robot(hub) as client:
        pending = client.perform(POINT, "start")
        await asyncio.sleep(5.0)
        held = [item.sync for item in client.of(SyncPointArrived)]
        client.perform(POINT, "stroke_start")
        await asyncio.sleep(5.0)
        client.perform(POINT, "end")
        await client.outcome(pending)

    assert held == ["stroke_start"]
    assert [item.sync for item in client.of(SyncPointArrived)] == ["stroke_start", "stroke_end"]
    assert client.reached("point-1")["stroke_start"] == 5.0
    assert client.reached("point-1")["stroke_end"] == 10.0
    stroke_start = next(item for item in client.of(SyncPointReached) if item.sync == "stroke_start")
    assert stroke_start.arrived == client.of(SyncPointArrived)[0].at


async def test_speech_reports_its_words_and_marks(hub: MemoryHub):
    async with robot(hub) as client:
        speech = Speech(id="speech-1", text="Please move this.", marks=(Mark("m", 12),))
        outcome = await client.outcome(client.perform(speech))

    assert [(item.word, item.position) for item in client.of(WordSpoken)] == [
        ("Please", 6),
        ("move", 11),
        ("this.", 17),
    ]
    assert list(client.reached("speech-1")) == ["start", "m", "end"]
    assert outcome.spoken == "Please move this."


async def test_an_abort_ends_the_request_and_tells_what_was_said(hub: MemoryHub):
    async with robot(hub) as client:
        pending = client.perform(Speech(id="speech-1", text="one two three four five"))
        await asyncio.sleep(0.5)
        client.requests.send(keys.BEHAVIOR, AbortBehavior(id="stop", block="block-1", behavior="speech-1"))
        outcome = await client.outcome(pending)

    assert outcome.status == "aborted"
    assert outcome.spoken == "one two"
    assert "end" not in client.reached("speech-1")


async def test_an_abort_of_what_is_unknown_is_refused(hub: MemoryHub):
    async with robot(hub) as client:
        pending = client.requests.send(keys.BEHAVIOR, AbortBehavior(id="stop", block="never", behavior="b"))

        with pytest.raises(RequestRefused, match="no such behavior"):
            await pending.outcome


async def test_a_cancelled_request_ends_as_aborted(hub: MemoryHub):
    async with robot(hub) as client:
        pending = client.perform(POINT, "start")
        await asyncio.sleep(2.0)
        client.requests.cancel("block-1/point-1")

        assert (await client.outcome(pending)).status == "aborted"


@pytest.mark.parametrize(
    ("behavior", "through", "reason"),
    [
        (Gaze(id="g", target="nobody"), "end", "no 'nobody'"),
        (Emit(id="e", event="x"), "end", "no emit"),
        (Wait(id="w", duration=1.0), "stroke", "no sync point 'stroke'"),
    ],
)
async def test_a_bad_request_is_refused_and_the_next_is_served(
    hub: MemoryHub, behavior: object, through: str, reason: str
):
    async with robot(hub) as client:
        with pytest.raises(RequestRefused, match=reason):
            await client.perform(behavior, through).accepted

        assert (await client.outcome(client.perform(POINT))).status == "done"


async def test_a_bad_extension_is_a_fault_and_changes_nothing(hub: MemoryHub):
    async with robot(hub) as client:
        pending = client.perform(POINT, "start")
        await asyncio.sleep(1.0)
        client.perform(POINT, "stork")
        await asyncio.sleep(1.0)
        client.perform(POINT, "end")

        assert (await client.outcome(pending)).status == "done"
        assert [item.where for item in client.of(Fault)] == ["point-1"]


async def test_a_later_gaze_takes_the_head_and_the_earlier_ends_with_the_points_it_has_passed(hub: MemoryHub):
    async with robot(hub) as client:
        one = client.perform(Gaze(id="one", target="near-right"), "start")
        await asyncio.sleep(2.0)
        other = client.perform(Gaze(id="other", target="human"), "end")
        outcomes = [await client.outcome(one), await client.outcome(other)]

    assert [outcome.status for outcome in outcomes] == ["taken_over", "done"]
    assert [outcome.passed for outcome in outcomes] == ["stroke_start", "end"]
    assert outcomes[0].at.seconds == 2.0
    assert list(client.reached("one")) == ["start", "ready", "stroke_start"]


async def test_actions_follow_from_real_motion(hub: MemoryHub):
    async with robot(hub) as client:
        await client.outcome(client.perform(GazeShift(id="base", target="human")))
        arrival = client.reached("base")["end"]
        await client.outcome(client.perform(Gaze(id="gaze", target="near-right")))
        await client.outcome(client.perform(POINT))
        await client.outcome(client.perform(Head(id="head", lexeme="NOD")))
        await client.outcome(client.perform(Speech(id="speech", text="hello")))

    gaze, point = client.reached("gaze"), client.reached("point-1")
    head, speech = client.reached("head"), client.reached("speech")
    assert client.actions() == [
        ("began", "look", ("human",), arrival),
        ("ended", "look", ("human",), gaze["start"]),
        ("began", "look", ("near-right",), gaze["stroke"]),
        ("ended", "look", ("near-right",), gaze["relax"]),
        ("began", "look", ("human",), gaze["end"]),
        ("began", "point", ("near-right",), point["stroke_start"]),
        ("ended", "point", ("near-right",), point["stroke_end"]),
        ("began", "nod", (), head["stroke_start"]),
        ("ended", "nod", (), head["stroke_end"]),
        ("began", "speak", (), speech["start"]),
        ("ended", "speak", (), speech["end"]),
    ]
    began = client.of(ActionBegan)
    assert {item.actor for item in began} == {"robot"}
    assert [item.behavior for item in began] == [
        "block-1:base", "block-1:gaze", "block-1:gaze", "block-1:point-1", "block-1:head", "block-1:speech",
    ]  # fmt: skip


async def test_a_look_begins_as_it_is_on_target_though_its_stroke_waits(hub: MemoryHub):
    gaze = Gaze(id="gaze", target="near-right")
    async with robot(hub) as client:
        pending = client.perform(gaze, "start")
        await asyncio.sleep(2.0)
        client.perform(gaze, "end")
        await client.outcome(pending)

    arrived = next(item for item in client.of(SyncPointArrived) if item.sync == "stroke")  # type: ignore[attr-defined]
    assert arrived.at.seconds < client.reached("gaze")["stroke"] == 2.0  # type: ignore[attr-defined]
    assert client.actions() == [
        ("began", "look", ("near-right",), arrived.at.seconds),  # type: ignore[attr-defined]
        ("ended", "look", ("near-right",), 2.0),
    ]


async def test_an_action_ends_with_an_aborted_behavior(hub: MemoryHub):
    async with robot(hub) as client:
        pending = client.perform(POINT, "stroke")
        await asyncio.sleep(3.0)
        client.requests.cancel("block-1/point-1")
        await client.outcome(pending)

    assert [(what, action) for what, action, _, _ in client.actions()] == [("began", "point"), ("ended", "point")]
    assert client.actions()[-1][3] == 3.0


async def test_it_tells_what_it_can_do(hub: MemoryHub):
    async with robot(hub) as client:
        answer = await client.bus.query(keys.DESCRIBE, DescribeBody())
        with pytest.raises(InputRefused, match="expected EstimateBehaviors"):
            await client.bus.query(keys.ESTIMATE, DescribeBody())

    assert isinstance(answer, Capabilities)
    assert {"gaze", "gazeShift", "pointing", "gesture", "head", "speech", "posture", "wait"} <= set(answer.types)
    assert {joint.part for joint in answer.joints} == {"head", "torso", "left_arm", "right_arm", "face"}


async def test_it_goes_home_on_request(hub: MemoryHub):
    async with robot(hub) as client:
        behavior = client.perform(POINT, "start")
        await asyncio.sleep(2.0)
        home = client.requests.send(keys.BEHAVIOR, GoHome(id="home-1", requester="realizer"))
        outcome: Outcome = await home.outcome

        assert isinstance(outcome, HomeReached)
        assert (await client.outcome(behavior)).status == "aborted"
        assert outcome.at.seconds > 2.0
        assert tip(client)[2] == pytest.approx(0.8, abs=1e-3)


async def test_it_goes_home_by_itself_when_the_realizer_dies(hub: MemoryHub):
    async with robot(hub) as client:
        watcher = hub.join("watcher")
        states = watcher.subscribe(keys.ROBOT_MOTION)
        client.perform(POINT, "stroke")
        await asyncio.sleep(3.0)
        hub.kill("realizer")
        await asyncio.sleep(5.0)
        tips = {}
        while len(states):
            received = await states.next()
            assert received is not None
            assert isinstance(received.message, RobotState)
            tips[received.message.at.seconds] = received.message.right_arm.tip
        states.close()

    in_the_air = [at for at, there in tips.items() if there is not None and abs(there[2] - 0.8) > 1e-3]
    assert 5.0 <= max(in_the_air) < 6.0  # the grace of 2 s, and the way home


async def test_it_goes_home_by_itself_when_commands_stop_in_mid_behavior(hub: MemoryHub):
    async with robot(hub) as client:
        request = PerformBehavior(id="once", requester="stranger", block="b", behavior=POINT, through="stroke")
        command(client.bus, keys.BEHAVIOR, request)
        await asyncio.sleep(4.9)
        before = tip(client)
        await asyncio.sleep(3.0)

        assert before[2] < 0.79
        assert tip(client)[2] == pytest.approx(0.8, abs=1e-3)
        assert [item.status for item in client.of(BehaviorOutcome)] == ["lapsed"]


async def test_repeated_requests_keep_a_held_behavior_alive(hub: MemoryHub):
    async with robot(hub) as client:
        client.perform(POINT, "stroke")
        await asyncio.sleep(60.0)

        assert tip(client)[2] < 0.79


async def test_a_failure_is_an_outcome_with_its_reason(hub: MemoryHub):
    async with robot(hub, variability=Variability(overheated=("right_arm",))) as client:
        outcome = await client.outcome(client.perform(POINT))

    assert outcome.status == "failed"
    assert outcome.fault is not None
    assert "overheated" in outcome.fault.reason


async def test_lost_messages_never_lose_an_outcome(hub: MemoryHub):
    async with robot(hub, variability=Variability(lost=0.5, seed=4)) as client:
        outcome = await client.outcome(client.perform(POINT))

    assert outcome.status == "done"
    assert 0 < len(client.reached("point-1")) < 7


async def test_two_behaviors_of_the_same_name_in_two_blocks_are_two(hub: MemoryHub):
    async with robot(hub) as client:
        one = client.perform(Wait(id="w", duration=1.0), block="one")
        other = client.perform(Wait(id="w", duration=2.0), block="two")
        outcomes = [await client.outcome(one), await client.outcome(other)]

    assert [(outcome.block, outcome.at.seconds) for outcome in outcomes] == [("one", 1.0), ("two", 2.0)]


async def test_a_slow_arm_and_a_near_one_are_told_by_configuration(hub: MemoryHub):
    """Thesis, Figs 4.6 and 4.7."""
    natural = await ready_after(hub, Variability())
    slow = await ready_after(hub, Variability(slow=(Slow(part="right_arm", factor=4.0),)))
    near = (Displaced(joint="right_shoulder_pitch", angle=25.0), Displaced(joint="right_elbow", angle=80.0))
    early = await ready_after(hub, Variability(displaced=near))

    assert slow == pytest.approx(4 * natural)
    assert early < natural - STEP


async def ready_after(hub: MemoryHub, variability: Variability) -> float:
    await asyncio.sleep(keys.HISTORY_MAX_AGE + 0.1)  # or the messages of the robot before come again
    async with robot(hub, variability=variability) as client:
        await client.outcome(client.perform(POINT))
    at = client.reached("point-1")
    return at["ready"] - at["start"]


class SparseLoop(VirtualTimeLoop):
    """As uvloop does it: what is due already becomes a plain handle, which knows no time."""

    def call_at(self, when: float, callback: Any, *args: Any, context: Any = None) -> Any:
        if when <= self.time():
            return self.call_soon(callback, *args, context=context)
        return super().call_at(when, callback, *args, context=context)


def test_it_serves_on_a_loop_whose_overdue_timers_know_no_time():
    async def main() -> str:
        async with MemoryHub() as hub, robot(hub) as client:
            await asyncio.sleep(1.5)
            outcome = await client.outcome(client.perform(Gaze(id="gaze-1", target="near-right")))
            return str(outcome.status)

    with asyncio.Runner(loop_factory=SparseLoop) as runner:
        assert runner.run(main()) == "done"
