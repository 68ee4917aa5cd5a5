"""The policy of the trunk: towards whom the robot speaks with, late, once for as long as that lasts, and back."""

import asyncio
import math

import pytest

from engage_hri import perceive
from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import GazeShift, PostureShift
from engage_hri.schemas.body import Capabilities, PerformBehavior
from engage_hri.schemas.recognition import Floor, FloorSpeech
from engage_hri.schemas.units import Degrees, Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.generation.head.trunk_policy import ALONE, LASTS
from tests.generation.heads import AT, INHIBITED, Stage
from tests.generation.test_talked_into import call, robot

A_TRUNK = Capabilities(body="torso", types=("gazeShift",), parts=("head", "torso"))
AHEAD, ASIDE, BESIDE_THEM, FAR = 10.0, 40.0, 80.0, -50.0


def person(id: str, at: Degrees) -> Entity:
    place = (math.cos(math.radians(at)), math.sin(math.radians(at)), 1.2)
    return Entity(id=id, kind="person", position=place)


def with_people(*off: str, body: Capabilities = A_TRUNK, **at: Degrees) -> Stage:
    """A robot that speaks with the first of these people, each at an angle to its left."""
    stage = Stage(policies_off=("aversion", *off))
    stage.arbiter.has_body(body)
    stage.feed(World(entities=tuple(person(id, angle) for id, angle in at.items())))
    stage.do(lambda arbiter: arbiter.speak_to(next(iter(at))))
    arrive(stage)
    return stage


def arrive(stage: Stage) -> None:
    """Let the last shift arrive."""
    shift = [ruling.shift for ruling in stage.rulings if ruling.shift is not None][-1]
    stage.do(lambda arbiter: arbiter.shift_arrived(shift.id, stage.now))


def turns(stage: Stage) -> list[tuple[Seconds, str]]:
    """When the trunk was told to turn, and towards whom."""
    told = [(at, ruling.shift) for at, ruling in stage.timed if ruling.shift is not None and ruling.shift.turn]
    for _, shift in told:
        (behavior,) = shift.block.behaviors
        expected = GazeShift(id="shift", target=shift.target, influence="WAIST")
        assert behavior == (expected if shift.target else PostureShift(id="shift"))
    return [(round(at, 6), shift.target) for at, shift in told]


def test_it_turns_once_to_who_is_aside_when_they_have_spoken_for_a_while() -> None:
    stage = with_people(ann=ASIDE)
    stage.until(LASTS - 0.1)
    assert turns(stage) == []

    stage.until(LASTS)
    stage.rule()
    assert turns(stage) == [(LASTS, "ann")]
    arrive(stage)
    stage.until(60.0)
    stage.rule()
    assert turns(stage) == [(LASTS, "ann")]


@pytest.mark.parametrize(
    ("off", "body"),
    [((), Capabilities(body="head", types=("gazeShift",), parts=("head",))), (("trunk",), A_TRUNK)],
    ids=["a body without a trunk", "switched off"],
)
def test_it_turns_to_nobody_without_a_trunk_or_this_policy(off: tuple[str, ...], body: Capabilities) -> None:
    stage = with_people(*off, body=body, ann=ASIDE)
    stage.until(60.0)
    stage.rule()

    assert turns(stage) == []


def test_who_is_nearly_ahead_is_faced_by_the_head_alone() -> None:
    stage = with_people(ann=AHEAD)
    stage.until(60.0)
    stage.rule()

    assert turns(stage) == []


def test_it_faces_neither_of_two_with_whom_it_speaks_by_turns() -> None:
    stage = with_people(ann=ASIDE, ben=BESIDE_THEM)
    for number in range(10):
        stage.until(stage.now + LASTS - 0.1)
        stage.do(lambda arbiter, who=("ben", "ann")[number % 2]: arbiter.speak_to(who))  # type: ignore[misc]
        stage.until(stage.now + 0.05)
        arrive(stage)
    assert turns(stage) == []

    stage.until(stage.now + LASTS)
    stage.rule()
    assert [who for _, who in turns(stage)] == ["ann"]


def test_who_speaks_to_it_for_long_is_faced_as_well() -> None:
    stage = with_people(ann=AHEAD, ben=ASIDE)
    stage.until(10.0)
    stage.feed(Floor(at=AT, speeches=(FloorSpeech(actor="ben", since=AT, to=("robot",)),)))
    stage.until(11.0)
    arrive(stage)
    stage.until(11.0 + LASTS)

    assert [who for _, who in turns(stage)] == ["ben"]


def test_a_turn_that_was_broken_off_is_tried_again_when_the_eyes_are_back() -> None:
    stage = with_people(ann=ASIDE)
    stage.until(LASTS)
    stage.rule()
    (shift,) = [ruling.shift for ruling in stage.rulings if ruling.shift is not None and ruling.shift.turn]
    stage.do(lambda arbiter: arbiter.shift_failed(shift.id, stage.now))
    stage.until(stage.now + 2.0)
    arrive(stage)
    stage.rule()

    assert [who for _, who in turns(stage)] == ["ann", "ann"]


def test_while_an_order_has_the_head_the_trunk_stays() -> None:
    stage = with_people(ann=ASIDE)
    stage.do(lambda arbiter: arbiter.inhibit(INHIBITED))
    stage.until(30.0)
    stage.rule()
    assert turns(stage) == []

    stage.do(lambda arbiter: arbiter.inhibit(None))
    stage.until(31.0)
    arrive(stage)
    stage.rule()
    assert [who for _, who in turns(stage)] == ["ann"]


def test_when_nobody_is_left_it_turns_back_ahead() -> None:
    stage = with_people(ann=ASIDE)
    stage.until(LASTS)
    stage.rule()
    arrive(stage)
    stage.feed(World(entities=()))
    stage.until(60.0)
    stage.rule()

    (_, first), (at, back) = turns(stage)
    assert (first, back) == ("ann", "")
    assert at > LASTS + ALONE
    arrive(stage)
    stage.until(120.0)
    assert len(turns(stage)) == 2


def test_it_turns_away_from_nobody_who_is_there_or_comes() -> None:
    stage = with_people(ann=ASIDE, ben=FAR)
    stage.until(30.0)
    stage.rule()
    assert turns(stage) == []

    stage = with_people(ann=ASIDE, ben=AHEAD)
    stage.until(LASTS)
    stage.rule()
    arrive(stage)
    assert [who for _, who in turns(stage)] == ["ann"]
    stage.feed(World(entities=(person("ann", ASIDE), person("ben", FAR))))
    stage.until(10.0)
    stage.rule()
    assert [who for _, who in turns(stage)] == ["ann", ""]


async def test_a_robot_that_only_talks_turns_to_who_sits_aside(hub: MemoryHub) -> None:
    turned: list[tuple[str, str]] = []

    async def follow() -> None:
        with hub.join("watch").subscribe(keys.BEHAVIOR) as inbox:
            async for received in inbox:
                told = received.message
                if isinstance(told, PerformBehavior) and isinstance(told.behavior, GazeShift):
                    turned.append((told.behavior.target, told.behavior.influence))

    async with robot(hub) as client, perceive("ben", hub=hub, position=(1.0, 0.9, 1.2)) as ben:
        await ben.look_at(ben.robot)
        following = asyncio.create_task(follow())
        await client.perform(call("It is nice that you are here, Ben, and I have a long story to tell you."))
        await asyncio.sleep(8.0)
        following.cancel()

    assert ("ben", "WAIST") in turned
