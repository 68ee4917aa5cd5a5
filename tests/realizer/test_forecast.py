"""The forecast: kept up to date it says what it would say from scratch; what it costs in a long block."""

from itertools import pairwise
from time import process_time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behaviors import After, Constraint, Mark, Pointing, Speech, Synchronize
from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.decide.decisions import Decisions
from engage_hri.services.realizer.foresee.forecast import full_forecast
from engage_hri.services.realizer.foresee.pace import Experience
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.plan.relations import BlockRefused
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody
from tests.realizer.player import Player
from tests.realizer.test_properties import blocks


def planned(block: Block, elastic: tuple[float, float]) -> Plan | None:
    body = FakeBody(elastic=elastic)
    try:
        return plan_block(block, [body.estimate(each) for each in block.behaviors])
    except BlockRefused:
        return None


@settings(max_examples=share_of(80), deadline=None)
@given(
    blocks(),
    st.sampled_from(((1.0, 1.0), (0.5, 3.0))),
    st.dictionaries(st.sampled_from(("g", "p-left", "s1", "s3", "nod")), st.sampled_from((0.5, 1.25, 2.0, 3.0))),
)
def test_the_forecast_that_is_kept_is_the_one_from_scratch(
    block: Block, elastic: tuple[float, float], slow: dict[str, float]
) -> None:
    plan = planned(block, elastic)
    if plan is None:
        return

    def compare(authority: Decisions) -> None:
        kept = authority.foresight.forecast
        if kept is None or authority.foresight.not_before:
            return
        authority.foresight.catch_up()
        kept.update()
        facts, net, experience = authority.facts, authority.net, authority.foresight.experience
        scratch = full_forecast(plan, facts.began, experience.factor, {}, facts.reached, facts.arrived, net.fired)
        scratch.update()
        size = len(plan.members)
        assert kept.times[:size] == pytest.approx(scratch.times[:size], abs=1e-5)

    Player(plan, lambda id: slow.get(id, 1.0), compare).play()


def phrases(count: int) -> Plan:
    """Each with a gesture whose stroke falls on a word: nothing can be decided without a prediction."""
    behaviors: list[Pointing | Speech] = []
    operators: list[Synchronize | After] = []
    for number in range(count):
        behaviors.append(Pointing(id=f"p{number}", target="a", mode="RIGHT_HAND"))
        behaviors.append(Speech(id=f"s{number}", text="one two", marks=(Mark("m", 3),)))
        operators.append(Synchronize(ref=f"p{number}:stroke", syncs=(f"s{number}:m",)))
    for before, after in pairwise(range(count)):
        operators.append(After(ref=f"s{before}:end", syncs=(f"s{after}:start",)))
        operators.append(After(ref=f"p{before}:end", syncs=(f"p{after}:start",)))
    block = Block(id="b", behaviors=tuple(behaviors), constraints=(Constraint(operators=tuple(operators)),))
    plan = planned(block, (1.0, 1.0))
    assert plan is not None
    return plan


def test_a_decision_costs_at_most_in_proportion_in_the_longest_block_that_there_may_be() -> None:
    costs = []
    for count in (20, 100):
        player = Player(phrases(count), lambda id: 1.5 if id.startswith("p") else 1.0)
        began = process_time()
        player.play()
        costs.append((process_time() - began) / player.asked)

    assert costs[1] < 5 * costs[0]


def test_experience_is_of_parts_and_ignores_what_is_no_speed() -> None:
    body = FakeBody()
    behaviors = (Pointing(id="p1", target="a"), Pointing(id="p2", target="a"), Speech(id="s", text="so"))
    experience = Experience({each.id: body.estimate(each) for each in behaviors})

    assert set(experience.learn("p1", 0.5, 1.0)) == {"p1", "p2"}
    assert experience.factor("p2") == pytest.approx(2.0)
    assert experience.factor("s") == 1.0
    assert experience.learn("p1", 0.5, 20.0) == ()
    assert experience.learn("p1", 0.01, 0.02) == ()
    assert experience.factor("p1") == pytest.approx(2.0)
