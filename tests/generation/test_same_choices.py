"""The same choices as when the body was asked for everything in full: random tables, fragments, bodies, seed by seed.

The oracle asks for every motion from every pose, lays every path, and chooses with the policy as it was then.
Estimates of postures differ from full ones by rounding, some 1e-12 degrees: costs are compared to nine decimals,
which are those that count for the policy. All else of the plan is compared as it is: choices, tables with reasons,
warnings, and the whole block.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import Capabilities, Estimate, EstimateItem
from engage_hri.schemas.faults import RunFailed
from engage_hri.schemas.fragments import ReferenceChoice
from engage_hri.services.control.config import Displaced, Variability
from engage_hri.services.control.contract.body import MovementAuthority
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.generation.block.emission import Emission, FragmentPlan
from engage_hri.services.generation.block.ordering import ordered
from engage_hri.services.generation.pipeline import (
    WORDS_BETWEEN,
    _scene,
    glance,
    planned,
    planning,
    references,
    targets,
)
from engage_hri.services.generation.references.motions import (
    distinct,
    from_here,
    from_here_told,
    last_motions,
    pose_after,
)
from engage_hri.services.generation.references.phrases import proposed
from engage_hri.services.generation.references.policy import Choices, Unreferable, references_apart
from engage_hri.services.generation.turns.plan import in_vain, plan_turn
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.generation.all_motions import all_motions
from tests.generation.old_policy import choose
from tests.generation.scenarios import Answer, Scenario, scenario, stubborn, terse, without_arms
from tests.random_cases import share_of

Ask = Callable[[Sequence[EstimateItem]], Sequence[Estimate]]
Way = Callable[[Scenario, Capabilities, Ask], FragmentPlan]
Outcome = FragmentPlan | tuple[str, tuple[ReferenceChoice, ...]]
"""A plan, or why there is none, with the tables."""
DECIMALS = 9
LOST = ("the policy as it was ended with a KeyError", ())
"""It did not ask for what comes after a reference that cannot be made, and so could not tell which one that was."""


def as_it_was(it: Scenario, body: Capabilities, ask: Ask) -> FragmentPlan:
    turn = plan_turn(it.fragment, "f", it.fragment.addressee)
    last = last_motions(it.moving)
    pose = pose_after(last, ask(last))
    glanced = glance(it.fragment, turn, it.config)
    motions = all_motions(targets(it.fragment), ask, it.permits.only_hand, pose, glanced)
    order = ordered(it.fragment.behaviors, it.fragment.constraints, it.fragment.id)
    apart = references_apart(order, it.fragment.constraints, WORDS_BETWEEN)
    made = proposed(references(it.fragment), it.world)
    chosen = Choices()
    if made.references:
        motions = replace(motions, looks_last=it.config.profile == "figure-3.3")
        scene = _scene(it.world, body, it.permits, it.config)
        chosen = choose(made.references, scene, motions, it.config, apart)
    emitted = Emission(it.fragment, turn, chosen.choices, it.config, it.permits, chosen.hands, apart=apart).plan()
    return replace(
        emitted, warnings=(*in_vain(it.fragment, turn), *made.warnings, *chosen.warnings, *emitted.warnings)
    )


def as_it_is(it: Scenario, body: Capabilities, ask: Ask) -> FragmentPlan:
    turn = plan_turn(it.fragment, "f", it.fragment.addressee)
    last = last_motions(it.moving)
    pose = pose_after(last, ask(last))
    glanced, each = glance(it.fragment, turn, it.config), distinct(targets(it.fragment))
    motions = from_here_told(each, ask(from_here(each, it.permits.only_hand, pose, glanced)), glanced)
    return planned(planning(it.fragment, turn, it.world, body, motions, it.permits, it.config), ask)


def outcome(way: Way, *arguments: Any) -> Outcome:
    try:
        made = way(*arguments)
    except Unreferable as error:
        return str(error.fault), tuple(map(rounded, error.choices))
    except RunFailed as error:
        return str(error.fault), ()
    except KeyError:
        return LOST
    return replace(made, choices=tuple(map(rounded, made.choices)))


def assert_same(now: object, before: object) -> None:
    if before == LOST:
        assert isinstance(now, tuple)
        assert ": no way to refer to " in now[0]
    else:
        assert now == before


def rounded(choice: ReferenceChoice) -> ReferenceChoice:
    pairs = tuple(replace(pair, cost=round(pair.cost, DECIMALS)) for pair in choice.pairs)
    return replace(choice, cost=round(choice.cost, DECIMALS), pairs=pairs)


@asynccontextmanager
async def simulated(it: Scenario, displaced: tuple[Displaced, ...] = ()) -> AsyncIterator[SimulatedBody]:
    """A body that has done, and perhaps still does, what the scenario says."""
    body = SimulatedBody(it.zones, Variability(displaced=displaced))
    body.see(it.world)
    tasks = []

    async def perform(behavior: BlockBehavior) -> None:
        async for _ in body.perform(behavior, MovementAuthority(behavior, "end")):
            pass

    for behavior in it.posture:
        if body.estimate(behavior, None, it.world).feasible:
            tasks.append(asyncio.create_task(perform(behavior), name=behavior.id))
            await asyncio.sleep(it.after / len(it.posture))
    yield body
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


def full(body: SimulatedBody, it: Scenario) -> Answer:
    return lambda item: body.estimate(item.behavior, item.pose, it.world)


async def compared(seed: int, displaced: tuple[Displaced, ...] = ()) -> Outcome:
    it = scenario(seed)
    async with simulated(it, displaced) as body:
        answer = full(body, it)
        before = outcome(as_it_was, it, body.capabilities, lambda items: [answer(item) for item in items])
        now = outcome(as_it_is, it, body.capabilities, lambda items: body.rehearse(items, it.world))
    assert_same(now, before)
    return now


@pytest.mark.parametrize("seeds", [range(since, since + 50) for since in range(0, share_of(400), 50)], ids=str)
def test_the_simulated_body_leads_to_the_same_plans(seeds: range) -> None:
    outcomes = [run_virtual(compared(seed)) for seed in seeds]

    made = [each for each in outcomes if isinstance(each, FragmentPlan)]
    assert len(made) > len(outcomes) / 2
    gestures = {choice.gesture for each in made for choice in each.choices}
    assert len(gestures) == 4


@pytest.mark.parametrize("joint", ["left_shoulder_pitch", "right_elbow", "neck_yaw", "torso_turn"])
def test_a_body_that_is_mistaken_of_where_a_joint_is_leads_to_the_same_plans(joint: str) -> None:
    displaced = (Displaced(joint=joint, angle=20.0),)

    assert any(isinstance(run_virtual(compared(seed, displaced)), FragmentPlan) for seed in range(1000, 1025))


def unchanged(answer: Answer) -> Answer:
    return answer


@pytest.mark.parametrize("kind", [stubborn, terse, without_arms, unchanged])
@pytest.mark.parametrize("seeds", [range(2000, 2000 + share_of(50)), range(2050, 2050 + share_of(50))], ids=str)
def test_bodies_that_answer_in_full_lead_to_the_same_plans_bit_for_bit(
    kind: Callable[[Answer], Answer], seeds: range
) -> None:
    async def plans(seed: int) -> None:
        it = scenario(seed)
        async with simulated(it) as body:
            answer = kind(full(body, it))

            def ask(items: Sequence[EstimateItem]) -> Sequence[Estimate]:
                return [answer(item) for item in items]

            before, now = (exactly(way, it, body.capabilities, ask) for way in (as_it_was, as_it_is))
        assert_same(now, before)

    for seed in seeds:
        run_virtual(plans(seed))


def exactly(way: Way, it: Scenario, body: Capabilities, ask: Ask) -> object:
    try:
        return way(it, body, ask)
    except RunFailed as error:
        return str(error.fault), getattr(error, "choices", ())
    except KeyError:
        return LOST


def test_far_less_is_asked_than_there_is() -> None:
    """Numbers of motions asked from where earlier references leave the body, of a hundred fragments."""

    async def count(seed: int) -> tuple[int, int]:
        it = scenario(seed)
        async with simulated(it) as body:
            answer = full(body, it)
            asked: list[int] = []

            def ask(items: Sequence[EstimateItem]) -> Sequence[Estimate]:
                asked.append(len(items))
                return [answer(item) for item in items]

            outcome(as_it_was, it, body.capabilities, ask)
            before, asked[:] = sum(asked[2:]), []
            outcome(as_it_is, it, body.capabilities, ask)
        return before, sum(asked[2:])

    counted = [run_virtual(count(seed)) for seed in range(100)]

    assert sum(now for _, now in counted) < 0.8 * sum(before for before, _ in counted)
