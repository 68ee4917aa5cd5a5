"""Planning comes to an end, whatever the block: counted in steps of its work, not in seconds."""

from collections.abc import Iterable
from random import Random

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import (
    After,
    Before,
    BlockBehavior,
    Gaze,
    GazeShift,
    Gesture,
    HeadDirectionShift,
    Pointing,
    Speech,
    Timing,
)
from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.plan.handover import Turn
from engage_hri.services.realizer.plan.known import NOTHING, Known, holders_of, qualified
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_tries
from engage_hri.services.realizer.plan.relations import BlockRefused
from engage_hri.services.realizer.points import Point
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.planning import at, timed
from tests.realizer.stage import block, stage

MOST = 5000
"""Steps that a plan of a few behaviors takes at most; the longest of 30000 random ones took 1342."""
BOTH = Gesture(id="g", lexeme="BEAT", mode="BOTH_HANDS")
RIGHT, LEFT = Pointing(id="p", target="a", mode="RIGHT_HAND"), Pointing(id="q", target="b", mode="LEFT_HAND")
KINDS: tuple[BlockBehavior, ...] = (
    BOTH,
    BOTH,
    RIGHT,
    LEFT,
    Gesture(id="h", lexeme="BEAT"),
    Gaze(id="l", target="a"),
    GazeShift(id="s", target="b"),
    HeadDirectionShift(id="d", target="c"),
    Speech(id="t", text="one two"),
)
TIMES = ("0", "0.25", "0.5", "0.9", "1", "1.5", "2")


def planned(
    example: Block, elastic: tuple[float, float] = (1.0, 1.0), known: Known = NOTHING, turns: Iterable[Turn] = ()
) -> Plan:
    """The plan, if it takes no more than so many tries."""
    body = FakeBody(elastic=elastic)
    tries = plan_tries(
        example, [body.estimate(each) for each in example.behaviors], known=known, turns=frozenset(turns)
    )
    for _ in range(MOST):
        try:
            next(tries)
        except StopIteration as end:
            made: Plan = end.value
            return made
    raise AssertionError("planning does not come to an end")


@pytest.mark.parametrize("when", ["1", "1.25", "1.5", "1.75", "2.5"])
def test_the_two_arms_of_one_behavior_go_to_two_others_at_one_time(when: str) -> None:
    """Each of these waits for the stroke; in turns one of the two came first, as it waited and the other did not."""
    made = planned(block((timed(BOTH, start="0"), timed(RIGHT, start=when), timed(LEFT, start=when))), (0.5, 1.5))

    assert made.dropped == ()
    assert at(made, "g:stroke_end") <= float(when) == at(made, "p:start") == at(made, "q:start")


@pytest.mark.parametrize("when", [("1.5", "1.5"), ("1.5", "1.6"), ("1.6", "1.5")])
async def test_both_wait_for_the_stroke_of_one_who_is_slow(when: tuple[str, str]) -> None:
    body = FakeBody({"g": Script(slow=1.25)})
    async with stage(body) as seen:
        outcome = await seen.perform(block((BOTH, timed(RIGHT, start=when[0]), timed(LEFT, start=when[1]))))

    assert outcome.dropped == ()
    assert seen.times()["g:stroke_end"] == pytest.approx(1.875)
    assert min(seen.times()["p:start"], seen.times()["q:start"]) >= seen.times()["g:stroke_end"]


def test_a_turn_to_begin_with_for_which_there_is_no_time_is_let_go() -> None:
    """The speech of which nothing is said was to come first; there is no time, and it need not."""
    example = block((Speech(id="s", text="one two"), timed(Speech(id="t", text="three"), start="0.5")))

    made = planned(example, turns=[("t", Point("s", "end"))])

    assert (made.dropped, made.problems, at(made, "t:start")) == ((), (), 0.5)


def at_random(chance: Random, id: str, others: Iterable[str] = ()) -> Block:
    """A block of behaviors that share arms, head and voice. others: points of other blocks to be tied to."""
    kinds = KINDS[: chance.choice((5, len(KINDS)))]
    members = [replace(chance.choice(kinds), id=f"{id}{number}") for number in range(chance.randint(2, 6))]
    points = [f"{each.id}:{sync}" for each in members for sync in sync_points(each)]
    behaviors = []
    for each in members:
        own = sync_points(each)
        syncs = [chance.choice((own[0], own[0], chance.choice(own))) for _ in range(chance.choice((0, 1, 1, 1, 2)))]
        refs = {sync: chance.choice((*TIMES, *TIMES, *points, *others)) for sync in syncs}
        shift = {sync: chance.choice(("", "", "+0.25", "-0.25")) if ":" in ref else "" for sync, ref in refs.items()}
        timing = tuple([Timing(sync, f"{ref}{shift[sync]}") for sync, ref in refs.items()])
        behaviors.append(replace(each, timing=timing, required=chance.random() < 0.05))
    operators = [
        chance.choice((After, Before))(ref=chance.choice(points), syncs=(chance.choice(points),))
        for _ in range(chance.choice((0, 0, 1, 2)))
    ]
    return block(behaviors, *operators, id=id)


def beside(chance: Random, other: Plan) -> Known:
    """What is known of another block that has begun some time ago."""
    since = chance.choice((0.0, 0.25, 0.5, 1.0))
    times = {point: other.predicted(point) - since for each in other.chains.values() for point in each.points}

    def reached(id: str) -> int:
        return sum(times[point] <= 0.0 for point in other.chains[id].points)

    over = {id for id, each in other.chains.items() if reached(id) == len(each.points)}
    kept = frozenset(other.constrained)
    holders = holders_of(other.block.id, other.chains, other.estimates, other.natural, kept, over, reached, {})
    points = {qualified(other.block.id, point): at for point, at in times.items()}
    return Known(blocks={other.block.id: other.block}, points=points, holders=dict(holders))


def again(chance: Random, made: Plan, known: Known) -> Known:
    """What is known when some behaviors of a block have begun as planned, and it is planned once more."""
    now = chance.choice((0.3, 0.6, 1.0))
    starts = {each.points[0]: made.predicted(each.points[0]) for each in made.chains.values()}
    begun = frozenset(point.behavior for point, at in starts.items() if at <= now)
    due = frozenset(sorted(point.behavior for point, at in starts.items() if at > now)[:1])
    return replace(known, points={**known.points, **starts}, begun=begun, due=due)


@pytest.mark.parametrize("seed", range(share_of(4)))
def test_random_blocks_are_planned_alone_beside_others_and_again(seed: int) -> None:
    chance = Random(seed)
    made: list[Plan] = []
    for _ in range(100):
        elastic = chance.choice(((1.0, 1.0), (0.5, 1.5), (0.7, 1.0)))
        try:
            other = planned(at_random(chance, "o"), elastic)
            known = beside(chance, other)
            points = [str(point) for point in known.points]
            example = at_random(chance, "b", chance.sample(points, min(3, len(points))))
            made.append(planned(example, elastic, known))
            made.append(planned(example, elastic, again(chance, made[-1], known)))
        except BlockRefused:
            continue
    assert len(made) > 100
