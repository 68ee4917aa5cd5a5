"""How long a world holds whose publisher has gone."""

from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.world import Entity, World
from engage_hri.services.reports.in_force import NOTHING, WorldReport

WORLD = World(entities=(Entity(id="cup", kind="object", position=(0.5, 0.0, 0.7)),))
GONE = PeerGone(participant="camera")


def back(run: str) -> PeerAlive:
    return PeerAlive(participant="camera", run=run)


def told() -> WorldReport:
    report = WorldReport(4.0)
    assert report.take(WORLD, "camera", "1", 0.0) is WORLD
    return report


def test_it_is_over_a_grace_after_its_publisher_has_gone() -> None:
    report = told()

    assert report.take(GONE, "camera", "1", 1.0) is None
    assert report.deadline == 5.0
    assert report.advance(4.9) is None
    assert report.advance(5.0) == NOTHING
    assert (report.deadline, report.advance(9.0)) == (None, None)


def test_a_cut_that_is_shorter_changes_nothing() -> None:
    report = told()
    report.take(GONE, "camera", "1", 1.0)

    assert report.take(back("1"), "camera", "1", 2.0) is None
    assert (report.deadline, report.advance(9.0)) == (None, None)


def test_after_a_longer_one_the_same_life_goes_on_and_another_has_to_tell() -> None:
    for run, expected in (("1", WORLD), ("2", None)):
        report = told()
        report.take(GONE, "camera", "1", 1.0)
        report.advance(5.0)

        assert report.take(back(run), "camera", run, 9.0) == expected


def test_another_who_tells_a_world_meanwhile_is_believed() -> None:
    report = told()
    report.take(GONE, "camera", "1", 1.0)

    assert report.take(WORLD, "other", "2", 2.0) is WORLD
    assert report.take(PeerGone(participant="third"), "third", "3", 2.5) is None
    assert (report.deadline, report.advance(9.0)) == (None, None)


def test_a_return_when_the_grace_is_just_over_finds_the_world_as_it_was() -> None:
    report = told()
    report.take(GONE, "camera", "1", 1.0)

    assert report.take(back("1"), "camera", "1", 6.0) is WORLD
