"""The degrees that generation counts for a gesture are those that the body turns: random fragments, joints watched.

The oracle adds up what the joint angles do between `start` and `stroke`, and knows nothing of poses or estimates.
"""

import asyncio
import random
from itertools import pairwise

import pytest

from engage_hri.schemas.behaviors import FragmentBehavior, Speech
from engage_hri.schemas.fragments import ReferenceChoice, TurnFragment
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.references.policy import EXPECTED_DELAY
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.generation.robots import Robot, robot
from tests.generation.tables import option, refer
from tests.random_cases import share_of

STEP = 0.01
WAIT = 1e6
"""Weight of waiting: so dear that a gesture is made only where nothing less will do."""
HEADS = GenerationConfig(
    policies_off=("aversion",),  # what it turns away and back beside a fragment no plan knows of
    seconds_per_head_degree=1.0,
    seconds_per_arm_degree=1e-9,
    seconds_per_word=0.0,
    wait_weight=WAIT,
)
"""Cost is degrees of the head, but for waiting."""
ARMS = GenerationConfig(
    seconds_per_head_degree=1e-9, seconds_per_arm_degree=1.0, seconds_per_word=0.0, wait_weight=WAIT
)
PLACES = [
    (0.45, 0.30, 0.73), (0.55, 0.12, 0.73), (0.42, -0.05, 0.73), (0.60, -0.18, 0.73), (0.48, -0.33, 0.73),
]  # fmt: skip
WORLD = World(
    entities=(
        Entity(id="human", kind="person", position=(1.3, 0.1, 1.2)),
        *(Entity(id=f"thing-{n}", kind="object", position=at, radius=0.02) for n, at in enumerate(PLACES)),
    )
)
BETWEEN = ("", "", "and", "next to", "and then you take", "and put it slowly and carefully on the left side of")
Angles = dict[str, float]


def fragment(chance: random.Random) -> TurnFragment:
    behaviors: list[FragmentBehavior] = []
    for number in range(chance.randint(2, 4)):
        if text := chance.choice(BETWEEN):
            behaviors.append(Speech(id=f"s{number}", text=text))
        target = f"thing-{chance.randrange(len(PLACES))}"
        pointed = refer(f"r{number}", target, 0.9, option("this", deictic=True))
        looked = refer(f"r{number}", target, 0.72, option("the big one", 3.0, deictic=False))
        said = refer(f"r{number}", target, 0.3, option("that other thing", 3.0, deictic=False))
        behaviors.append(chance.choice((pointed, pointed, looked, looked, said)))
    return TurnFragment(id="f", turn_status="full", behaviors=tuple(behaviors))


async def watched(stage: Robot, body: SimulatedBody) -> list[tuple[float, Angles]]:
    """Joint angles until the fragment is over, ever so often."""
    seen: list[tuple[float, Angles]] = []
    while "f" not in stage.outcomes:
        seen.append((stage.now, {angle.joint: angle.angle for angle in body.state().pose.joints}))
        await asyncio.sleep(STEP)
    return seen


def turned(seen: list[tuple[float, Angles]], since: float, until: float, part: str) -> float:
    """Degrees that the joints of `part` turn in that time, there and back counted twice."""
    within = [angles for at, angles in seen if since - STEP <= at <= until + STEP]
    joints = [joint for joint in within[0] if part in joint]
    return sum(abs(b[joint] - a[joint]) for a, b in pairwise(within) for joint in joints) * 57.29577951308232


def part_of(choice: ReferenceChoice, stage: Robot) -> str:
    point = next(each for each in stage.blocks["f"].block.behaviors if each.id == f"{choice.reference}-point")
    return "left_" if point.mode == "LEFT_HAND" else "right_"  # type: ignore[union-attr]


def compare(seed: int, config: GenerationConfig) -> list[tuple[float, float]]:
    """Degrees expected and turned, of each gesture of one random fragment."""

    async def main() -> list[tuple[float, float]]:
        body = SimulatedBody()
        async with MemoryHub() as hub, robot(hub, config, WORLD, body) as stage:
            stage.send(fragment(random.Random(seed)))
            seen = await asyncio.wait_for(watched(stage, body), 200.0)
        found = []
        for choice in stage.outcomes["f"][1].choices:
            id, points = choice.reference, choice.gesture == "directed_gaze_with_pointing"
            if choice.gesture == "none" or (config is ARMS and not points):
                continue
            waits = WAIT * EXPECTED_DELAY if choice.gesture != "gaze" else 0.0
            expected = choice.cost - waits
            behavior, part = (
                (f"f:{id}-gaze", "neck") if config is HEADS else (f"f:{id}-point", part_of(choice, stage))
            )
            since, until = stage.reached[f"{behavior}:start"], stage.reached[f"{behavior}:stroke"]
            found.append((expected, turned(seen, since, until, part)))
        return found

    return run_virtual(main())


@pytest.mark.parametrize("config", [HEADS, ARMS], ids=["heads", "arms"])
def test_degrees_expected_are_degrees_turned(config: GenerationConfig) -> None:
    seeds = range(12)[-share_of(12) :]
    compared = [pair for seed in seeds for pair in compare(seed, config)]

    assert len(compared) >= len(seeds)
    wrong = [(said, seen) for said, seen in compared if abs(said - seen) > max(0.05 * seen, 1.0)]
    assert wrong == []
