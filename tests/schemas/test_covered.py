"""What a report of the world leaves out is covered for a while, and gone after that."""

import pytest

from engage_hri.schemas.world import CoveredObjects, Entity, World

CUP = Entity(id="cup", kind="object", position=(0.5, 0.0, 0.7))
PLATE = Entity(id="plate", kind="object", position=(0.5, 0.2, 0.7))
ANN = Entity(id="ann", kind="person", position=(1.2, 0.0, 1.2))


def ids(world: World | None) -> list[str]:
    assert world is not None
    return [entity.id for entity in world.entities]


@pytest.fixture
def covered() -> CoveredObjects:
    covered = CoveredObjects(patience=10.0)
    covered.see(World(entities=(CUP, PLATE, ANN)), 0.0)
    return covered


def test_nothing_is_known_before_the_first_report():
    assert CoveredObjects(patience=10.0).at(0.0) is None


def test_a_report_that_leaves_nothing_out_stays_as_it_is(covered: CoveredObjects):
    world = World(entities=(PLATE, CUP))

    assert covered.see(world, 60.0) is world


def test_a_missing_object_stays_where_it_was_seen_last(covered: CoveredObjects):
    world = covered.see(World(entities=(PLATE, ANN)), 60.0)

    assert world.entity("cup") == CUP
    assert ids(covered.at(70.0)) == ["plate", "ann", "cup"]


def test_it_is_gone_when_it_has_been_missing_for_too_long(covered: CoveredObjects):
    covered.see(World(entities=(PLATE, ANN)), 60.0)
    covered.see(World(entities=(PLATE, ANN)), 65.0)

    assert ids(covered.at(70.001)) == ["plate", "ann"]


def test_it_may_come_back_elsewhere_and_be_covered_again(covered: CoveredObjects):
    moved = Entity(id="cup", kind="object", position=(0.6, -0.2, 0.7))
    covered.see(World(entities=(PLATE,)), 60.0)
    covered.see(World(entities=(PLATE, moved)), 66.0)
    world = covered.see(World(entities=(PLATE,)), 67.0)

    assert world.entity("cup") == moved
    assert ids(covered.at(77.0)) == ["plate", "cup"]


def test_people_and_hands_that_are_not_reported_are_not_there(covered: CoveredObjects):
    assert ids(covered.see(World(entities=(CUP, PLATE)), 1.0)) == ["cup", "plate"]
