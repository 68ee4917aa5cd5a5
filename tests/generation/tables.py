"""Worlds and bodies as tables of numbers: distractors and degrees are what a test says they are."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from engage_hri.schemas.behaviors import Reference, SpeechOption
from engage_hri.schemas.body import Estimate, EstimateItem, Ray
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Meters, Radians, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.block.emission import FragmentPlan
from engage_hri.services.generation.pipeline import planned, planning
from engage_hri.services.generation.references.motions import AT_REST, CURRENT_POSE, Motions, Way
from engage_hri.services.generation.references.pairs import (
    Layout,
    ReferenceScene,
    in_gaze_cones,
    in_pointing_cylinders,
)

TANGRAMS = (
    "pink-triangle", "purple-triangle", "yellow-triangle", "red-square", "blue-square", "pink-square",
    "green-square", "purple-square", "rectangle", "trapezoid",
)  # fmt: skip
HEIGHT = 1000.0
"""Of eyes and hands above the table, each right above what it is on: rays are parallel, cones are circles."""


def plan(*arguments: Any, **named: Any) -> FragmentPlan:
    """Plan a fragment with a body that is known in full."""

    def asked(items: Sequence[EstimateItem]) -> Sequence[Estimate]:
        raise AssertionError(f"the motions are incomplete: {items}")

    return planned(planning(*arguments, **named), asked)


def flat_world(places: Mapping[str, tuple[float, float]]) -> World:
    objects = [Entity(id=id, kind="object", position=(x, y, 0.0)) for id, (x, y) in places.items()]
    return World(entities=(*objects, Entity(id="human", kind="person", position=(99.0, 0.0, 0.0))))


def apart(ids: Sequence[str] = TANGRAMS) -> World:
    """Objects a metre from one another: no gesture can mean two of them."""
    return flat_world({id: (float(index), 0.0) for index, id in enumerate(ids)})


def scene(world: World, **fields: object) -> ReferenceScene:
    """Gaze means what is within 0.2 m of where it goes, pointing what is within 0.1 m."""
    return ReferenceScene(world=world, half_angle=0.2 / HEIGHT, pointing_radius=0.1, **fields)  # type: ignore[arg-type]


def in_gaze_cone(gaze: Ray, half_angle: Radians, layout: Layout) -> frozenset[str]:
    """Ids of the objects in the cone around one gaze axis."""
    return in_gaze_cones([gaze], half_angle, layout)[0]


def in_pointing_cylinder(forearm: Ray, radius: Meters, layout: Layout) -> frozenset[str]:
    """Ids of the objects in the half-cylinder ahead of one hand."""
    return in_pointing_cylinders([forearm], radius, layout)[0]


def body(
    world: World,
    sequence: Sequence[str],
    head: Callable[[str, str], float] = lambda since, target: 20.0,
    arm: Callable[[str, str], float] = lambda since, target: 60.0,
    arm_for: Callable[[str], str] = lambda target: "right_arm",
    out_of_reach: Sequence[str] = (),
    refused: Sequence[tuple[str, str]] = (),
) -> Motions:
    """Degrees by (since, target). refused: (since, target) of points that the body cannot make from there."""
    known: dict[Way, Estimate] = {}
    for target in sequence:
        entity = world.entity(target)
        assert entity is not None
        x, y, _ = entity.position
        above: Vector = (x, y, HEIGHT)
        for since in (CURRENT_POSE, AT_REST, *sequence):
            ray = Ray(origin=above, axis=(0.0, 0.0, -1.0), tip=above)
            look = Estimate(behavior="g", feasible=True, head_degrees=head(since, target), ray=ray)
            known[Way("head", since, target)] = look
            reached = target not in out_of_reach and (since, target) not in refused
            known[Way("arm", since, target)] = Estimate(
                behavior="p",
                feasible=reached,
                fault=None if reached else Fault(reason="out of reach"),
                arm_degrees=arm(since, target) if reached else 0.0,
                parts=(arm_for(target),) if reached else (),
                ray=ray if reached else None,
            )
    return Motions(known)


def option(
    text: str, cost: float | None = None, distractors: Sequence[str] = (), deictic: bool = False
) -> SpeechOption:
    words = len(text.split()) if cost is None else cost
    return SpeechOption(text=text, cost=words, distractors=tuple(distractors), deictic=deictic)


def refer(id: str, target: str, minimum: float, *options: SpeechOption) -> Reference:
    return Reference(id=id, target=target, minimum_reliability=minimum, options=options)
