"""The pace by which a glance is due: the robot's own glances are no evidence of it."""

import pytest

from engage_hri.schemas.recognition import Statistics, WindowStatistics
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.maintenance_policy import MTBCE_PRIOR, GlanceWatch
from engage_hri.services.generation.head.scene import HeadScene
from tests.generation.heads import AT, event

RECENT = 4.0


@pytest.fixture
def watch() -> GlanceWatch:
    watch = GlanceWatch(HeadScene("robot", 0.1), GenerationConfig())
    watch.face = "human"
    return watch


def counted(watch: GlanceWatch, events: int, actor: str = "human") -> None:
    recent = WindowStatistics(mtbce_without_maintenance=RECENT)
    watch.feed(Statistics(actor=actor, at=AT, session=WindowStatistics(events=events), recent=recent), 0.0)


def glances(watch: GlanceWatch, count: int, person: str = "human", session: str = "s") -> None:
    for number in range(count):
        fields = {"initiator": "robot", "responder": person, "cause": "maintenance"}
        watch.feed(event(f"{session}-{person}{number}", "started", **fields), 0.0)


@pytest.mark.parametrize(("events", "pace"), [(7, MTBCE_PRIOR), (8, RECENT)])
def test_the_glances_of_the_robot_do_not_count(watch: GlanceWatch, events: int, pace: float) -> None:
    glances(watch, 3)
    counted(watch, events)

    assert watch.pace == pace


def test_glances_at_somebody_else_leave_the_count_of_a_person_alone(watch: GlanceWatch) -> None:
    glances(watch, 3, person="other")
    counted(watch, 5)

    assert watch.pace == RECENT


def test_without_statistics_of_the_person_the_glances_at_all_count(watch: GlanceWatch) -> None:
    glances(watch, 3, person="other")
    counted(watch, 7, actor="")

    assert watch.pace == MTBCE_PRIOR


def test_glances_of_a_former_life_of_recognition_are_not_taken_from_the_counts_of_the_next(
    watch: GlanceWatch,
) -> None:
    glances(watch, 20)
    glances(watch, 1, session="t")
    counted(watch, 6)

    assert watch.pace == RECENT
