"""Random blocks on the simulated body, in virtual time and without deviations: how far each point is from its plan.

    python -m tests.realizer.exact_blocks [--shifts] [--blocks 2000] [--seed 0]     prints the table of what is off

The generator knows types, sync points and the clock, and nothing of plans: most blocks are possible, some are not.
Parts are used by several behaviors at once, points are tied, ordered and fixed. What is off is told by the feedback
alone: the time at which a point was reached, against the time that the plan had for it.
"""

import argparse
import asyncio
import random
from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import (
    After,
    Before,
    BlockBehavior,
    Constraint,
    FaceLexeme,
    FaceShift,
    Gaze,
    GazeShift,
    Gesture,
    Head,
    HeadDirectionShift,
    Mark,
    Pointing,
    Posture,
    PostureShift,
    Speech,
    Synchronize,
    Timing,
    Wait,
)
from engage_hri.schemas.blocks import (
    Block,
    BlockOutcome,
    PerformBlock,
    SyncPointProgress,
    WarningFeedback,
    WarningKind,
)
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.service import embody
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.requests.ends import Requester, RequestRefused
from engage_hri.services.runtime.service import running
from engage_hri.services.runtime.virtual_time import run_virtual

OFF = 0.010
"""Seconds: a point that is more than this from its plan is off."""
WORLD = World(
    entities=(
        Entity(id="human", kind="person", position=(1.3, 0.1, 1.2)),
        Entity(id="ball", kind="object", position=(0.6, 0.3, 0.75), radius=0.03),
        Entity(id="cup", kind="object", position=(0.5, 0.05, 0.73), radius=0.03),
        Entity(id="box", kind="object", position=(0.55, -0.35, 0.73), radius=0.03),
    )
)
TARGETS = ("human", "ball", "cup", "box")


class Performed(NamedTuple):
    """What came of a block. at: time of each point, and the time that the plan had for it. warnings: their kinds."""

    block: Block
    outcome: BlockOutcome | None
    at: dict[str, tuple[float, float]]
    warnings: list[WarningKind]

    @property
    def off(self) -> dict[str, float]:
        """Seconds from the plan, by point."""
        return {name: reached - planned for name, (reached, planned) in self.at.items()}

    @property
    def worst(self) -> float:
        return max(map(abs, self.off.values()), default=0.0)


def random_block(seed: int, *, shifts: bool) -> Block:
    chance = random.Random(seed)
    behaviors = [_behavior(f"b{number}", chance, shifts) for number in range(chance.randint(2, 7))]
    behaviors = [_timed(each, chance) if chance.random() < 0.5 else each for each in behaviors]
    points = [f"{each.id}:{sync}" for each in behaviors for sync in sync_points(each)]
    operators: list[Synchronize | After | Before] = []
    for _ in range(chance.choice((0, 0, 1, 1, 2, 3))):
        one, other = (
            f"{point}+0" if offset == 0 else f"{point}{offset:+g}"
            for point, offset in zip(chance.sample(points, 2), (0, chance.choice((0, 0, 0, 0.5, -0.3))), strict=True)
        )
        operators.append(chance.choice((Synchronize, Synchronize, After, Before))(ref=one, syncs=(other,)))
    constraints = (Constraint(operators=tuple(operators)),) if operators else ()
    return Block(id=f"block-{seed}", behaviors=tuple(behaviors), constraints=constraints)


def _behavior(id: str, chance: random.Random, shifts: bool) -> BlockBehavior:
    hand = chance.choice((None, "LEFT_HAND", "RIGHT_HAND"))
    words = chance.choice(("this one", "and now the other one over there", "well"))
    kinds: list[BlockBehavior] = [
        Gaze(id=id, target=chance.choice(TARGETS)),
        Gaze(id=id, target=chance.choice(TARGETS)),
        Pointing(id=id, target=chance.choice(TARGETS[1:]), mode=hand),  # type: ignore[arg-type]
        Gesture(id=id, lexeme="BEAT", mode=chance.choice((hand, "BOTH_HANDS"))),  # type: ignore[arg-type]
        Head(id=id, lexeme=chance.choice(("NOD", "SHAKE")), repetition=chance.randint(1, 2)),
        FaceLexeme(id=id, lexeme=chance.choice(("SMILE", "RAISE_BROWS"))),
        Speech(id=id, text=words, marks=(Mark("m", len(words) // 2),)),
        Posture(id=id, lexeme=chance.choice(("LEAN_FORWARD", "TURN_LEFT"))),
        Wait(id=id, duration=chance.choice((0.4, 1.5))),
    ]
    if shifts:
        kinds += [
            GazeShift(id=id, target=chance.choice(TARGETS)),
            HeadDirectionShift(id=id, target=chance.choice(TARGETS)),
            FaceShift(id=id, lexeme=chance.choice(("SMILE", "RAISE_BROWS"))),
            PostureShift(id=id, lexeme=chance.choice(("LEAN_FORWARD", "TURN_LEFT"))),
        ]
    return chance.choice(kinds)


def _timed(behavior: BlockBehavior, chance: random.Random) -> BlockBehavior:
    """The behavior with one or two of its points at clock times."""
    points = sync_points(behavior)
    first = round(chance.uniform(0.0, 3.0), 1)
    timing = [Timing(chance.choice((points[0], chance.choice(points))), str(first))]
    if chance.random() < 0.3 and timing[0].sync != points[-1]:
        timing.append(Timing(points[-1], str(round(first + chance.uniform(1.0, 4.0), 1))))
    return _with(behavior, tuple(timing))


def _with(behavior: BlockBehavior, timing: tuple[Timing, ...]) -> BlockBehavior:
    return replace(behavior, timing=timing)


def perform(block: Block) -> Performed:
    return run_virtual(_perform(block))


async def fed_back(block: Block, world: World, body: Body) -> tuple[BlockOutcome | None, list[object]]:
    """Perform a block on a body. Returns the outcome, None if the block was refused, and all feedback in order."""
    told: list[object] = []
    async with MemoryHub() as hub:
        eyes, bus = hub.join("simulation"), hub.join("test")
        eyes.publish(keys.WORLD, world)
        services = {
            "control": partial(embody, config=ControlConfig(), body=body),
            "realizer": partial(realize, config=RealizerConfig()),
        }
        async with running(hub, services), Requester(bus) as requests:
            with bus.subscribe(keys.FEEDBACK) as inbox:
                request = PerformBlock(id=f"r-{block.id}", requester="test", block=block)
                try:
                    outcome = await asyncio.wait_for(requests.send(keys.BLOCK, request).outcome, 300.0)
                except RequestRefused:
                    outcome = None
                await asyncio.sleep(0.0)
                while len(inbox):
                    received = await inbox.next()
                    assert received is not None
                    told.append(received.message)
        await bus.leave()
        await eyes.leave()
    assert outcome is None or isinstance(outcome, BlockOutcome)
    return outcome, told


async def _perform(block: Block) -> Performed:
    outcome, told = await fed_back(block, WORLD, SimulatedBody())
    at = {
        f"{each.behavior}:{each.sync}": (each.time, each.predicted)
        for each in told
        if isinstance(each, SyncPointProgress) and each.predicted is not None
    }
    warnings = [each.kind for each in told if isinstance(each, WarningFeedback)]
    return Performed(block, outcome, at, warnings)


def performed(blocks: int, *, shifts: bool, seed: int = 0) -> Iterator[Performed]:
    """So many blocks that the realizer has accepted."""
    accepted = 0
    while accepted < blocks:
        each = perform(random_block(seed, shifts=shifts))
        seed += 1
        if each.outcome is not None:
            accepted += 1
            yield each


def first_off(each: Performed) -> str:
    """The first point that is off, as `type:sync`: what comes after is only its consequence."""
    types = {behavior.id: type(behavior).__name__ for behavior in each.block.behaviors}
    id, _, sync = next(name for name, seconds in each.off.items() if abs(seconds) > OFF).partition(":")
    return f"{types[id]}:{sync}"


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--blocks", type=int, default=2000)
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--shifts", action="store_true")
    given = arguments.parse_args()
    off: dict[str, list[Performed]] = {}
    for each in performed(given.blocks, shifts=given.shifts, seed=given.seed):
        if each.worst > OFF:
            off.setdefault(first_off(each), []).append(each)
    count = sum(map(len, off.values()))
    print(f"{count} of {given.blocks} blocks ({100 * count / given.blocks:.1f} %) have a point more than 10 ms off")
    for kind, found in sorted(off.items(), key=lambda item: -len(item[1])):
        worst = sorted(each.worst for each in found)
        examples = " ".join(each.block.id.removeprefix("block-") for each in found[:6])
        print(f"{len(found):4}  {kind:28} {worst[0]:.3f} to {worst[-1]:.3f} s, blocks {examples}")


if __name__ == "__main__":
    main()
