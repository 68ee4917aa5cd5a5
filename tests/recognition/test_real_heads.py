"""Engagement of people whose heads a robot's camera has seen, labelled by people as engaged or disengaged.

`real_heads.csv`: recording, person, seconds, metres from the camera, degrees between the head's direction and the
line from the head to the camera. Reduced to five a second from the test recordings of ROS4HRI's hri_engagement
(Apache 2.0).
"""

import csv
import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import pytest

from engage_hri.schemas.perception import HeadPose
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.world import Entity, World
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.perceive.attending import Attending
from engage_hri.services.recognition.perceive.gaze_targets import ROBOT_FACE
from engage_hri.services.recognition.perceive.sure_looks import SureLooks
from engage_hri.services.recognition.recognizer import Recognizer
from engage_hri.services.recognition.statistics.published import PublishedStatistics
from tests.recognition.observations import ROBOT, stamp

Row = tuple[float, str, float, float]


@cache
def recordings() -> dict[str, list[Row]]:
    found: dict[str, list[Row]] = {}
    for name, person, at, distance, angle in csv.reader(
        Path(__file__).with_name("real_heads.csv").read_text().splitlines()
    ):
        found.setdefault(name, []).append((float(at), person, float(distance), float(angle)))
    return found


def pose(person: str, distance: float, angle: float, at: float) -> HeadPose:
    """A head in front of the robot, turned upwards by the angle from the line to its face."""
    x, y, z = ROBOT_FACE
    aside = 0.45 * (person != "p1")
    ahead = math.sqrt(max(0.01, distance**2 - aside**2))
    back = (-ahead / distance, -aside / distance)
    turn = math.radians(angle)
    direction = (math.cos(turn) * back[0], math.cos(turn) * back[1], math.sin(turn))
    return HeadPose(actor=person, position=(x + ahead, y + aside, z), direction=direction, at=stamp(at))


@cache
def estimates(name: str) -> dict[str, list[float]]:
    """What is told of the engagement of each person of a recording, looked at ten times a second."""
    config = RecognitionConfig()
    recognizer, published = Recognizer(ROBOT, config), PublishedStatistics(ROBOT, config)
    last: dict[str, float] = {}
    told: dict[str, list[float]] = {}

    def take(results: Sequence[object], now: float) -> None:
        changes = [each for each in results if isinstance(each, ConnectionEvent)]
        published.feed(changes, set(), now, recognizer.contacts())
        for each in published.told(now):
            if each.actor and each.engagement is not None:
                last[each.actor] = each.engagement
        for person, value in last.items():
            told.setdefault(person, []).append(value)

    rows = recordings()[name]
    people = {person: pose(person, distance, angle, 0.0).position for at, person, distance, angle in rows[::-1]}
    entities = (Entity(id="table", kind="surface", position=(0.5, 0.0, 0.7)),)
    entities += tuple(Entity(id=person, kind="person", position=place) for person, place in people.items())
    take(recognizer.feed(World(entities=entities, at=stamp(0.0)), 0.0, 0.0), 0.0)
    for at, person, distance, angle in rows:
        now = at + 0.01
        while (due := min(filter(None, (recognizer.deadline, published.deadline)), default=now)) < now:
            take(recognizer.advance(due), due)
        take(recognizer.feed(pose(person, distance, angle, now), now, now), now)
    return told


@cache
def attention(name: str, *, learned: bool) -> dict[str, float]:
    """How much each head of a recording attends to the robot, in the mean."""
    heads: dict[str, Attending] = {}
    told: dict[str, list[float]] = {}
    for at, person, _, angle in recordings()[name]:
        head = heads.setdefault(person, Attending())
        told.setdefault(person, []).append(head.judge((0.0, angle), at, is_free=learned))
    return {person: sum(course) / len(course) for person, course in told.items()}


def ranked(above: list[float], below: list[float]) -> float:
    """Share of the pairs of which the first is above the second: the area under the ROC curve."""
    pairs = [(one, other) for one in above for other in below]
    return sum(one > other or 0.5 * (one == other) for one, other in pairs) / len(pairs)


def sure_looks(name: str) -> SureLooks:
    """What is learned while it is known that somebody looks at the robot; deviations are as eyes state them."""
    sure = SureLooks()
    for at, _, _, angle in recordings()[name]:
        if int(at) % 2 == 0:
            sure.take((0.0, -angle), (0.0, 0.0), (2.7, 5.5), at)
        else:
            sure.rest()
    return sure


@pytest.mark.parametrize("name", ["engaged_1", "engaged_2", "engaged_3"])
def test_a_head_that_is_far_beside_the_robot_in_sure_looks_is_learned_as_it_is(name: str) -> None:
    """The first such look alone may have been at something else. Within what is stated, from four looks on."""
    sure, angles = sure_looks(name), [angle for *_, angle in recordings()[name]]

    assert len(sure.looks) >= 4
    assert sure.at_robot is not None
    assert sure.at_robot[1] == pytest.approx(sum(angles) / len(angles), abs=5.5)


@pytest.mark.parametrize("of", ["mean", "last"])
def test_the_estimate_ranks_engaged_people_above_disengaged_ones(of: str) -> None:
    values: dict[bool, list[float]] = {True: [], False: []}
    for name in recordings():
        for course in estimates(name).values():
            values["disengaged" not in name].append(sum(course) / len(course) if of == "mean" else course[-1])

    assert len(values[True]) == len(values[False]) == 5
    assert ranked(values[True], values[False]) >= 0.9


def test_who_attends_to_the_robot_for_all_of_the_time_is_engaged() -> None:
    assert min(estimates("engaged_1")["p1"][20:]) > 0.5


@pytest.mark.parametrize("name", recordings())
def test_what_is_learned_of_a_head_is_for_the_good_of_the_engaged(name: str) -> None:
    """Where a head points that attends is learned from the engaged; of the others there is nothing to learn."""
    before, after = attention(name, learned=False), attention(name, learned=True)
    gains = [after[person] - before[person] for person in before]

    if "disengaged" in name:
        assert gains == pytest.approx([0.0] * len(gains), abs=0.02)
    else:
        assert max(gains) > 0.03
        assert min(gains) >= 0.0
