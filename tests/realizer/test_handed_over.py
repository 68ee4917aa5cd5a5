"""Parts that go from one behavior to another: it may cost a way home, never a stroke, and never in silence."""

import asyncio
from collections.abc import Sequence
from random import Random

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import (
    BlockBehavior,
    FaceLexeme,
    FaceShift,
    Gaze,
    GazeShift,
    Gesture,
    Hand,
    Head,
    HeadDirectionShift,
    Mark,
    Pointing,
    Speech,
)
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import PerformBehavior
from engage_hri.services.control.config import Variability
from engage_hri.services.realizer.plan.handover import entering
from engage_hri.services.realizer.plan.phases import chain
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.planning import at, plan, timed, warnings
from tests.realizer.puppet import bml, puppet
from tests.realizer.stage import Stage, block, stage
from tests.realizer.test_simulated_body import robot

SHIFT = GazeShift(id="g", target="a")
POINT = Pointing(id="p", target="a", mode="RIGHT_HAND")
BEAT = Gesture(id="q", lexeme="BEAT", mode="RIGHT_HAND")
WORDS = Speech(id="s", text="this one here", marks=(Mark("m", 5),))
LOOK = Gaze(id="z", target="a")
SMILE = FaceLexeme(id="e", lexeme="SMILE")
NOD = Head(id="n", lexeme="NOD")


async def robbed(seen: Stage, one: Block, when: str) -> None:
    """Perform a block; at a point of it somebody else takes the right arm, past the realizer."""
    first = seen.ask(one)
    await seen.seen(when, one.id)
    thief = PerformBehavior(id="thief", requester="test", block="two", behavior=BEAT, through="end")
    await seen.requests.send(keys.BEHAVIOR, thief).outcome
    await first.outcome


# -- across blocks ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("required", [False, True])
async def test_a_pointing_that_somebody_cuts_is_lost(*, required: bool) -> None:
    held = replace(timed(POINT, start="0", end="6"), required=required)
    async with stage() as seen:
        await robbed(seen, block((held, WORDS), id="one"), "p:start")

    assert [each.status for each in seen.ends()] == ["failed" if required else "done"]
    assert [(each.block, each.kind, each.behavior) for each in seen.warnings()] == [("one", "EXECUTION_FAILURE", "p")]
    assert [name for name in seen.times("one") if name.startswith("p:")] == ["p:start"]


async def test_a_cut_motion_of_the_simulated_body_leaves_no_point_behind() -> None:
    async with robot(Variability(seed=0, noise=0.0)) as seen:
        one = seen.ask(block((timed(POINT, start="0", end="6"), timed(WORDS, start="p:stroke")), id="one"))
        await asyncio.sleep(0.3)
        thief = PerformBehavior(id="thief", requester="test", block="two", behavior=BEAT, through="end")
        await seen.requests.send(keys.BEHAVIOR, thief).outcome
        await one.outcome

    assert [name for name in seen.times() if name.startswith("p:")] == ["p:start"]
    assert seen.kinds() == ["EXECUTION_FAILURE"]


async def test_whoever_takes_the_part_may_save_a_behavior_its_way_home() -> None:
    one = block((timed(POINT, start="0"), WORDS), id="one")
    async with stage() as seen:
        await robbed(seen, one, "p:stroke_end")

    assert seen.warnings() == []
    points = {each.sync: each for each in seen.progress("one") if each.behavior == "p"}
    assert points["relax"].time == points["end"].time == points["stroke_end"].time
    assert [points[sync].source for sync in ("stroke", "stroke_end", "relax", "end")] == ["body"] * 2 + ["clock"] * 2


async def test_what_was_passed_counts_though_its_report_was_lost() -> None:
    async with puppet() as body:
        asked = body.ask(bml('<pointing id="p" target="a" mode="RIGHT_HAND" start="0"/>'))
        await body.told("p")
        body.accept("p")
        body.reach("p", "start")
        body.end("p", "taken_over", passed="stroke_end")
        await asked.outcome

    assert body.warnings() == []
    assert body.points()[-3:] == ["p:stroke_end", "p:relax", "p:end"]


async def test_a_stroke_that_was_not_passed_is_never_told() -> None:
    async with puppet() as body:
        asked = body.ask(bml('<pointing id="p" target="a" mode="RIGHT_HAND" start="0"/>'))
        await body.told("p")
        body.accept("p")
        body.reach("p", "start", "ready")
        body.end("p", "taken_over", passed="stroke_start")
        await asked.outcome

    assert body.warnings() == [("b:p", "EXECUTION_FAILURE")]
    assert body.points() == ["p:start", "p:ready", "p:stroke_start"]


# -- within one block ----------------------------------------------------------------------------------------------

AT_ONE_INSTANT = [
    ((timed(Gesture(id="g", lexeme="BEAT", mode="BOTH_HANDS"), start="1"), timed(POINT, start="1")), "p"),
    ((timed(LOOK, start="0"), timed(Gaze(id="h", target="b"), start="0")), "h"),
    ((timed(NOD, start="2"), timed(Head(id="o", lexeme="SHAKE"), start="2")), "o"),
    (
        (timed(SHIFT, start="1"), timed(HeadDirectionShift(id="h", target="b"), start="1")),
        "h",
    ),
    (
        (timed(FaceShift(id="f", lexeme="SMILE"), start="1"), timed(SMILE, start="1")),
        "e",
    ),
]


@pytest.mark.parametrize(("behaviors", "lost"), AT_ONE_INSTANT)
def test_of_two_on_one_part_at_one_fixed_instant_the_later_is_dropped(
    behaviors: Sequence[BlockBehavior], lost: str
) -> None:
    made = plan(block(behaviors))

    assert warnings(made) == [("IMPOSSIBLE_TO_SCHEDULE", lost)]


@pytest.mark.parametrize("behaviors", [behaviors for behaviors, _ in AT_ONE_INSTANT])
def test_if_the_later_has_time_it_waits_for_its_turn(behaviors: Sequence[BlockBehavior]) -> None:
    first, second = behaviors
    made = plan(block((timed(first, start="0"), timed(second))))

    assert made.problems == ()
    assert at(made, f"{second.id}:start") >= made.predicted(made.kept[first.id]) > 0.0


@pytest.mark.parametrize("behaviors", [behaviors for behaviors, _ in AT_ONE_INSTANT])
def test_one_of_which_nobody_says_when_it_comes_waits_for_one_with_a_time(behaviors: Sequence[BlockBehavior]) -> None:
    first, second = behaviors
    made = plan(block((timed(second, start="0.5"), timed(first))))

    assert made.problems == ()
    assert at(made, f"{second.id}:start") == 0.5
    assert at(made, f"{first.id}:start") >= made.predicted(made.kept[second.id]) > 0.5


def test_a_gesture_at_the_instant_of_another_uses_the_other_arm_if_it_names_none() -> None:
    made = plan(block((timed(POINT, start="1"), timed(Gesture(id="g", lexeme="BEAT"), start="1"))))

    assert made.problems == ()
    assert at(made, "g:start") == at(made, "p:start") == 1.0
    assert made.chains["g"].parts == ("left_arm",)


async def test_who_waits_for_a_measured_event_is_not_overtaken_in_silence() -> None:
    behaviors = (
        timed(NOD, stroke="1"),
        timed(LOOK, start="n:stroke"),
        timed(Gaze(id="h", target="b"), start="1"),
        WORDS,
    )
    async with stage() as seen:
        outcome = await seen.perform(block(behaviors))

    assert outcome.dropped == ("h",)
    assert [(each.kind, each.behavior) for each in seen.warnings()] == [("IMPOSSIBLE_TO_SCHEDULE", "h")]
    expected = {f"{each.behavior}:{each.sync}": each.predicted for each in seen.progress()}
    assert seen.times() == expected


def test_the_order_of_two_beginnings_is_a_place_in_the_net() -> None:
    made = plan(block((timed(SHIFT, start="n:stroke"), timed(NOD, stroke="1"), timed(LOOK, start="1.5"))))

    orders = {(place.source, place.target) for place in made.net.places if place.kind == "series"}
    names = [transition.name for transition in made.net.transitions]
    assert any("g:start" in names[source] and "z:start" in names[target] for source, target in orders)


async def test_the_later_of_two_on_one_part_waits_for_the_stroke_of_a_slow_one() -> None:
    behaviors = (timed(LOOK, start="0"), timed(Gaze(id="h", target="b"), start="1"))
    async with stage(FakeBody({"z": Script(slow=4.0)})) as seen:
        outcome = await seen.perform(block(behaviors))

    assert outcome.dropped == ()
    times = seen.times()
    assert times["z:stroke"] == times["h:start"] == times["z:end"] == 2.0


# -- whatever comes ------------------------------------------------------------------------------------------------


def crowd(chance: Random) -> Block:
    """Behaviors that want the same few parts, some at fixed instants."""
    makers = (
        lambda id: Gaze(id=id, target="a"), lambda id: GazeShift(id=id, target="a"),
        lambda id: HeadDirectionShift(id=id, target="b"), lambda id: Head(id=id, lexeme="NOD"),
        lambda id: Gesture(id=id, lexeme="BEAT", mode=chance.choice(("LEFT_HAND", "RIGHT_HAND", "BOTH_HANDS", None))),
        lambda id: Pointing(id=id, target="a", mode=chance.choice(("LEFT_HAND", "RIGHT_HAND", None))),
    )  # fmt: skip
    behaviors = []
    for number in range(chance.randrange(2, 7)):
        behavior = chance.choice(makers)(f"b{number}")
        if chance.random() < 0.7:
            behavior = timed(behavior, start=str(chance.randrange(0, 12) / 4))
        behaviors.append(behavior)
    return block(behaviors)


@pytest.mark.parametrize("seed", range(share_of(60)))
async def test_within_a_block_nobody_loses_a_stroke_to_another(seed: int) -> None:
    chance = Random(seed)
    example = crowd(chance)
    slow = {each.id: Script(slow=chance.choice((0.5, 1.0, 1.0, 2.0, 3.0))) for each in example.behaviors}
    async with stage(FakeBody(slow)) as seen:
        outcome = await seen.perform(example)

    planned = {each.behavior for each in seen.warnings() if each.kind == "IMPOSSIBLE_TO_SCHEDULE"}
    assert {each.kind for each in seen.warnings()} <= {"IMPOSSIBLE_TO_SCHEDULE", "LATE"}
    assert set(outcome.dropped) == planned
    made = {(each.behavior, each.sync) for each in seen.progress() if each.source == "body"}
    assert made >= {(each.id, middle(each)) for each in example.behaviors if each.id not in planned}


def middle(behavior: BlockBehavior) -> str:
    """The point that it is there for."""
    return "end" if isinstance(behavior, GazeShift | HeadDirectionShift) else "stroke"


def test_the_way_home_of_one_that_nobody_has_placed_is_cut_and_it_waits_for_nobody() -> None:
    """Its stroke is over when the other begins at its fixed time: there is nothing to wait for."""
    first, second = (Gesture(id=id, lexeme="BEAT", mode="RIGHT_HAND") for id in "pq")
    made = plan(block((first, timed(second, start="1.75"))))

    assert (at(made, "p:start"), at(made, "p:stroke_end"), at(made, "q:start")) == (0.0, 1.5, 1.75)
    assert made.dropped == ()


@pytest.mark.parametrize("sooner", ["LEFT_HAND", "RIGHT_HAND"])
def test_of_two_who_take_an_arm_each_the_first_ends_what_both_arms_did(sooner: Hand) -> None:
    both = Gesture(id="p", lexeme="BEAT", mode="BOTH_HANDS")
    hands: tuple[Hand, ...] = ("LEFT_HAND", "RIGHT_HAND")
    takers = [
        timed(Gesture(id=hand[0], lexeme="BEAT", mode=hand), start="1.75" if hand == sooner else "2")
        for hand in hands
    ]
    made = plan(block((both, *takers)))

    assert (at(made, "p:relax"), at(made, "p:end")) == (1.75, 1.75)
    assert [at(made, f"{hand[0]}:start") for hand in hands] == [1.75 if hand == sooner else 2.0 for hand in hands]


def test_of_those_that_start_together_who_has_begun_takes_its_parts_first() -> None:
    looks = {id: chain(Gaze(id=id, target=id), None) for id in ("one", "two", "three")}
    times = {point: float(number) for each in looks.values() for number, point in enumerate(each.points)}
    rounds = dict.fromkeys(times, 0)

    assert entering(looks, (), times, rounds) == ("one", "two", "three")
    assert entering(looks, (), times, rounds, begun={"three"}) == ("three", "one", "two")
    assert entering(looks, {"two"}, times, rounds, ranked=("one", "two", "three"), begun={"three"})[0] == "three"
