"""A robot that stands elsewhere than it measures: people look to where its eyes really are."""

import random

import pytest

from engage_hri.schemas.body import BodyPose, Ray, RobotSeen, RobotState
from engage_hri.schemas.units import Seconds, Stamp, Vector
from engage_hri.services.simulation.human import Human
from engage_hri.services.tangram.people.cameras import Cameras
from engage_hri.services.tangram.people.config import SimulationConfig
from engage_hri.services.tangram.people.head import Sightlines
from engage_hri.services.tangram.people.person_at_table import PersonAtTable
from engage_hri.services.tangram.people.table import Table
from engage_hri.services.tangram.table import tangram_table

MEASURED: Vector = (0.05, 0.0, 1.17)
REALLY: Vector = (0.05, 0.3, 1.0)


def stamp(at: Seconds) -> Stamp:
    return Stamp("test", at)


def ray(origin: Vector) -> Ray:
    return Ray(origin=origin, axis=(1.0, 0.0, 0.0))


def state(eyes: Vector) -> RobotState:
    return RobotState(at=stamp(0.0), pose=BodyPose(), gaze=ray(eyes), left_arm=ray(eyes), right_arm=ray(eyes))


def seen(eyes: Vector | None) -> RobotSeen:
    return RobotSeen(at=stamp(0.0), gaze=None if eyes is None else ray(eyes))


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ((state(MEASURED),), MEASURED),
        ((seen(REALLY),), REALLY),
        ((state(MEASURED), seen(REALLY)), REALLY),
        ((seen(REALLY), state(MEASURED)), REALLY),
        ((seen(REALLY), state(MEASURED), seen(MEASURED)), MEASURED),
        ((seen(REALLY), seen(None)), REALLY),
        ((seen(REALLY), seen(None), state(MEASURED)), MEASURED),
    ],
)
def test_people_look_to_where_its_eyes_are_and_not_where_it_measures_them(
    told: tuple[RobotSeen | RobotState, ...], expected: Vector
) -> None:
    config = SimulationConfig()
    table = Table(tangram_table())
    lines = Sightlines(table, "robot")
    scene = PersonAtTable(Human(()), table, robot="robot", frame=config.frame, stamp=stamp)
    cameras = Cameras(scene, lines, config, stamp, random.Random)
    for message in told:
        cameras.feed(message, 0.0)

    assert lines.robot_eyes == expected
    aim = [there - here for there, here in zip(expected, lines.eyes, strict=True)]
    length = sum(part * part for part in aim) ** 0.5
    assert lines.to("robot", 0.0) == pytest.approx([part / length for part in aim])
