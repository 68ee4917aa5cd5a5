"""How long a look takes depends on what was looked at before it."""

import asyncio
from itertools import pairwise

from engage_hri.schemas.behaviors import After, BlockBehavior, Constraint, Gaze, Gesture, Pointing, Speech, Timing
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import BodyPose, Estimate, JointAngle, Phase
from engage_hri.schemas.faults import Fault
from engage_hri.services.control.config import Variability
from engage_hri.services.realizer.plan.agreement import poses_before
from engage_hri.services.realizer.plan.planner import plan_block
from tests.realizer.fake_body import FakeBody
from tests.realizer.planning import timed
from tests.realizer.stage import after, block, stage
from tests.realizer.test_simulated_body import robot


def estimate(behavior: str, *points: str, pan: float = 0.0) -> Estimate:
    phases = tuple(
        Phase(since=a, to=b, shortest=0.5, natural=0.5, hold=b in ("relax", "stroke_start", "stroke_end"))
        for a, b in pairwise(points)
    )
    pose = BodyPose(joints=(JointAngle("pan", pan),))
    return Estimate(behavior=behavior, feasible=True, phases=phases, pose_after=pose)


ALL = ("start", "ready", "stroke_start", "stroke", "stroke_end", "relax", "end")


def test_each_gaze_but_the_first_starts_from_the_one_before_it() -> None:
    example = Block(
        id="b",
        behaviors=(
            Gaze(id="third", target="c"),
            Gaze(id="first", target="a"),
            Gaze(id="second", target="b"),
            Pointing(id="point", target="a"),
            Speech(id="speech", text="this"),
        ),
        constraints=(
            Constraint(operators=(After(ref="first:stroke", syncs=("second:start",)),)),
            Constraint(operators=(After(ref="second:stroke", syncs=("third:start",)),)),
        ),
    )
    estimates = (
        estimate("third", *ALL, pan=3.0),
        estimate("first", *ALL, pan=1.0),
        estimate("second", *ALL, pan=2.0),
        estimate("point", *ALL, pan=9.0),
        estimate("speech", "start", "end"),
    )

    before = poses_before(plan_block(example, estimates))

    assert {id: pose.joints[0].angle for id, pose in before.items()} == {"second": 1.0, "third": 2.0}


def test_a_single_gaze_starts_from_where_the_body_is() -> None:
    example = Block(id="b", behaviors=(Gaze(id="look", target="a"),))

    assert poses_before(plan_block(example, (estimate("look", *ALL),))) == {}


async def test_a_gesture_that_names_no_hand_is_performed_with_the_free_one() -> None:
    behaviors = (
        Pointing(id="p", target="a", mode="RIGHT_HAND", timing=(Timing("start", "0"), Timing("end", "5"))),
        Gesture(id="q", lexeme="BEAT", timing=(Timing("start", "2"), Timing("end", "7"))),
    )
    async with stage() as seen:
        outcome = await seen.perform(block(behaviors))

    times = seen.times()
    assert outcome.dropped == ()
    assert (times["p:start"], times["p:end"], times["q:start"], times["q:end"]) == (0.0, 5.0, 2.0, 7.0)


class OneArmed(FakeBody):
    """Reaches nothing with its left arm."""

    def estimate(self, behavior: BlockBehavior) -> Estimate:
        if isinstance(behavior, Pointing | Gesture) and behavior.mode == "LEFT_HAND":
            return Estimate(behavior=behavior.id, feasible=False, fault=Fault(reason="out of reach"))
        return super().estimate(behavior)


async def test_a_gesture_waits_for_its_arm_if_the_free_one_does_not_reach() -> None:
    behaviors = (
        Pointing(id="p", target="a", mode="RIGHT_HAND", timing=(Timing("start", "0"), Timing("end", "5"))),
        Pointing(id="q", target="b"),
        Speech(id="s", text="this"),
    )
    async with stage(OneArmed()) as seen:
        outcome = await seen.perform(block(behaviors, after("s:end", "q:start")))

    assert outcome.dropped == ()
    assert seen.warnings() == []
    assert seen.times()["q:start"] == seen.times()["p:end"] == 5.0


async def test_a_gesture_without_time_to_wait_for_its_arm_is_dropped_if_the_free_one_does_not_reach() -> None:
    behaviors = (
        Pointing(id="p", target="a", mode="RIGHT_HAND", timing=(Timing("start", "0"), Timing("end", "5"))),
        Pointing(id="q", target="b", timing=(Timing("start", "2"), Timing("end", "7"))),
    )
    async with stage(OneArmed()) as seen:
        outcome = await seen.perform(block(behaviors))

    assert outcome.dropped == ("q",)
    assert [(each.kind, each.behavior) for each in seen.warnings()] == [("IMPOSSIBLE_TO_SCHEDULE", "q")]


async def test_a_gesture_is_performed_with_the_arm_that_it_is_planned_for() -> None:
    """No hand is named: the body must not choose anew as each begins, for the others are planned around its arm."""
    beats = [(0.0, Gesture(id="g", lexeme="BEAT")), (0.5, timed(Gesture(id="g", lexeme="BEAT"), start="1.2"))]
    beats.append((0.6, timed(Gesture(id="g", lexeme="BEAT"), start="1.5")))
    async with robot(Variability()) as seen:
        asked = []
        for number, (at, beat) in enumerate(beats):
            await asyncio.sleep(at - asyncio.get_running_loop().time())
            asked.append(seen.ask(block((beat,), id=f"b{number}")))
        outcomes = [await each.outcome for each in asked]

    assert [getattr(each, "status", "") for each in outcomes] == ["done", "done", "done"]
