"""Random tables, fragments, bodies and permissions, to compare two ways to plan. The same seed makes the same one."""

import random
from collections.abc import Callable, Sequence
from typing import NamedTuple

from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    BlockBehavior,
    FragmentBehavior,
    Gaze,
    GazeShift,
    Pointing,
    PostureShift,
    Reference,
    Speech,
    SpeechOption,
    Wait,
)
from engage_hri.schemas.body import BodyPose, Estimate, EstimateItem, NoPointZone
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.inhibitions import Permits

COLORS, SHAPES = ("red", "green", "blue"), ("square", "triangle", "cup")
PIECE = ((0.02, 0.02), (-0.02, 0.02), (-0.02, -0.02), (0.02, -0.02))

Answer = Callable[[EstimateItem], Estimate]
"""The estimate of one motion, in full."""


class Scenario(NamedTuple):
    """moving: gazes and points under way. posture: what the body does before it is asked. after: for how long."""

    world: World
    fragment: TurnFragment
    zones: tuple[NoPointZone, ...]
    permits: Permits
    config: GenerationConfig
    moving: tuple[BlockBehavior, ...]
    posture: tuple[BlockBehavior, ...]
    after: float


def scenario(seed: int) -> Scenario:
    chance = random.Random(seed)
    world = table(chance)
    ids = [entity.id for entity in world.objects]
    targets = [chance.choice(ids) for _ in range(chance.randint(1, 7))]
    posture: list[BlockBehavior] = []
    if chance.random() < 0.4:
        posture.append(PostureShift(id="posture", stance=chance.choice(("STANDING", "SITTING"))))
    if chance.random() < 0.5:
        posture.append(GazeShift(id="shift", target=chance.choice((*ids, "ann"))))
    if chance.random() < 0.5:
        posture.append(Gaze(id="look", target=chance.choice(ids)))
    if chance.random() < 0.3:
        posture.append(Pointing(id="show", target=chance.choice(ids)))
    moving: list[BlockBehavior] = []
    if chance.random() < 0.3:
        moving.append(Gaze(id="under-way", target=chance.choice(ids)))
    if chance.random() < 0.2:
        moving.append(Pointing(id="shown", target=chance.choice(ids)))
    place = chance.choice(world.objects).position
    return Scenario(
        world=world,
        fragment=fragment(chance, targets, ids),
        zones=(NoPointZone(center=place, radius=chance.choice((0.05, 0.2))),) if chance.random() < 0.3 else (),
        permits=permits(chance),
        config=config(chance),
        moving=tuple(moving),
        posture=tuple(posture),
        after=chance.choice((0.0, 0.12, 0.31, 1.0, 4.0)),
    )


def table(chance: random.Random) -> World:
    """Some things within reach, some beyond it, some on top of one another, and two people."""
    things: list[Entity] = []
    for number in range(chance.randint(3, 9)):
        place = (chance.uniform(0.22, 0.9), chance.uniform(-0.7, 0.7), chance.choice((0.73, 0.73, 0.8, 1.1)))
        if chance.random() < 0.12:
            place = (chance.uniform(-1.0, 3.0), chance.uniform(-2.5, 2.5), chance.uniform(0.0, 2.0))
        if things and chance.random() < 0.2:
            x, y, z = chance.choice(things).position
            place = (x + 0.01, y, z + 0.01)
        things.append(
            Entity(
                id=f"thing-{number}", kind="object", position=place, yaw=chance.uniform(0.0, 3.0),
                footprint=PIECE if chance.random() < 0.5 else (), radius=chance.choice((0.0, 0.02, 0.05)),
                color=chance.choice(("", *COLORS)), shape=chance.choice(("", *SHAPES)),
            )
        )  # fmt: skip
    people = [
        Entity(id=id, kind="person", position=(1.3 + chance.uniform(-0.3, 0.3), y + chance.uniform(-0.3, 0.3), 1.2))
        for id, y in (("ann", 0.0), ("bob", 0.6))
    ]
    return World(entities=(*things, *people))


def fragment(chance: random.Random, targets: Sequence[str], ids: Sequence[str]) -> TurnFragment:
    behaviors: list[FragmentBehavior] = []
    for number, target in enumerate(targets):
        if chance.random() < 0.4:
            text = chance.choice(("and", "next to", "and put it slowly and carefully on the left side of"))
            behaviors.append(Speech(id=f"s{number}", text=text))
        elif chance.random() < 0.1:
            behaviors.append(Wait(id=f"w{number}", duration=0.5))
        behaviors.append(
            Reference(
                id=f"r{number}",
                target=target,
                minimum_reliability=chance.choice((None, 0.05, 0.3, 0.6, 0.75, 0.85, 0.95, 0.99)),
                options=options(chance, target, ids) if chance.random() < 0.7 else None,
            )
        )
    status = chance.choice(("full", "beginning", "end"))
    return TurnFragment(
        id="f", addressee=chance.choice(("ann", "bob")), turn_status=status, behaviors=tuple(behaviors)
    )


def options(chance: random.Random, target: str, ids: Sequence[str]) -> tuple[SpeechOption, ...]:
    others = [id for id in ids if id != target]
    made = [SpeechOption(text="this", cost=1, deictic=True)] if chance.random() < 0.6 else []
    for number in range(chance.randint(0 if made else 1, 4)):
        left = tuple(sorted(chance.sample(others, chance.randint(0, len(others)))))
        text = chance.choice(("", "it", f"the one {number}", f"that other thing {number}"))
        made.append(SpeechOption(text=text, cost=len(text.split()), distractors=left))
    return tuple(made)


def permits(chance: random.Random) -> Permits:
    match chance.randrange(8):
        case 0:
            return Permits(gaze=False)
        case 1:
            return Permits(hands=())
        case 2:
            return Permits(hands=("LEFT_HAND",))
        case 3:
            return Permits(hands=("RIGHT_HAND",))
    return Permits()


def config(chance: random.Random) -> GenerationConfig:
    return GenerationConfig(
        profile=chance.choice(("check-back", "check-back", "figure-3.3")),
        channel=chance.choice(("sum", "independent")),
        minimum_reliability=chance.choice((0.5, 0.85)),
    )


# -- bodies that are not the simulated one ------------------------------------------------------------------------


def without_arms(answer: Answer) -> Answer:
    """A body that can look, and that is all."""

    def told(item: EstimateItem) -> Estimate:
        if isinstance(item.behavior, Pointing):
            fault = Fault(reason="this body has no arms", where=item.behavior.id)
            return Estimate(behavior=item.behavior.id, feasible=False, fault=fault)
        return answer(item)

    return told


def stubborn(answer: Answer) -> Answer:
    """A body that refuses one motion in four: always the same from the same pose."""

    def told(item: EstimateItem) -> Estimate:
        asked = repr((item.behavior, item.pose and rounded(item.pose)))
        if random.Random(asked).random() < 0.25:
            fault = Fault(reason="not from here", where=item.behavior.id)
            return Estimate(behavior=item.behavior.id, feasible=False, fault=fault)
        return answer(item)

    return told


def terse(answer: Answer) -> Answer:
    """A body that tells no poses, and no rays of its arms."""

    def told(item: EstimateItem) -> Estimate:
        ray = None if isinstance(item.behavior, Pointing) else (made := answer(item)).ray
        made = answer(item)
        return replace(made, pose_after=None, pose_end=None, ray=ray if made.feasible else None)

    return told


def rounded(pose: BodyPose) -> tuple[tuple[str, float], ...]:
    return tuple((joint.joint, round(joint.angle, 6)) for joint in pose.joints)
