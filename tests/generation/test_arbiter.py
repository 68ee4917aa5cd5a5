"""Each claim on the head alone: when it is acquired and released, to the millisecond."""

import math

import pytest

from engage_hri.schemas.body import Ray
from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.arbiter import Arbiter
from engage_hri.services.generation.head.response_policy import viewing_order
from tests.generation.head_stories import check
from tests.generation.heads import Stage, act, on_the_face, world
from tests.stories import Story, each

# -- each claim, alone against the face -------------------------------------------------------------------------


def test_nobody_owns_the_head_until_there_is_a_face() -> None:
    stage = Stage()
    stage.rule()
    stage.until(1.0)
    stage.feed(world(person=False))
    stage.until(2.0)
    stage.feed(world())

    assert stage.owners == [(0.0, "none", ""), (2.0, "face", "human")]
    assert stage.shifts == [(2.0, "maintenance", "human")]


def test_nobody_owns_the_head_since_the_first_ruling() -> None:
    ruling = Arbiter("robot", GenerationConfig()).rule(861.0)  # seconds of a machine that was on long before

    assert (ruling.owner.kind, ruling.since) == ("none", 861.0)


def test_of_two_moving_hands_the_first_is_followed_while_it_moves() -> None:
    def hands(**speeds: float) -> World:
        human = Entity(id="human", kind="person", position=(1.3, 0.0, 1.2))
        moving = [
            Entity(id=id, kind="hand", owner="human", position=(0.8, 0.0, 0.7), velocity=(speed, 0.0, 0.0))
            for id, speed in speeds.items()
        ]
        return World(entities=(human, *moving))

    stage = on_the_face(glance_factor=100.0)
    stage.feed(hands(left=0.3, right=0.3))
    stage.until(10.1)
    stage.feed(hands(left=0.0, right=0.3))
    stage.until(11.0)
    stage.feed(hands(left=0.3, right=0.3))
    stage.until(12.0)
    stage.feed(hands(left=0.3, right=0.0))
    stage.until(13.0)

    assert stage.owners == [(10.0, "face", "human"), (10.2, "hands", "right"), (12.8, "hands", "left")]


def test_quiet_for_longer_than_the_mean_time_between_events_asks_for_a_glance() -> None:
    stage = on_the_face()
    stage.feed(act())  # the head leaves the face at 10.0
    stage.until(20.0)

    assert stage.owners == [
        (10.0, "hands", "hand"),
        (15.7, "glance", "human"),  # after 5.7 s
        (16.9, "hands", "hand"),  # .9 s and a dwell of .3 s later
    ]
    glance = next(ruling.shift for ruling in stage.rulings if ruling.shift and ruling.shift.glance)
    announced = glance.block.behaviors[1]
    assert (announced.kind, announced.cause, announced.optional) == ("mutual_facial_gaze", "maintenance", True)  # type: ignore[union-attr]


# -- several objects ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("apart", "order"), [(0.98, ("left",)), (1.02, ("right", "left"))])
def test_one_gaze_is_a_cone_of_the_half_angle_around_the_middle_of_the_objects(
    apart: float, order: tuple[str, ...]
) -> None:
    """apart: the angle from the middle to each, in half-angles. The present gaze is to the right of both."""
    half_angle = 0.2
    aside = math.tan(apart * half_angle)
    left = Entity(id="left", kind="object", position=(1.0, aside, 0.0))
    right = Entity(id="right", kind="object", position=(1.0, -aside, 0.0))
    gaze = Ray(origin=(0.0, 0.0, 0.0), axis=(0.0, -1.0, 0.0))

    assert viewing_order(("left", "right"), World(entities=(left, right)), gaze, half_angle) == order


# -- as stories: `head_stories.py` --------------------------------------------------------------------------------

STORIES = """
a face lost for two seconds leaves the direction
    10 lost human; 20 found human
    owners: 10 face human, 12 face, 20 face human
    shifts: none

a face that comes back in time was never lost
    10 no face; 11.9 face; 20 time
    owners: 10 face human
    shifts: none

a moving hand is followed after its onset until it has been still
    10 hand 0.3; 11 hand 0; 13 time
    owners: 10 face human, 10.2 hands hand, 12.1 face human
    shifts: 10.2 maintenance hand, 12.1 maintenance human

a slow movement is not followed
    10 hand 0.05; 15 hand 0; 20 time
    owners: 10 face human
    shifts: none

a short movement is not followed
    10 hand 0.3; 10.19 hand 0; 20 time
    owners: 10 face human
    shifts: none

a hand is followed through a manipulation even while it rests
    with glance_factor=100
    10 act; 15 act over; 20 time
    owners: 10 hands hand, 16.1 face human
    shifts: 10 maintenance hand, 16.1 maintenance human

the robot looks where the human directs until the event ends
    END in failed withdrawn completed superseded
    10 event e started; 11 event e END; 15 time
    owners: 10 response piece, 11.3 face human
    shifts: 10 response piece, 11.3 maintenance human

shared gaze is held for a while
    10 event e started; 10.5 event e succeeded; 15 time
    owners: 10 response piece, 11.6 face human
    shifts: 10 response piece, 11.6 maintenance human

facial gaze is met
    with glance_factor=100
    10 act; 11 event m started kind=mutual_facial_gaze objects=
    owners: 10 hands hand, 11 response human
    shifts: 10 maintenance hand, 11 response human

an adjacency pair is not answered with a look
    10 event e started kind=adjacency_pair
    owners: 10 face human
    shifts: none

a backchannel is not answered with a look
    10 event e started kind=backchannel
    owners: 10 face human
    shifts: none

an event of the robot's own is not answered with a look
    10 event e started initiator=robot responder=human
    owners: 10 face human
    shifts: none

an event about another robot is not answered with a look
    10 event e started responder=other-robot
    owners: 10 face human
    shifts: none

the pace is the recent one
    10 pace 4 10; 10 act; 14.1 time
    owners: 10 face human, 10 hands hand, 14 glance human
    shifts: 10 maintenance hand, 14 maintenance human

the pace has an upper limit
    10 pace 1 10; 10 act; 13.1 time
    owners: 10 face human, 10 hands hand, 13 glance human
    shifts: 10 maintenance hand, 13 maintenance human

the pace has a lower limit
    10 pace 60 10; 10 act; 25.1 time
    owners: 10 face human, 10 hands hand, 25 glance human
    shifts: 10 maintenance hand, 25 maintenance human

four events are too few for a pace of their own
    10 pace 4 4; 10 act; 15.8 time
    owners: 10 face human, 10 hands hand, 15.7 glance human
    shifts: 10 maintenance hand, 15.7 maintenance human

five events are enough for a pace of their own
    10 pace 4 5; 10 act; 14.1 time
    owners: 10 face human, 10 hands hand, 14 glance human
    shifts: 10 maintenance hand, 14 maintenance human

without a recent pace it is the lowest
    10 pace none 10; 10 act; 25.1 time
    owners: 10 face human, 10 hands hand, 25 glance human
    shifts: 10 maintenance hand, 25 maintenance human

every connection event puts the glance off
    10 act; 14 event x started kind=adjacency_pair; 19.7 time
    owners: 10 hands hand, 19.7 glance human
    shifts: 10 maintenance hand, 19.7 maintenance human

on a face there is nothing to glance at
    100 time
    owners: none
    shifts: none

objects far apart are looked at one by one the nearest first
    10 gaze 0.6 -0.3 0.7; 10 event e started objects=piece,other; 12 time
    owners: 10 face human, 10 response other, 12 response piece
    shifts: 10 response other, 12 response piece

objects within one gaze are met by one look
    with gaze_half_angle=0.5
    10 gaze 0.6 -0.3 0.7; 10 event e started objects=piece,other,between; 13 time
    owners: 10 face human, 10 response between
    shifts: 10 response between
"""


@each(STORIES)
def test_a_claim_alone(story: Story) -> None:
    check(story)


def test_the_head_is_not_sent_to_whom_the_world_has_lost_a_moment_ago_but_to_them_once_they_are_back() -> None:
    stage = on_the_face()
    stage.feed(world(speed=0.3))
    stage.until(10.5)
    stage.feed(world(person=False))  # the hand lies still
    stage.until(12.2)
    owner_while_away = stage.owner
    stage.feed(world())
    stage.until(13.0)

    assert owner_while_away == "face"
    assert [(at, target) for at, _, target in stage.shifts] == [(10.2, "hand"), (12.2, "human")]
