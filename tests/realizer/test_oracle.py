"""The planner against an oracle that knows neither nets nor classes, on random blocks of up to 30 behaviors."""

import random

from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behaviors import Pointing, Speech, Synchronize, Timing
from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.plan.plan import Plan
from tests.random_cases import share_of
from tests.realizer.oracle import (
    consult,
    estimated,
    phases_of,
    point,
    points_of,
    possible_blocks,
    random_blocks,
    said,
    type_of,
)
from tests.realizer.stage import block, together

CLOSE = 1e-5


def planned_times(plan: Plan) -> dict[str, float]:
    return {f"{each.behavior}:{each.sync}": plan.predicted(each) for each in plan.at if each.behavior}


def waits_for_measurements(plan: Plan) -> bool:
    """Does a behavior wait for the sake of a later point of its that cannot? Then it is later than it need be."""
    end = len(plan.net.transitions) - 1
    return any(
        place.kind == "order" and place.behavior and place.source and place.target != end for place in plan.net.places
    )


def are_equally_whole(one: Plan, other: Plan) -> bool:
    """True if the same is dropped in both, and no time of a speech is given up."""
    return set(one.dropped) == set(other.dropped) and not (one.given_up or other.given_up)


@settings(max_examples=share_of(150), deadline=None)
@given(random_blocks())
def test_what_can_be_scheduled_is_and_nothing_else(example: Block) -> None:
    plan = estimated(example)

    assert (plan is not None and not (plan.dropped or plan.given_up)) == consult(example).is_possible()


@settings(max_examples=share_of(150), deadline=None)
@given(st.one_of(possible_blocks(), possible_blocks(), random_blocks(10)))
def test_the_schedule_is_the_earliest_there_is(example: Block) -> None:
    plan = estimated(example)
    if plan is None or plan.dropped or plan.given_up:
        return
    earliest = consult(example).earliest()
    times = planned_times(plan)

    if earliest is None:  # phases must be faster or slower: many schedules are as good
        return
    for name, time in times.items():
        assert time >= earliest[name] - CLOSE, name
    if not waits_for_measurements(plan):
        assert {name: round(time, 4) for name, time in times.items()} == {
            name: round(time, 4) for name, time in earliest.items() if name != "0"
        }


@settings(max_examples=share_of(150), deadline=None)
@given(random_blocks())
def test_every_schedule_keeps_what_was_asked_and_what_behaviors_can_do(example: Block) -> None:
    plan = estimated(example)
    if plan is None:
        return
    kept = {each.id: each for each in plan.behaviors}
    times = planned_times(plan) | {"0": 0.0}

    for behavior in kept.values():
        names = [f"{behavior.id}:{sync}" for sync in points_of(behavior)]
        cut = behavior.id in plan.natural
        for since, to, phase in zip(names, names[1:], phases_of(behavior), strict=False):
            took = times[to] - times[since]
            assert took >= (0.0 if cut else phase.shortest) - CLOSE
            limited = phase.longest is not None and not (
                type_of(behavior) in ("gaze", "posture") and "stroke_end" in to
            )
            assert not limited or took <= (phase.longest or 0.0) + CLOSE, (since, to)
    for kind, one, others in () if plan.given_up else said(example):
        for text in others:
            (ref, offset), (sync, other) = point(one, example), point(text, example)
            if ref not in times or sync not in times:
                continue  # of a behavior that was dropped
            apart = times[sync] + other - times[ref] - offset
            assert abs(apart) < CLOSE or (kind is not Synchronize and (apart > 0) == (kind.__name__ == "After"))


@settings(max_examples=share_of(100), deadline=None)
@given(st.one_of(possible_blocks(), random_blocks()), st.randoms(use_true_random=False))
def test_any_order_of_elements_gives_the_same_net(example: Block, chance: random.Random) -> None:
    """Up to the order within a type and, where something must be dropped, who is the later: same loss, same net."""
    plan = estimated(example)
    behaviors, operators = list(example.behaviors), list(example.constraints[0].operators)
    chance.shuffle(behaviors)
    chance.shuffle(operators)
    queues = {type_of(each): [it for it in example.behaviors if type_of(it) == type_of(each)] for each in behaviors}
    behaviors = [queues[type_of(each)].pop(0) for each in behaviors]
    constraint = type(example.constraints[0])
    shuffled = tuple(constraint(operators=(each,)) for each in operators)

    other = estimated(Block(id="b", behaviors=tuple(behaviors), constraints=shuffled))

    if plan is None or not (plan.dropped or plan.given_up):
        assert (other is None) == (plan is None)
    if plan is not None and other is not None and are_equally_whole(plan, other):
        assert other.net == plan.net
        assert other.schedule == plan.schedule


def test_the_oracle_knows_what_is_plain_by_hand() -> None:
    """By hand: a point kept back, a point held, and what cannot be."""
    kept_back = block((Pointing(id="p", target="a"), Speech(id="s", text="this")), together("p:stroke", "s:end"))
    impossible = block(
        (
            Pointing(id="p", target="a", timing=(Timing("start", "1"), Timing("end", "1.5"))),
            Speech(id="s", text="this"),
        )
    )

    earliest = consult(kept_back).earliest()
    assert earliest is not None
    assert (earliest["p:start"], earliest["p:stroke"], earliest["s:end"]) == (0.0, 1.25, 1.25)
    assert not consult(impossible).is_possible()
