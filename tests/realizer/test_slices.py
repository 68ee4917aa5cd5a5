"""A block that needs many nets is planned a net at a time: while other blocks go on, until somebody cancels."""

import asyncio
import random
import sys
from collections.abc import Callable
from types import FrameType

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Constraint, Gaze, Speech
from engage_hri.schemas.blocks import Block, BlockOutcome, BlockProgress
from engage_hri.schemas.body import SyncPointReached
from engage_hri.services.realizer.plan.known import Known
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block, plan_tries
from engage_hri.services.realizer.plan.relations import BlockRefused
from engage_hri.services.realizer.together.planning import MOST_BEHAVIORS
from engage_hri.services.runtime.steps import Steps
from tests.random_cases import share_of
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
    tied_at_random,
)

SHAPES = [references, looks, series, measured_words, joined, fixed, hopeless, hasty, rivals, preparing]
MOST_CALLS = 250_000
"""In one try, for as many behaviors as a block may have: fifty milliseconds or so."""


def large(shape: Callable[[int], Parts], size: int = MOST_BEHAVIORS, id: str = "large") -> Block:
    behaviors, operators = shape(size)
    return Block(id=id, behaviors=tuple(behaviors), constraints=(Constraint(operators=tuple(operators)),))


def tries(steps: Steps[Plan]) -> tuple[list[int], Plan]:
    """Functions called in each try, as the event loop would see it; and the plan."""
    calls = [0]

    def counted(frame: FrameType, event: str, argument: object) -> None:
        calls[-1] += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(counted)
    try:
        while True:
            next(steps)
            calls.append(0)
    except StopIteration as end:
        return calls, end.value
    finally:
        sys.setprofile(before)


def tried(steps: Steps[Plan]) -> Plan | str:
    try:
        return tries(steps)[1]
    except BlockRefused as error:
        return str(error)


@pytest.mark.parametrize("shape", SHAPES)
def test_no_try_is_long(shape: Callable[[int], Parts]) -> None:
    said = tuple(Speech(id=f"s{number}", text="one") for number in range(MOST_BEHAVIORS))
    elsewhere = {"other": Block(id="other", behaviors=said)}

    calls, plan = tries(plan_tries(large(shape), known=Known(blocks=elsewhere)))
    assert max(calls) < MOST_CALLS
    assert plan == plan_block(large(shape), known=Known(blocks=elsewhere))


@settings(max_examples=share_of(60), deadline=None)
@given(st.lists(random_blocks(12) | possible_blocks(12), min_size=2, max_size=3), st.randoms(use_true_random=False))
def test_blocks_that_are_planned_in_turns_get_the_plans_they_get_alone(blocks: list[Block], chance) -> None:  # type: ignore[no-untyped-def]
    alone = [tried(plan_tries(each, [estimate(one) for one in each.behaviors])) for each in blocks]
    going = {
        number: plan_tries(each, [estimate(one) for one in each.behaviors]) for number, each in enumerate(blocks)
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


def many_nets() -> Block:
    """A block that needs many nets."""
    made = tied_at_random(100, random.Random(3))
    return Block(id="large", behaviors=made.behaviors, constraints=made.constraints)


async def test_a_sync_point_is_answered_while_another_block_is_planned() -> None:
    body = FakeBody({"one": Script(stall="end")})
    async with stage(body) as seen:
        small = seen.ask(TIED)
        await seen.seen("one:start", "small")
        seen.ask(many_nets())
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


async def test_a_block_that_is_cancelled_while_it_is_planned_ends_at_once() -> None:
    body = FakeBody()
    async with stage(body) as seen:
        pending = seen.ask(many_nets())
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

    calls, plan = tries(plan_tries(made, [FakeBody().estimate(each) for each in behaviors]))
    assert len(calls) < 10
    assert [plan.predicted(point) for point in plan.chains["g"].points] == [0.0, 0.0, 0.0, 0.5, 2.0, 2.0, 2.0]
