"""Rendered people before a camera, in all poses, lights and distances in which a robot meets them: what is learned
from, and what is judged by."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from tests.perception.eyes.drawing import Picture
from tests.perception.eyes.people import Light, Looks, Person, Pose, blurred, drawn, noisy

CHUNKS = 2
"""Parts in which the cases of one person are made, each with chance of its own."""


class Case(NamedTuple):
    """A picture of somebody, and the truth of it."""

    looks: Looks
    pose: Pose
    picture: Picture


def cases(looks: Looks, number: int, chunk: int, count: int, fine: int = 2) -> Iterator[Case]:
    """Draw somebody a number of times. number: of the person; both are seeds. fine: as in `drawn`."""
    person, chance = Person(looks), np.random.default_rng(number * 37 + chunk)
    for k in range(count):
        pose, light, noise, blur = _chosen(chance, k)
        picture = drawn([(person, pose)], light, seed=number * 1000 + k, fine=fine)
        yield Case(looks, pose, noisy(blurred(picture, blur), noise, k))


def _chosen(chance: np.random.Generator, k: int) -> tuple[Pose, Light, float, int]:
    """A head within what a robot at a table sees of people, light from half to full, some noise and motion."""
    x, y, z = chance.uniform(-0.25, 0.25), chance.uniform(-0.15, 0.1), chance.uniform(0.5, 1.3)
    pose = Pose(
        (x * z / 0.7, y * z / 0.7, z),
        chance.uniform(-38, 38), chance.uniform(-28, 15), chance.uniform(-8, 8),
        (chance.uniform(-18, 18), chance.uniform(-10, 10)),
        chance.uniform(0, 0.5) if k % 3 == 0 else 0.0,
        1.0 if k % 4 else chance.uniform(0.3, 1),
    )  # fmt: skip
    light = Light(chance.uniform(0.3, 1.0), chance.uniform(0.2, 0.5), chance.uniform(-60, 60), chance.uniform(0, 60))
    return pose, light, chance.uniform(1, 6), int(chance.integers(0, 4))
