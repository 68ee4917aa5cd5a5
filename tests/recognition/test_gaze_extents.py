"""What a gaze is on, with outlines of any form: against an oracle that only walks around corners and along edges."""

import math
from collections import Counter
from collections.abc import Iterator
from operator import mul
from random import Random

import pytest

from engage_hri.schemas.units import Stamp, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.perceive.gaze_targets import AWAY, GazeTargets, Targets
from tests.random_cases import share_of

EYE: Vector = (1.1, 0.1, 1.25)
HALF = math.radians(RecognitionConfig().sensing.gaze_half_angle)
Outline = list[tuple[float, float]]
SQUARE: Outline = [(-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2)]


def outline_of(random: Random) -> Outline:
    """A polygon without crossings, maybe a hollow one, whose corners go around the middle either way."""
    if random.random() < 0.4:
        return SQUARE[:: random.choice((1, -1))]
    count, way = random.randint(3, 7), random.choice((1, -1))
    turns = [way * math.tau * k / count for k in range(count)]
    return [(r * math.cos(turn), r * math.sin(turn)) for turn in turns for r in (random.uniform(0.05, 0.45),)]


def spot_of(random: Random, reach: float) -> tuple[float, float]:
    return random.uniform(-reach, reach), random.uniform(-reach, reach)


def placed(footprint: Outline, place: Vector, yaw: float) -> Outline:
    cos, sin = math.cos(yaw), math.sin(yaw)
    return [(place[0] + cos * u - sin * v, place[1] + sin * u + cos * v) for u, v in footprint]


def winds_around(outline: Outline, x: float, y: float) -> bool:
    """The corners go once around the point: the angles between neighbors add up to a whole turn."""
    turned = 0.0
    for (a, b), (c, d) in zip(outline, outline[1:] + outline[:1], strict=True):
        turned += math.remainder(math.atan2(d - y, c - x) - math.atan2(b - y, a - x), math.tau)
    return abs(turned) > math.pi


def along_edges(outline: Outline) -> Iterator[tuple[float, float]]:
    for (a, b), (c, d) in zip(outline, outline[1:] + outline[:1], strict=True):
        yield from ((a + k / 400 * (c - a), b + k / 400 * (d - b)) for k in range(401))


def angle_to(outline: Outline, z: float, direction: Vector) -> float:
    """Angle between the gaze and the nearest of many points of the edges; 0 where it goes through the outline."""
    far = (z - EYE[2]) / direction[2] if direction[2] else -1.0
    if far > 0.0 and winds_around(outline, EYE[0] + far * direction[0], EYE[1] + far * direction[1]):
        return 0.0
    rays = ((x - EYE[0], y - EYE[1], z - EYE[2]) for x, y in along_edges(outline))
    cosines = (sum(map(mul, ray, direction)) / math.hypot(*ray) / math.hypot(*direction) for ray in rays)
    return math.acos(min(1.0, max(cosines)))


def target(entities: tuple[Entity, ...], direction: Vector) -> Targets:
    targets = GazeTargets("robot", RecognitionConfig())
    targets.see_face("robot", (9.0, 0.0, 1.2))  # behind the person
    targets.see(World(entities=entities, at=Stamp("c", 0.0)), 0.0)
    return targets.target("ann", (EYE, direction), present=None, at=0.0, sure=1.0).targets


def toward(x: float, y: float, z: float) -> Vector:
    return (x - EYE[0], y - EYE[1], z - EYE[2])


def test_a_gaze_is_on_a_thing_if_its_cone_meets_the_outline() -> None:
    found = Counter[Targets]()
    for seed in range(share_of(1200, 4)):
        random = Random(seed)
        footprint, yaw, (x, y), (u, v) = (
            outline_of(random),
            random.uniform(-3, 3),
            spot_of(random, 0.4),
            spot_of(random, 0.3),
        )
        place, direction = (x, y, 0.75), toward(x + u, y + v, 0.75)
        nearest = angle_to(placed(footprint, place, yaw), 0.75, direction)
        if abs(nearest - HALF) < 0.002:  # less than the steps of the oracle
            continue
        thing = Entity(id="thing", kind="object", position=place, yaw=yaw, footprint=tuple(footprint))

        assert target((thing,), direction) == (("thing",) if nearest < HALF else AWAY), seed
        found[target((thing,), direction)] += 1
    assert min(found[AWAY], found["thing",]) > 20


def test_a_gaze_at_nothing_is_on_the_surface_that_it_goes_through() -> None:
    found = Counter[Targets]()
    for seed in range(share_of(1200, 4)):
        random = Random(seed)
        spot, yaw, height = spot_of(random, 0.6), random.uniform(-3, 3), random.uniform(0.4, 1.0)
        surfaces = tuple(
            Entity(
                id=f"at {y}", kind="surface", position=(0.0, y, height), yaw=yaw, footprint=tuple(outline_of(random))
            )
            for y in (-0.4, 0.4)
        )
        shapes = [placed([*each.footprint], each.position, yaw) for each in surfaces]
        if any(math.dist(spot, each) < 0.003 for shape in shapes for each in along_edges(shape)):
            continue
        under = [each.id for each, shape in zip(surfaces, shapes, strict=True) if winds_around(shape, *spot)]

        assert target(surfaces, toward(*spot, height)) == tuple(under[:1]), seed
        found[tuple(under[:1])] += 1
    assert min(found.values()) > 10


@pytest.mark.parametrize("up", [0.0, 0.4])
def test_a_gaze_that_never_comes_down_is_on_no_surface(up: float) -> None:
    table = Entity(id="table", kind="surface", position=(0.0, 0.0, 0.7), footprint=tuple(SQUARE))

    assert target((table,), (-1.0, 0.0, up)) == AWAY
