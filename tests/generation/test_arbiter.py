"""Each claim on the head alone: when it is acquired and released, to the millisecond."""

import math

import pytest

from engage_hri.schemas.actions import ActorFound, ActorLost
from engage_hri.schemas.body import Ray
from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.head.response_policy import viewing_order
from tests.generation.heads import AT, Stage, act, event, looking_at, on_the_face, statistics, world

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


def test_a_face_lost_for_two_seconds_leaves_the_direction() -> None:
    stage = on_the_face()
    stage.feed(ActorLost(actor="human", at=AT))
    stage.until(20.0)
    stage.feed(ActorFound(actor="human", at=AT))

    assert stage.owners == [(10.0, "face", "human"), (12.0, "face", ""), (20.0, "face", "human")]
    assert stage.shifts == []  # the base gaze is still there


def test_a_face_that_comes_back_in_time_was_never_lost() -> None:
    stage = on_the_face()
    stage.feed(world(person=False))
    stage.until(11.9)
    stage.feed(world())
    stage.until(20.0)

    assert stage.owners == [(10.0, "face", "human")]


def test_a_moving_hand_is_followed_after_its_onset_until_it_has_been_still() -> None:
    stage = on_the_face()
    stage.feed(world(speed=0.3))
    stage.until(11.0)
    stage.feed(world(speed=0.0))
    stage.until(13.0)

    assert stage.owners == [(10.0, "face", "human"), (10.2, "hands", "hand"), (12.1, "face", "human")]
    assert stage.shifts == [(10.2, "maintenance", "hand"), (12.1, "maintenance", "human")]


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


@pytest.mark.parametrize(("speed", "lasts"), [(0.05, 5.0), (0.3, 0.19)])
def test_a_slow_or_short_movement_is_not_followed(speed: float, lasts: float) -> None:
    stage = on_the_face()
    stage.feed(world(speed=speed))
    stage.until(10.0 + lasts)
    stage.feed(world(speed=0.0))
    stage.until(20.0)

    assert stage.owners == [(10.0, "face", "human")]


def test_a_hand_is_followed_through_a_manipulation_even_while_it_rests() -> None:
    stage = on_the_face(glance_factor=100.0)
    stage.feed(act())
    stage.until(15.0)
    stage.feed(act(ends=True))
    stage.until(20.0)

    assert stage.owners == [(10.0, "hands", "hand"), (16.1, "face", "human")]


@pytest.mark.parametrize("end", ["failed", "withdrawn", "completed", "superseded"])
def test_the_robot_looks_where_the_human_directs_until_the_event_ends(end: str) -> None:
    stage = on_the_face()
    stage.feed(event("e", "started"))
    stage.until(11.0)
    stage.feed(event("e", end))
    stage.until(15.0)

    assert stage.owners == [(10.0, "response", "piece"), (11.3, "face", "human")]
    assert stage.shifts == [(10.0, "response", "piece"), (11.3, "maintenance", "human")]


def test_shared_gaze_is_held_for_a_while() -> None:
    stage = on_the_face()
    stage.feed(event("e", "started"))
    stage.until(10.5)
    stage.feed(event("e", "succeeded"))
    stage.until(15.0)

    assert stage.owners == [(10.0, "response", "piece"), (11.6, "face", "human")]  # .5 + .8 + dwell .3


def test_facial_gaze_is_met() -> None:
    stage = on_the_face(glance_factor=100.0)
    stage.feed(act())
    stage.until(11.0)
    stage.feed(event("m", "started", kind="mutual_facial_gaze", objects=()))

    assert stage.owners[-1] == (11.0, "response", "human")


@pytest.mark.parametrize(
    "fields",
    [
        {"kind": "adjacency_pair"},
        {"kind": "backchannel"},
        {"initiator": "robot", "responder": "human"},
        {"responder": "other-robot"},
    ],
)
def test_what_is_not_the_response_policys_business(fields: dict[str, object]) -> None:
    stage = on_the_face()
    stage.feed(event("e", "started", **fields))

    assert stage.owner == "face"


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


@pytest.mark.parametrize(
    ("mtbce", "events", "due"),
    [(4.0, 10, 4.0), (1.0, 10, 3.0), (60.0, 10, 15.0), (4.0, 4, 5.7), (4.0, 5, 4.0), (None, 10, 15.0)],
)
def test_the_pace_is_the_recent_one_within_its_limits(mtbce: float | None, events: int, due: float) -> None:
    stage = on_the_face()
    stage.feed(statistics(mtbce, events), act())
    stage.until(30.0)

    assert (round(10.0 + due, 6), "glance", "human") in stage.owners


def test_every_connection_event_puts_the_glance_off() -> None:
    stage = on_the_face()
    stage.feed(act())
    stage.until(14.0)
    stage.feed(event("x", "started", kind="adjacency_pair"))
    stage.until(19.69)
    assert stage.owner == "hands"
    stage.until(19.7)

    assert stage.owner == "glance"


def test_on_a_face_there_is_nothing_to_glance_at() -> None:
    stage = on_the_face()
    stage.until(100.0)

    assert stage.owners == []


# -- several objects ----------------------------------------------------------------------------------------------


def test_objects_far_apart_are_looked_at_one_by_one_the_nearest_first() -> None:
    stage = on_the_face()
    stage.feed(looking_at((0.6, -0.3, 0.7)))
    stage.feed(event("e", "started", objects=("piece", "other")))
    stage.until(12.0)

    assert stage.owners[-2:] == [(10.0, "response", "other"), (10.8, "response", "piece")]


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


def test_objects_within_one_gaze_are_met_by_one_look() -> None:
    stage = on_the_face(gaze_half_angle=0.5)
    stage.feed(looking_at((0.6, -0.3, 0.7)))
    stage.feed(event("e", "started", objects=("piece", "other", "between")))
    stage.until(13.0)

    assert [target for _, kind, target in stage.owners if kind == "response"] == ["between"]
