"""Hands that move draw the robot's look; those of a person who is lost count as still."""

import pytest

from engage_hri.schemas.perception import ActorLost
from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.maintenance_policy import HAND_ONSET, HAND_STILLNESS, HandWatch
from engage_hri.services.generation.head.scene import HeadScene
from tests.generation.heads import AT


def hand(owner: str, speed: float) -> Entity:
    return Entity(id=f"{owner}-hand", kind="hand", owner=owner, position=(0.5, 0.0, 0.8), velocity=(speed, 0.0, 0.0))


@pytest.mark.parametrize(("lost", "watched"), [("ann", "bob-hand"), ("bob", "ann-hand")])
def test_of_two_moving_hands_the_one_whose_owner_is_lost_is_let_go_and_the_other_is_watched(
    lost: str, watched: str
) -> None:
    watch = HandWatch(HeadScene("robot", 0.1), GenerationConfig())
    both = World(entities=(hand("ann", 1.0), hand("bob", 1.0)))
    watch.feed(both, 0.0)
    moving = HAND_ONSET
    assert watch.claim(moving, ()) is not None
    watch.feed(ActorLost(actor=lost, at=AT), moving)

    claims = [watch.claim(moving + HAND_STILLNESS + later, ()) for later in (0.01, 5.0)]

    assert [claim and claim.target for claim in claims] == [watched, watched]
