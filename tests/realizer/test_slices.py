"""A large block is planned a slice at a time: to the same plan, while other blocks go on, until somebody cancels."""

import asyncio
import sys
from collections.abc import Callable
from types import FrameType
from typing import TypeVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Constraint, Gaze, Speech
from engage_hri.schemas.blocks import Block, BlockOutcome
from engage_hri.schemas.body import SyncPointReached
from engage_hri.schemas.feedback import BlockProgress
from engage_hri.services.realizer.plan.known import Known
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block, plan_steps
from engage_hri.services.realizer.plan.relations import BlockRefused
from engage_hri.services.realizer.together import planning
from engage_hri.services.runtime.steps import SLICE, Steps, finished, portions
from engage_hri.services.runtime.unhurried import unhurried
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.oracle import estimate, possible_blocks, random_blocks
from tests.realizer.stage import Stage, block, stage, together
from tests.realizer.test_plan_growth import (
    Parts,
    fixed,
    hasty,
    hopeless,
    joined,
    looks,
    measured_words,
    preparing,
    references,
    rivals,
    series,
)

T = TypeVar("T")

SHAPES = [references, looks, series, measured_words, joined, fixed, hopeless, hasty, rivals, preparing]
MOST_CALLS = 25_000
"""In one slice, for 800 behaviors: five milliseconds or so."""


def large(shape: Callable[[int], Parts], size: int = 400, id: str = "large") -> Block:
    behaviors, operators = shape(size)
    return Block(id=id, behaviors=tuple(behaviors), constraints=(Constraint(operators=tuple(operators)),))


def slices(steps: Steps[T]) -> tuple[list[int], T]:
    """Functions called in each slice, as the event loop would see it; and what comes of all."""
    calls, done = [0], 0

    def counted(frame: FrameType, event: str, argument: object) -> None:
        calls[-1] += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(counted)
    try:
        while True:
            done += next(steps)
            if done >= SLICE:
                done = 0
                calls.append(0)
    except StopIteration as end:
        return calls, end.value
    finally:
        sys.setprofile(before)


def tried(steps: Steps[Plan]) -> Plan | str:
    try:
        return finished(steps)
    except BlockRefused as error:
        return str(error)


@pytest.mark.parametrize("shape", SHAPES)
def test_no_slice_of_planning_is_long(shape: Callable[[int], Parts]) -> None:
    said = tuple(Speech(id=f"s{number}", text="one") for number in range(400))
    elsewhere = {"other": Block(id="other", behaviors=said)}

    calls, plan = slices(plan_steps(large(shape), known=Known(blocks=elsewhere)))
    assert max(calls) < MOST_CALLS
    assert plan == plan_block(large(shape), known=Known(blocks=elsewhere))


@settings(max_examples=60, deadline=None)
@given(st.lists(random_blocks(12) | possible_blocks(12), min_size=2, max_size=3), st.randoms(use_true_random=False))
def test_blocks_that_are_planned_in_turns_get_the_plans_they_get_alone(blocks: list[Block], chance) -> None:  # type: ignore[no-untyped-def]
    alone = [tried(plan_steps(each, [estimate(one) for one in each.behaviors])) for each in blocks]
    going = {
        number: plan_steps(each, [estimate(one) for one in each.behaviors]) for number, each in enumerate(blocks)
    }
    found: dict[int, Plan | str] = {}
    while going:
        number = chance.choice(sorted(going))
        try:
            next(going[number])
        except StopIteration as end:
            found[number] = end.value
        except BlockRefused as error:
            found[number] = str(error)
        if number in found:
            del going[number]

    assert [found[number] for number in range(len(blocks))] == alone


def test_portions_are_all_there_is_in_order() -> None:
    assert [list(each) for each in portions(range(5), 2)] == [[0, 1], [2, 3], [4]]
    assert list(portions({}.values())) == []


async def test_work_with_pauses_lets_others_run_and_returns_what_it_is_for() -> None:
    turns = []

    def work() -> Steps[str]:
        for _ in range(8):
            yield SLICE // 2
        return "done"

    async def others() -> None:
        while True:
            turns.append(None)
            await asyncio.sleep(0)

    other = asyncio.create_task(others())
    assert await unhurried(work()) == "done"
    other.cancel()
    await asyncio.gather(other, return_exceptions=True)

    assert len(turns) == 4


TIED = block(
    (Speech(id="one", text="one"), Speech(id="two", text="two")), together("one:end", "two:start"), id="small"
)


def is_planned(seen: Stage) -> bool:
    return any(isinstance(each, BlockProgress) and each.block == "large" for each in seen.feedback)


async def turns(until: Callable[[], bool], most: int = 10_000) -> int:
    """Turns of the event loop until then."""
    for number in range(most):
        if until():
            return number
        await asyncio.sleep(0)
    raise AssertionError("never")


@pytest.fixture
def any_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of any size are planned."""
    monkeypatch.setattr(planning, "MOST_BEHAVIORS", 5000)
    monkeypatch.setattr(planning, "MOST", 5000)


async def test_a_sync_point_is_answered_while_another_block_is_planned(any_size: None) -> None:
    body = FakeBody({"one": Script(stall="end")})
    async with stage(body) as seen:
        small = seen.ask(TIED)
        await seen.seen("one:start", "small")
        seen.ask(large(references))
        await turns(lambda: body.asked > 1)
        for _ in range(20):  # well into it
            await asyncio.sleep(0)
        now = body.bus.stamp()
        end = SyncPointReached(id="r-small/one", block="small", behavior="one", sync="end", at=now, arrived=now)
        body.bus.publish(keys.SYNC_POINT, end)
        waited = await turns(lambda: any(behavior == "two" for _, behavior, _ in body.commands))

        assert not is_planned(seen)
        assert waited < 20
        seen.requests.cancel(small.request.id)
        seen.requests.cancel("r-large")


async def test_a_block_that_is_cancelled_while_it_is_planned_ends_at_once(any_size: None) -> None:
    body = FakeBody()
    async with stage(body) as seen:
        pending = seen.ask(large(references))
        await turns(lambda: body.asked > 0)
        for _ in range(20):
            await asyncio.sleep(0)
        seen.requests.cancel("r-large", "no more")
        waited = await turns(pending.outcome.done)
        outcome = pending.outcome.result()

        assert isinstance(outcome, BlockOutcome)
        assert outcome.status == "interrupted"
        assert waited < 20
        assert not is_planned(seen)
    assert body.commands == []


def test_what_comes_with_the_successor_is_not_cut_short_by_it() -> None:
    """Planning settles at once: the way home, which begins in that very instant, is all that is given up."""
    behaviors = (Gaze(id="g", target="a"), Gaze(id="h", target="b"))
    made = block(behaviors, together("g:relax", "h:start"), together("g:start", "0"), together("h:start", "2"))
    calls = 0

    def limited() -> Steps[Plan]:
        nonlocal calls
        steps = plan_steps(made, [FakeBody().estimate(each) for each in behaviors])
        while calls < 1000:
            calls += 1
            try:
                yield next(steps)
            except StopIteration as end:
                return end.value
        raise AssertionError("it does not settle")

    plan = finished(limited())
    assert [plan.predicted(point) for point in plan.chains["g"].points] == [0.0, 0.0, 0.0, 0.5, 2.0, 2.0, 2.0]
