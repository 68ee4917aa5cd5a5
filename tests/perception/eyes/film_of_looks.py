"""Films of people who look from one thing to the next, of which all is known: at what, since when, where heads point.

Somebody sits at the table before a robot whose camera is at its eyes. They look at the robot, at six pieces of the
tangram, at empty places of the table, at who sits beside it, and past all of that. A head goes a part of the way,
more to the side than down, by a habit of each person and by chance each time, and the eyes go the rest. It turns
within a quarter of a second, seen once on the way; then it keeps still, and each picture has noise of its own.

In the first six looks it is known at what they are: twice at the robot that asks for it, then at four pieces at which
the person points.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from engage_hri.schemas.perception import FaceLandmarks
from engage_hri.schemas.units import Seconds, Stamp, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.perception.eyes.config import EyesConfig
from engage_hri.services.perception.eyes.looking import packed
from engage_hri.services.perception.eyes.sources.litert import FaceFinder
from engage_hri.services.recognition.perceive.gaze_targets import ROBOT_FACE, SURFACE
from engage_hri.services.tangram.table import tangram_table
from tests.perception.eyes.drawing import Picture
from tests.perception.eyes.fetched import MODELS
from tests.perception.eyes.people import CAMERA, JUDGED, Light, Person, Pose, drawn

RATE = 15.0
TURN: Seconds = 0.25
"""Time that a head needs for its way."""
GRAINS = 7
"""Patterns of noise that pictures have in turn."""
SURE = 6
"""Looks at the beginning of which it is known at what they are."""
BESIDE = "neighbor"
PIECES = ("trapezoid", "blue-square", "green-square", "rectangle", "pink-triangle", "purple-square")
EMPTY: tuple[Vector, ...] = ((0.85, 0.0, 0.72), (0.72, -0.05, 0.72), (0.42, -0.1, 0.72), (0.85, 0.36, 0.72))
"""Places of the table with no piece near."""
PAST: tuple[Vector, ...] = ((0.3, 1.2, 2.2), (0.0, -1.2, 1.9), (-0.5, 0.6, 2.4), (-1.0, -1.6, 1.2))
"""Places where nothing is."""
EYES = EyesConfig(field_of_view=2 * float(np.degrees(np.arctan(CAMERA.width / 2 / CAMERA.focal))), place=ROBOT_FACE)


class FilmedLook(NamedTuple):
    """A look. target: a name; empty: at nothing. since: when the head has come to it. until: when it leaves it."""

    target: str
    place: Vector
    since: Seconds
    until: Seconds
    pose: Pose
    way: Pose
    """The head halfway."""


class FilmedPerson(NamedTuple):
    """Somebody in a film."""

    number: int
    eyes: Vector
    looks: Sequence[FilmedLook]
    light: Light


def world() -> World:
    """The table as it is told to recognition."""
    table = tangram_table()
    pieces = (table.lying(each, each.start) for each in table.pieces if each.id in PIECES)
    top = Entity(id=SURFACE, kind="surface", position=table.surface.center, footprint=table.surface.footprint)
    return World(entities=(top, *pieces, Entity(id=BESIDE, kind="person", position=(0.62, 0.85, 1.2))))


def filmed(number: int, looks: int) -> FilmedPerson:
    """Make up what somebody does. number: of the person, of those of whom nothing is learned."""
    chance = np.random.default_rng(700 + number)
    places = {each.id: each.position for each in world().entities if each.kind != "surface"}
    ahead, left, up = chance.uniform((1.05, -0.12, 1.13), (1.25, 0.12, 1.25)).tolist()
    eyes: Vector = (ahead, left, up)
    share = habit(chance)
    pieces = [PIECES[k] for k in chance.permutation(len(PIECES))]
    parts = (("robot", 0.24), (SURFACE, 0.12), (BESIDE, 0.12), ("", 0.1))
    rest = [name for name, part in parts for _ in range(round(part * looks))]
    rest += [PIECES[k % len(PIECES)] for k in range(looks - len(rest))]
    rest = [rest[k] for k in chance.permutation(len(rest))]
    at, before, made = 0.0, Pose((0.0, 0.0, 1.0)), list[FilmedLook]()
    for name in [*("robot", pieces[0], pieces[1], "robot", pieces[2], pieces[3]), *rest]:
        choices = EMPTY if name == SURFACE else PAST
        place = ROBOT_FACE if name == "robot" else places.get(name) or choices[int(chance.integers(len(choices)))]
        pose = head_at(eyes, place, share, stray(chance))
        way = (
            pose
            if not made
            else pose._replace(yaw=(before.yaw + pose.yaw) / 2, pitch=(before.pitch + pose.pitch) / 2)
        )
        since = at + (TURN if made else 0.0)
        at = since + float(chance.uniform(1.0, 2.0))
        made.append(FilmedLook(name, place, since, at, pose, way))
        before = pose
    light = Light(
        chance.uniform(0.5, 0.9), chance.uniform(0.25, 0.45), chance.uniform(-50, 50), chance.uniform(10, 50)
    )
    return FilmedPerson(number, eyes, made, light)


def habit(chance: np.random.Generator) -> tuple[float, float]:
    """Shares of the way to the side, and up or down, that a head goes; the eyes go the rest."""
    return chance.uniform(0.7, 0.95), chance.uniform(0.5, 0.75)


def stray(chance: np.random.Generator) -> Vector:
    """By how many degrees the head of a look is beside its habit: to the side, up, and aslant."""
    return (chance.normal(0, 1.5), chance.normal(0, 1.5), chance.uniform(-2, 2))


def head_at(eyes: Vector, place: Vector, share: tuple[float, float], beside: Vector) -> Pose:
    """Turn a head towards a place, from the robot's face on by its share of the way; the eyes go the rest."""
    there, robot = (_angles(eyes, each) for each in (place, ROBOT_FACE))
    yaw, pitch = (
        back + part * (to - back) + by for back, to, part, by in zip(robot, there, share, beside[:2], strict=True)
    )
    x, y, z = (a - b for a, b in zip(eyes, ROBOT_FACE, strict=True))
    rest = (float(np.clip(there[0] - yaw, -30, 30)), float(np.clip(there[1] - pitch, -30, 30)))
    lids = 1 - max(0.0, -rest[1]) / 50  # they follow the eyes down
    return Pose((-y, -z, x), yaw, pitch, beside[2], rest, lids=lids)


def _angles(eyes: Vector, place: Vector) -> tuple[float, float]:
    """Degrees to the right of the picture and up, as in `Pose`, of the way from eyes to a place."""
    x, y, z = (b - a for a, b in zip(eyes, place, strict=True))
    return float(np.degrees(np.arctan2(-y, -x))), float(np.degrees(np.arctan2(z, np.hypot(x, y))))


def pictures(person: FilmedPerson, looks: Sequence[FilmedLook]) -> Iterator[tuple[Seconds, Picture]]:
    """The pictures of some looks, in order: noise apart, two of each."""
    model = Person(JUDGED[person.number])
    shape = (GRAINS, CAMERA.height, CAMERA.width, 3)
    grain = np.rint(np.random.default_rng(person.number).normal(0, 3, shape)).astype(np.int16)
    for look in looks:
        way, still = (drawn([(model, pose)], person.light, seed=person.number) for pose in (look.way, look.pose))
        first, last = (int(np.ceil(at * RATE)) for at in (look.since - TURN, look.until))
        for number in range(first, last):
            at = number / RATE
            share = (at - look.since) / TURN + 1
            if share > 0.25:  # before that it is still where it was
                yield at, np.clip(grain[number % GRAINS] + (still if share > 0.75 else way), 0, 255).astype(np.uint8)


def landmarks(person: FilmedPerson) -> Iterator[FaceLandmarks]:
    """What the source that looks at such a film tells."""
    finder = FaceFinder(MODELS, 1)
    for at, picture in pictures(person, person.looks):
        faces = tuple(packed(points, confidence) for points, confidence in finder.find(picture))
        yield FaceLandmarks(at=Stamp("loop", at), width=CAMERA.width, height=CAMERA.height, faces=faces)
